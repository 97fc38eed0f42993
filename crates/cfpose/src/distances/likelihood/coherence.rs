//! Whether neighbouring target points miss the shape together: noise does not, a wrong shape or a wrong place does.

use super::kernels::Precision;
use super::{Mixture, NEGLIGIBLE, Placed, PointsLikelihood};
use crate::distances::regions;

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
    /// Return the share of the squared distances along normals that the means of small regions explain, beyond what chance lets expect: about
    /// 0 for noise, however large, towards 1 where a fitted noise has swallowed a misfit. 0 where there are too few inliers for two regions,
    /// or no normals.
    pub fn coherence(&self, placed: &Placed, mixture: &Mixture) -> f64 {
        let mut misses = self.misses(placed, mixture);
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

    /// Return the distances of the inliers along the normals of the kernels that explain them, weighted by their shares.
    fn misses(&self, placed: &Placed, mixture: &Mixture) -> Vec<Miss> {
        let kernels = self.kernels(placed, mixture);
        let mut shares = vec![0.0; placed.each];
        let mut misses = Vec::with_capacity(self.target.len());
        for (j, q) in self.target.iter().enumerate() {
            let (_, inlier) = kernels.responsibilities(placed, j, &mut shares);
            if inlier < 0.5 {
                continue;
            }
            let mut vector = [0.0; 3];
            for (at, (share, k)) in shares.iter().zip(placed.near_to(j)).enumerate() {
                let frame = &placed.frames[*k as usize];
                if *share > NEGLIGIBLE && frame.along < 0.5 * frame.across {
                    let bend = Precision::of(frame, mixture).bend;
                    let off = share / inlier * (placed.distances[j * placed.each + at][0] - bend);
                    (0..3).for_each(|d| vector[d] += off * frame.axis[d]);
                }
            }
            misses.push(Miss { point: *q, vector });
        }
        misses
    }
}

fn square(v: &[f64; 3]) -> f64 {
    v.iter().map(|x| x * x).sum()
}
