//! `bearing3` x `trig18` written by hand: the reference that the library's automatic kernel is compared with.
//!
//! Everything is known to the compiler: the model, its derivatives, the six functions and theirs, all sizes. Points go in blocks
//! of eight vectors, sums stay in registers. It is what an expert would write for this one pair.

use std::f64::consts::PI;

use cfpose::{Lane, Scalar};
use pulp::{Simd, WithSimd};

/// Vectors per block.
const VECTORS: usize = 8;

/// Sums over points of the 18 basis functions (coordinate by coordinate) and of their derivatives along six directions.
pub struct HandSums {
    /// sum phi_(q, i) at [6 q + i].
    pub value: [f64; 18],
    /// Derivatives along rotation and translation.
    pub jacobian: [[f64; 6]; 18],
}

/// The kernel: points as columns, theta as rotation matrix and translation, normalisation x -> scale (x - mean).
#[derive(Clone, Copy)]
pub struct Hand<'a> {
    /// Coordinates.
    pub columns: [&'a [f64]; 3],
    /// Rotation, row by row.
    pub rotation: [f64; 9],
    /// Translation.
    pub translation: [f64; 3],
    /// Mean of the normalisation.
    pub mean: [f64; 3],
    /// Scale of each coordinate.
    pub scale: [f64; 3],
}

#[repr(align(64))]
struct Aligned<T>(T);

/// Working space of one block: per vector, derivatives of each coordinate and slopes of its functions.
struct Space<S: Simd> {
    x: Aligned<[[Lane<S>; 3]; VECTORS]>,
    dx: Aligned<[[[Lane<S>; 6]; VECTORS]; 3]>,
    slope: Aligned<[[Lane<S>; 6]; VECTORS]>,
    value_sum: Aligned<[[Lane<S>; 6]; 3]>,
    sum: Aligned<[[[Lane<S>; 6]; 6]; 3]>,
}

impl WithSimd for Hand<'_> {
    type Output = HandSums;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> HandSums {
        let zero = Lane::splat(simd, 0.0);
        let one = Lane::splat(simd, 1.0);
        let mut space = Space {
            x: Aligned([[zero; 3]; VECTORS]),
            dx: Aligned([[[zero; 6]; VECTORS]; 3]),
            slope: Aligned([[zero; 6]; VECTORS]),
            value_sum: Aligned([[zero; 6]; 3]),
            sum: Aligned([[[zero; 6]; 6]; 3]),
        };
        let (count, block) = (self.columns[0].len(), VECTORS * S::F64_LANES);
        let full = count / block * block;
        let mut start = 0;
        while start < full {
            for v in 0..VECTORS {
                let at = start + v * S::F64_LANES;
                let p = [0, 1, 2].map(|d| Lane::load(simd, &self.columns[d][at..]));
                self.point(simd, p, None, v, &mut space);
            }
            self.sums(&[one; VECTORS], false, &mut space);
            start += block;
        }
        if full < count {
            // The rest, padded, with weights.
            let mut padded = [[0.5; 64]; 4];
            padded[3] = [0.0; 64];
            for k in full..count {
                for d in 0..3 {
                    padded[d][k - full] = self.columns[d][k];
                }
                padded[3][k - full] = 1.0;
            }
            let mut weights = [one; VECTORS];
            for v in 0..VECTORS {
                let at = v * S::F64_LANES;
                weights[v] = Lane::load(simd, &padded[3][at..]);
                let p = [0, 1, 2].map(|d| Lane::load(simd, &padded[d][at..]));
                self.point(simd, p, Some(weights[v]), v, &mut space);
            }
            self.sums(&weights, true, &mut space);
        }
        let mut out = HandSums { value: [0.0; 18], jacobian: [[0.0; 6]; 18] };
        for q in 0..3 {
            for i in 0..6 {
                out.value[6 * q + i] = space.value_sum.0[q][i].sum();
                for j in 0..6 {
                    out.jacobian[6 * q + i][j] = space.sum.0[q][i][j].sum();
                }
            }
        }
        out
    }
}

impl Hand<'_> {
    /// Map one vector of points: x = scale (y / norm(y) - mean) for y = R p + T, and its derivatives along R exp([w]) and T.
    #[inline(always)]
    fn point<S: Simd>(&self, simd: S, p: [Lane<S>; 3], weight: Option<Lane<S>>, v: usize, space: &mut Space<S>) {
        let r = &self.rotation;
        let mut y = [p[0]; 3];
        let mut turned = [[p[0]; 3]; 3];
        for i in 0..3 {
            let row = [Lane::splat(simd, r[3 * i]), Lane::splat(simd, r[3 * i + 1]), Lane::splat(simd, r[3 * i + 2])];
            let sum = row[0].mul_add(p[0], Lane::splat(simd, self.translation[i]));
            y[i] = row[2].mul_add(p[2], row[1].mul_add(p[1], sum));
            // R (e_j x p).
            turned[0][i] = row[2] * p[1] - row[1] * p[2];
            turned[1][i] = row[0] * p[2] - row[2] * p[0];
            turned[2][i] = row[1] * p[0] - row[0] * p[1];
        }
        let inverse = (y[0] * y[0] + y[1] * y[1] + y[2] * y[2]).sqrt().recip();
        let unit = [y[0] * inverse, y[1] * inverse, y[2] * inverse];
        for q in 0..3 {
            space.x.0[v][q] = (unit[q] - self.mean[q]) * self.scale[q];
            // d unit / d y = (I - unit unit') / norm(y).
            let mut factor = inverse * self.scale[q];
            if let Some(weight) = weight {
                factor = factor * weight;
            }
            let mut row = [factor; 3];
            for c in 0..3 {
                let identity = Lane::splat(simd, if c == q { 1.0 } else { 0.0 });
                row[c] = (identity - unit[q] * unit[c]) * factor;
            }
            for j in 0..3 {
                let sum = row[1].mul_add(turned[j][1], row[0] * turned[j][0]);
                space.dx.0[q][v][j] = row[2].mul_add(turned[j][2], sum);
                space.dx.0[q][v][3 + j] = row[j];
            }
        }
    }

    /// Add one block to the sums.
    #[inline(always)]
    fn sums<S: Simd>(&self, weights: &[Lane<S>; VECTORS], weighted: bool, space: &mut Space<S>) {
        for q in 0..3 {
            let mut total = space.value_sum.0[q];
            for v in 0..VECTORS {
                let x = space.x.0[v][q];
                let (sine, cosine) = x.sin_cos_pi();
                let value = [x, sine, x * cosine, x * x, sine * sine, cosine];
                for i in 0..6 {
                    total[i] = if weighted { value[i].mul_add(weights[v], total[i]) } else { total[i] + value[i] };
                }
                let slope = cosine * PI;
                space.slope.0[v] =
                    [x.constant(1.0), slope, cosine - x * sine * PI, x * 2.0, sine * slope * 2.0, -(sine * PI)];
            }
            space.value_sum.0[q] = total;
            for half in [0, 3] {
                let mut sum = [[total[0]; 3]; 6];
                for i in 0..6 {
                    for j in 0..3 {
                        sum[i][j] = space.sum.0[q][i][half + j];
                    }
                }
                for v in 0..VECTORS {
                    for i in 0..6 {
                        for j in 0..3 {
                            sum[i][j] = space.slope.0[v][i].mul_add(space.dx.0[q][v][half + j], sum[i][j]);
                        }
                    }
                }
                for i in 0..6 {
                    for j in 0..3 {
                        space.sum.0[q][i][half + j] = sum[i][j];
                    }
                }
            }
        }
    }
}
