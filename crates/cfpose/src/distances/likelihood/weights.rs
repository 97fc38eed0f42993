//! Which source points take part, and how much: the responsibilities asked from the other side.

use super::kernels::Kernels;
use super::{Mixture, Placed, PointsLikelihood};

/// A neighbourhood of the source may hold so many times the target points of an even share, and so many deviations more.
const CAPACITY: [f64; 2] = [2.0, 3.0];
/// A neighbourhood with less than this share of its even share is not seen.
const SEEN: f64 = 0.25;
/// Share of the source that may be called hidden; where the noise is held below a bound, which no blob of clutter looks like.
pub(super) const MOST_HIDDEN: [f64; 2] = [0.5, 0.7];
/// What a hidden part costs: to say where it is, in nats.
const HIDDEN_NATS: f64 = 10.0;
/// Less than this share is not worth saying.
const LEAST_HIDDEN: f64 = 0.03;

impl PointsLikelihood<'_> {
    /// Weigh the source points of a placement anew: a part that no target point wants is hidden and its weight goes to the rest;
    /// a part that too many want (a blob that happens to lie on the shape) gets less.
    ///
    /// Returns the kernels with these weights.
    pub fn reweigh(&self, placed: &mut Placed, mixture: &Mixture) -> Kernels {
        placed.log_weights.clone_from(&self.log_weights);
        placed.cost = 0.0;
        placed.left_out.clear();
        let mut kernels = self.kernels(placed, mixture);
        let (mass, inliers) = self.masses(placed, &kernels);
        let weights: Vec<f64> = self.log_weights.iter().map(|log| log.exp()).collect();
        let hidden = self.shape.below(&mass, &weights, inliers, SEEN);
        let share: f64 = hidden.iter().zip(&weights).filter(|(hidden, _)| **hidden).map(|(_, w)| w).sum();
        let has_hidden = share > LEAST_HIDDEN && share < self.most_hidden;
        if has_hidden {
            let rest = -(1.0 - share).ln();
            placed.cost = HIDDEN_NATS;
            for (log, hidden) in placed.log_weights.iter_mut().zip(&hidden) {
                *log += if *hidden { -3.0 } else { rest };
            }
        }
        for _ in 0..2 {
            kernels.weigh(&placed.log_weights);
            let (mass, inliers) = self.masses(placed, &kernels);
            let even = inliers / if has_hidden { 1.0 - share } else { 1.0 };
            self.shape.prices(&mass, &weights, even, CAPACITY, &mut placed.log_weights);
        }
        kernels.weigh(&placed.log_weights);
        self.leave_out(placed, &kernels, if has_hidden { share } else { 0.0 });
        kernels
    }

    /// Return how much of the target each source point explains, and the sum.
    fn masses(&self, placed: &Placed, kernels: &Kernels) -> (Vec<f64>, f64) {
        let mut mass = vec![0.0; placed.mapped.x.len()];
        self.explain(placed, kernels, |j, explained| {
            explained.shares().zip(placed.near_to(j)).for_each(|(share, k)| mass[*k as usize] += share);
        });
        let inliers = mass.iter().sum();
        (mass, inliers)
    }

    /// Return the share of the source that the target does not explain: around it there are fewer than a quarter of the target
    /// points of an even share.
    pub fn unseen(&self, placed: &Placed, mixture: &Mixture) -> f64 {
        let (mass, inliers) = self.masses(placed, &self.kernels(placed, mixture));
        let weights: Vec<f64> = self.log_weights.iter().map(|log| log.exp()).collect();
        let below = self.shape.below(&mass, &weights, inliers, SEEN);
        below.iter().zip(&weights).filter(|(below, _)| **below).map(|(_, w)| w).sum()
    }
}
