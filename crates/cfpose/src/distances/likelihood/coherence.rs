//! Whether neighbouring target points miss the shape together: noise does not, a wrong shape or a wrong place does.

use rand::RngExt;
use rand_chacha::ChaCha12Rng;
use rand_distr::StandardNormal;

use super::kernels::Precision;
use super::{Mixture, NEGLIGIBLE, Nearby, Placed, PointsLikelihood};
use crate::distances::regions;
use crate::streams::stream;

/// Target points of a region, at least; a region is half as large to twice as large.
const REGION: usize = 24;
/// Regions, at most, as a power of 2.
const DEPTH: u32 = 7;

/// A target point, and how far it is from the shape along the normals.
struct Miss {
    point: [f64; 3],
    vector: [f64; 3],
}

impl PointsLikelihood<'_> {
    /// Return the share of the squared distances along normals that the means of small regions explain, beyond what the fitted mixture lets
    /// expect: about 0 for noise, however large, towards 1 where a fitted noise has swallowed a misfit. 0 where there are too few inliers
    /// for two regions, or no normals.
    ///
    /// What to expect is measured on as many points that are drawn from the mixture itself (a parametric bootstrap): beside a cusp, and where
    /// the noise reaches over the bends of the shape, neighbours miss its normals together although nothing is wrong.
    pub fn coherence(&self, placed: &Placed, mixture: &Mixture) -> f64 {
        let mut nearby = Nearby::new(placed);
        let (misses, drawn) = self.misses(&mut nearby, mixture, &self.target, &mut stream(0, "coherence"));
        let share = common(misses);
        if share <= 0.0 {
            return 0.0;
        }
        let (misses, _) = self.misses(&mut nearby, mixture, &drawn, &mut stream(0, "coherence of coherence"));
        let expected = common(misses);
        ((share - expected) / (1.0 - expected).max(f64::EPSILON)).clamp(0.0, 1.0)
    }

    /// Return the distances of the inliers of `points` along the normals of the kernels that explain them, weighted by their shares; and for
    /// each of them a draw from one of its kernels.
    fn misses(
        &self,
        nearby: &mut Nearby<'_>,
        mixture: &Mixture,
        points: &[[f64; 3]],
        rng: &mut ChaCha12Rng,
    ) -> (Vec<Miss>, Vec<[f64; 3]>) {
        let placed = nearby.placed;
        let kernels = self.kernels(placed, mixture);
        let (mut misses, mut drawn) = (Vec::with_capacity(points.len()), Vec::with_capacity(points.len()));
        self.explain_others(nearby, &kernels, points, |q, near, distances, explained| {
            if explained.inlier < 0.5 {
                return;
            }
            let mut vector = [0.0; 3];
            let mut left = explained.inlier * rng.random::<f64>();
            let mut from = near[0] as usize;
            for ((share, k), [on, _]) in explained.shares().zip(near).zip(distances) {
                let (k, frame) = (*k as usize, &placed.frames[*k as usize]);
                if left > 0.0 {
                    from = k;
                }
                left -= share;
                if share > NEGLIGIBLE && frame.along < 0.5 * frame.across {
                    let off = share / explained.inlier * (on - kernels.precisions[k].bend);
                    (0..3).for_each(|d| vector[d] += off * frame.axis[d]);
                }
            }
            misses.push(Miss { point: *q, vector });
            drawn.push(draw(placed, &kernels.precisions[from], from, rng));
        });
        (misses, drawn)
    }
}

/// Draw a point from the kernel of source point `k`: N(x + b a, S).
fn draw(placed: &Placed, precision: &Precision, k: usize, rng: &mut ChaCha12Rng) -> [f64; 3] {
    let (frame, dim) = (&placed.frames[k], placed.mapped.dim);
    let mut free = [0.0; 3];
    free[..dim].iter_mut().for_each(|v| *v = rng.sample(StandardNormal));
    let on = precision.project(&free);
    let (along, across) = (precision.along.recip().sqrt(), precision.across.recip().sqrt());
    let x = &placed.mapped.x[k];
    std::array::from_fn(|d| x[d] + across * free[d] + frame.axis[d] * (precision.bend + (along - across) * on))
}

/// Return the share of the squared misses that the means of small regions explain, corrected for their number.
fn common(mut misses: Vec<Miss>) -> f64 {
    let count = misses.len();
    let depth = (count / REGION).max(1).ilog2().min(DEPTH);
    let total: f64 = misses.iter().map(|miss| square(&miss.vector)).sum();
    if depth == 0 || total <= 0.0 {
        return 0.0;
    }
    let mut common = 0.0;
    regions(&mut misses, depth, &|miss: &Miss| miss.point, &mut |group| {
        let sum: [f64; 3] = std::array::from_fn(|d| group.iter().map(|miss| miss.vector[d]).sum());
        common += square(&sum) / group.len() as f64;
    });
    let chance = f64::from(1_u32 << depth) / count as f64;
    ((common / total - chance) / (1.0 - chance)).clamp(0.0, 1.0)
}

fn square(v: &[f64; 3]) -> f64 {
    v.iter().map(|x| x * x).sum()
}
