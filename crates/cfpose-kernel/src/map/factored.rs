//! The adapter that erases a factored map, `x = project(A lift(p) + b)`.

use num_dual::{DualSVec64, HyperDual64};
use pulp::{Simd, WithSimd};

use super::{DynMap, FactoredFacts, LiftedPoints, MapBlock, PreparedMap, Transform};
use crate::author::Map;
use crate::isa::Isa;
use crate::jet::Jet;
use crate::lane::Lane;
use crate::points::{Attribute, BLOCK, Points};
use crate::scalar::Scalar;

/// Number of tangent directions that one pass of num-dual carries: any tangent size, no heap duals.
pub const SEEDS: usize = 8;

/// Erase a [`Map`].
pub struct Factored<M, const POINT: usize, const ROWS: usize, const DIM: usize> {
    map: M,
}

impl<M: Map<POINT, ROWS, DIM>, const POINT: usize, const ROWS: usize, const DIM: usize> Factored<M, POINT, ROWS, DIM> {
    /// Wrap an author's map.
    pub fn new(map: M) -> Self {
        Self { map }
    }
}

/// Run an author's `lift` over all points, padding included.
pub(super) fn lift_points(
    points: &Points,
    lift_len: usize,
    attribute: Option<&str>,
    mut lift: impl FnMut([f64; 3], [f64; 3], &mut [f64]),
) -> LiftedPoints {
    let extra = match attribute.and_then(|name| points.attribute(name)) {
        Some(Attribute::Vector(columns)) => columns.as_slice(),
        _ => &[],
    };
    let padded = points.padded_len();
    let mut columns = vec![vec![0.0; padded]; lift_len];
    let mut lifted = vec![0.0; lift_len];
    for k in 0..padded {
        let mut point = [0.0; 3];
        for (d, value) in point.iter_mut().enumerate().take(points.dim()) {
            *value = points.padded_column(d)[k];
        }
        let mut attached = [0.0; 3];
        for (value, column) in attached.iter_mut().zip(extra) {
            *value = column[k.min(points.len() - 1)];
        }
        lift(point, attached, &mut lifted);
        for (column, value) in columns.iter_mut().zip(&lifted) {
            column[k] = *value;
        }
    }
    LiftedPoints { len: points.len(), columns, weights: points.padded_weights().to_vec() }
}

/// Seed ambient theta with the tangent directions `first..first + SEEDS`.
pub fn seed_theta(theta: &[f64], basis: &[f64], tangent: usize, first: usize) -> Vec<DualSVec64<SEEDS>> {
    let width = SEEDS.min(tangent - first);
    (0..theta.len())
        .map(|i| {
            let mut eps = [0.0; SEEDS];
            eps[..width].copy_from_slice(&basis[i * tangent + first..i * tangent + first + width]);
            DualSVec64::new(theta[i], num_dual::Derivative::some(eps.into()))
        })
        .collect()
}

/// Return derivative `c` of a dual.
fn derivative(dual: &DualSVec64<SEEDS>, c: usize) -> f64 {
    dual.eps.0.as_ref().map_or(0.0, |eps| eps[c])
}

impl<M: Map<POINT, ROWS, DIM>, const POINT: usize, const ROWS: usize, const DIM: usize> DynMap
    for Factored<M, POINT, ROWS, DIM>
{
    fn point_dim(&self) -> usize {
        POINT
    }

    fn dim(&self) -> usize {
        DIM
    }

    fn factored(&self) -> Option<FactoredFacts> {
        let lift_len = self.map.lift_len();
        let has_density = self.map.density([1.0; ROWS]).is_some();
        Some(FactoredFacts { rows: ROWS, lift_len, identity_projection: M::PROJECTION_IS_IDENTITY, has_density })
    }

    fn attribute(&self) -> Option<&'static str> {
        self.map.attribute()
    }

    fn lift(&self, points: &Points) -> LiftedPoints {
        lift_points(points, self.map.lift_len(), self.map.attribute(), |point, attached, out| {
            let mut exact = [0.0; POINT];
            exact.copy_from_slice(&point[..POINT]);
            self.map.lift_with(exact, attached, out);
        })
    }

    fn prepare(&self, theta: &[f64], basis: &[f64], tangent: usize) -> PreparedMap {
        let size = ROWS * self.map.lift_len();
        let mut prepared = PreparedMap { tangent, ..PreparedMap::default() };
        if tangent == 0 {
            prepared.a = vec![0.0; size];
            prepared.b = vec![0.0; ROWS];
            self.map.affine(theta, &mut prepared.a, &mut prepared.b);
            return prepared;
        }
        prepared.da.reserve_exact(tangent * size);
        prepared.db.reserve_exact(tangent * ROWS);
        for first in (0..tangent).step_by(SEEDS) {
            let mut image = vec![DualSVec64::from(0.0); size + ROWS];
            let (a, b) = image.split_at_mut(size);
            self.map.affine(&seed_theta(theta, basis, tangent, first), a, b);
            if first == 0 {
                prepared.a = a.iter().map(|dual| dual.re).collect();
                prepared.b = b.iter().map(|dual| dual.re).collect();
            }
            for c in 0..SEEDS.min(tangent - first) {
                prepared.constant.push(a.iter().all(|value| derivative(value, c) == 0.0));
                prepared.da.extend(a.iter().map(|value| derivative(value, c)));
                prepared.db.extend(b.iter().map(|value| derivative(value, c)));
            }
        }
        prepared
    }

    fn block(
        &self,
        isa: Isa,
        prepared: &PreparedMap,
        transform: &Transform,
        points: &LiftedPoints,
        start: usize,
        out: &mut MapBlock,
    ) {
        out.set_weights(&points.weights[start..start + BLOCK]);
        isa.run(FactoredBlock { map: &self.map, prepared, transform, points, start, out });
    }

    fn hyper(&self, theta: &[HyperDual64], lifted: &[f64], out: &mut [HyperDual64]) -> HyperDual64 {
        let zero = HyperDual64::from(0.0);
        let (mut a, mut b) = (vec![zero; ROWS * lifted.len()], vec![zero; ROWS]);
        self.map.affine(theta, &mut a, &mut b);
        let mut y = [zero; ROWS];
        for r in 0..ROWS {
            y[r] = b[r];
            for (c, value) in lifted.iter().enumerate() {
                y[r] += a[r * lifted.len() + c] * *value;
            }
        }
        out[..DIM].copy_from_slice(&self.map.project(y));
        self.map.density(y).unwrap_or(zero + 1.0)
    }
}

/// The work on one block, compiled for each instruction set.
struct FactoredBlock<'a, M, const POINT: usize, const ROWS: usize, const DIM: usize> {
    map: &'a M,
    prepared: &'a PreparedMap,
    transform: &'a Transform,
    points: &'a LiftedPoints,
    start: usize,
    out: &'a mut MapBlock,
}

impl<M: Map<POINT, ROWS, DIM>, const POINT: usize, const ROWS: usize, const DIM: usize> WithSimd
    for FactoredBlock<'_, M, POINT, ROWS, DIM>
{
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        // A lift of the point's own length is the common case: its loops have constant bounds.
        let fixed = self.points.columns.len() == POINT;
        match (fixed, self.prepared.tangent > 0) {
            (true, true) => self.derivatives::<S, true>(simd),
            (false, true) => self.derivatives::<S, false>(simd),
            (true, false) => self.values::<S, true>(simd),
            (false, false) => self.values::<S, false>(simd),
        }
    }
}

/// Write sum_k a_k u_k + b for the vector at `at`.
#[inline(always)]
fn affine_row<S: Simd, const POINT: usize, const FIXED: bool>(
    simd: S,
    a: &[f64],
    b: f64,
    columns: &[Vec<f64>],
    fixed: &[Lane<S>; POINT],
    at: usize,
) -> Lane<S> {
    let mut sum = Lane::splat(simd, b);
    if FIXED {
        for k in 0..POINT {
            sum = Lane::splat(simd, a[k]).mul_add(fixed[k], sum);
        }
    } else {
        for (k, column) in columns.iter().enumerate() {
            sum = Lane::splat(simd, a[k]).mul_add(Lane::load(simd, &column[at..]), sum);
        }
    }
    sum
}

impl<M: Map<POINT, ROWS, DIM>, const POINT: usize, const ROWS: usize, const DIM: usize>
    FactoredBlock<'_, M, POINT, ROWS, DIM>
{
    #[inline(always)]
    fn load_point<S: Simd, const FIXED: bool>(&self, simd: S, at: usize) -> [Lane<S>; POINT] {
        let mut point = [Lane::splat(simd, 0.0); POINT];
        if FIXED {
            for k in 0..POINT {
                point[k] = Lane::load(simd, &self.points.columns[k][at..]);
            }
        }
        point
    }

    #[inline(always)]
    fn rows<S: Simd, const FIXED: bool>(
        &self,
        simd: S,
        a: &[f64],
        b: &[f64],
        point: &[Lane<S>; POINT],
        at: usize,
    ) -> [Lane<S>; ROWS] {
        let width = if FIXED { POINT } else { self.points.columns.len() };
        let mut y = [Lane::splat(simd, 0.0); ROWS];
        for r in 0..ROWS {
            let row = &a[r * width..(r + 1) * width];
            y[r] = affine_row::<S, POINT, FIXED>(simd, row, b[r], &self.points.columns, point, at);
        }
        y
    }

    #[inline(always)]
    fn values<S: Simd, const FIXED: bool>(self, simd: S) {
        for lane in (0..BLOCK).step_by(S::F64_LANES) {
            let at = self.start + lane;
            let point = self.load_point::<S, FIXED>(simd, at);
            let y = self.rows::<S, FIXED>(simd, &self.prepared.a, &self.prepared.b, &point, at);
            let x = normalise_values(self.transform, self.map.project(y));
            for q in 0..DIM {
                x[q].store(&mut self.out.x[q].0[lane..]);
            }
            if let Some(density) = self.map.density(y) {
                let weight = Lane::load(simd, &self.out.weight.0[lane..]) * density;
                weight.store(&mut self.out.weight.0[lane..]);
                self.out.unit_weight = false;
            }
        }
    }

    #[inline(always)]
    fn derivatives<S: Simd, const FIXED: bool>(self, simd: S) {
        let tangent = self.prepared.tangent;
        let width = ROWS * if FIXED { POINT } else { self.points.columns.len() };
        for lane in (0..BLOCK).step_by(S::F64_LANES) {
            let at = self.start + lane;
            let point = self.load_point::<S, FIXED>(simd, at);
            let y = self.rows::<S, FIXED>(simd, &self.prepared.a, &self.prepared.b, &point, at);
            let mut seeded = [Jet::<S, ROWS>::fixed(y[0]); ROWS];
            for r in 0..ROWS {
                seeded[r] = Jet::variable(y[r], r);
            }
            let projected = self.map.project(seeded);
            let density = self.map.density(seeded);
            let mut weight = Lane::load(simd, &self.out.weight.0[lane..]);
            if let Some(density) = density {
                self.out.moving_weight = true;
                self.out.unit_weight = false;
                let plain = weight;
                weight = plain * density.re;
                weight.store(&mut self.out.weight.0[lane..]);
                for j in 0..tangent {
                    let da = &self.prepared.da[j * width..(j + 1) * width];
                    let db = &self.prepared.db[j * ROWS..(j + 1) * ROWS];
                    let dy = self.rows::<S, FIXED>(simd, da, db, &point, at);
                    (contract(&density.eps, &dy) * plain).store(&mut self.out.dweight[j].0[lane..]);
                }
            }
            let mut x = [y[0]; DIM];
            for q in 0..DIM {
                x[q] = projected[q].re;
            }
            let x = normalise_values(self.transform, x);
            let mut slopes = normalise_slopes(self.transform, &projected);
            for q in 0..DIM {
                x[q].store(&mut self.out.x[q].0[lane..]);
                if !self.out.unit_weight {
                    for r in 0..ROWS {
                        slopes[q][r] = slopes[q][r] * weight;
                    }
                }
            }
            for j in 0..tangent {
                let db = &self.prepared.db[j * ROWS..(j + 1) * ROWS];
                let mut dy = y;
                if self.prepared.constant[j] {
                    for r in 0..ROWS {
                        dy[r] = Lane::splat(simd, db[r]);
                    }
                } else {
                    let da = &self.prepared.da[j * width..(j + 1) * width];
                    dy = self.rows::<S, FIXED>(simd, da, db, &point, at);
                }
                for q in 0..DIM {
                    let slope = contract(&slopes[q], &dy);
                    slope.store(&mut self.out.dx[q * tangent + j].0[lane..]);
                }
            }
        }
    }
}

/// Return sum_r a_r b_r.
#[inline(always)]
fn contract<S: Simd, const N: usize>(a: &[Lane<S>; N], b: &[Lane<S>; N]) -> Lane<S> {
    let mut sum = a[0] * b[0];
    for r in 1..N {
        sum = a[r].mul_add(b[r], sum);
    }
    sum
}

/// Apply x -> matrix (x - mean).
#[inline(always)]
pub(super) fn normalise_values<S: Simd, const DIM: usize>(transform: &Transform, x: [Lane<S>; DIM]) -> [Lane<S>; DIM] {
    let mut centred = x;
    for q in 0..DIM {
        centred[q] = x[q] - transform.mean[q];
    }
    let mut out = centred;
    for q in 0..DIM {
        out[q] = centred[q] * transform.matrix[q][q];
        if !transform.diagonal {
            for c in 0..DIM {
                if c != q {
                    out[q] = centred[c].mul_add(centred[c].constant(transform.matrix[q][c]), out[q]);
                }
            }
        }
    }
    out
}

/// Apply the matrix of the transform to the derivatives.
#[inline(always)]
pub(super) fn normalise_slopes<S: Simd, const DIM: usize, const N: usize>(
    transform: &Transform,
    x: &[Jet<S, N>; DIM],
) -> [[Lane<S>; N]; DIM] {
    let mut out = [x[0].eps; DIM];
    for q in 0..DIM {
        for r in 0..N {
            out[q][r] = x[q].eps[r] * transform.matrix[q][q];
            if !transform.diagonal {
                for c in 0..DIM {
                    if c != q {
                        let factor = out[q][r].constant(transform.matrix[q][c]);
                        out[q][r] = x[c].eps[r].mul_add(factor, out[q][r]);
                    }
                }
            }
        }
    }
    out
}
