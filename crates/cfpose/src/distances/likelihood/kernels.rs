//! The kernels on the source points: their precisions, and who is responsible for a target point.

use super::shape::Frame;
use super::{Kernel, Mixture, Placed, PointsLikelihood};
use crate::distances::Mapped;
use crate::geometry::linalg::add_outer;

impl PointsLikelihood<'_> {
    /// Return the kernels of all source points.
    pub(super) fn kernels(&self, placed: &Placed, mixture: &Mixture) -> Kernels {
        let dim = placed.mapped.dim as f64;
        let log_inlier = (1.0 - mixture.clutter).ln() - 0.5 * dim * std::f64::consts::TAU.ln();
        let each = placed.frames.iter().zip(&placed.log_weights).map(|(frame, log_weight)| {
            let precision = Precision::of(frame, mixture);
            let peak = log_inlier + log_weight - 0.5 * precision.log_determinant(dim);
            [peak, -0.5 * precision.along, -0.5 * precision.across, precision.bend]
        });
        Kernels { each: each.collect(), log_clutter: mixture.clutter.ln() + self.log_uniform }
    }
}

/// The kernels of all source points at one mixture: ln of the peak, and what multiplies the squares along and across the axis, and where its
/// middle lies on it.
pub(super) struct Kernels {
    each: Vec<[f64; 4]>,
    log_clutter: f64,
}

impl Kernels {
    /// Fill `shares` with the probabilities that target point `j` comes from each source point near it; return ln p(q) and their sum.
    pub fn responsibilities(&self, placed: &Placed, j: usize, shares: &mut [f64]) -> (f64, f64) {
        self.shares(placed.near_to(j), &placed.distances[j * placed.each..(j + 1) * placed.each], shares)
    }

    /// Do the same for a target point whose nearest source points and distances from them ([`Placed::distances`]) are given.
    pub fn shares(&self, near: &[u32], distances: &[[f64; 2]], shares: &mut [f64]) -> (f64, f64) {
        let mut largest = self.log_clutter;
        for ((share, k), [on, off]) in shares.iter_mut().zip(near).zip(distances) {
            let [peak, along, across, bend] = self.each[*k as usize];
            *share = peak + along * (on - bend) * (on - bend) + across * off;
            largest = largest.max(*share);
        }
        let mut inlier = 0.0;
        for share in shares.iter_mut() {
            let below = *share - largest;
            *share = if below > -30.0 { below.exp() } else { 0.0 };
            inlier += *share;
        }
        let total = inlier + (self.log_clutter - largest).exp();
        shares.iter_mut().for_each(|share| *share /= total);
        (largest + total.ln(), inlier / total)
    }
}

/// Deviations of the noise from which on the bend of a kernel is held back.
const HELD: f64 = 1.8;

/// Return how far the middle of a kernel is moved for the shape to be unbiased beside noise of deviation `sigma`.
///
/// Seen from the surface, tangent kernels around a place lie outside of it by kappa t^2 E, E exponential with mean 1. Where the noise is wide,
/// their mean counts; where it is narrow, the many that lie within kappa t^2 count more than the few far outside. The shift at which the
/// expected log likelihood has its maximum on the surface, found by quadrature, is 1, .84, .64, .52, .38, .28 of kappa t^2 at kappa t^2 / s =
/// 0, 1, 2, 3, 5, 8; this is within .05 of it.
fn bend_beside(bend: f64, sigma: f64) -> f64 {
    let ratio = bend / (HELD * sigma);
    bend / (1.0 + ratio * ratio).sqrt()
}

/// The inverse of S = s^2 I + across (I - a a') + along a a', and the middle of the kernel on the axis a.
pub(super) struct Precision {
    axis: [f64; 3],
    /// Inverse variances along the axis and across it.
    pub along: f64,
    pub across: f64,
    pub bend: f64,
    noise: f64,
}

impl Precision {
    pub fn of(frame: &Frame, mixture: &Mixture) -> Self {
        let noise = mixture.sigma * mixture.sigma;
        let (along, across, bend) = match mixture.kernel {
            Kernel::Copies => (0.0, 0.0, 0.0),
            Kernel::Shape => (frame.along, frame.across, bend_beside(frame.bend, mixture.sigma)),
        };
        Self { axis: frame.axis, along: (noise + along).recip(), across: (noise + across).recip(), bend, noise }
    }

    pub fn project(&self, v: &[f64]) -> f64 {
        self.axis.iter().zip(v).map(|(a, v)| a * v).sum()
    }

    /// ln det S in `dim` dimensions.
    pub fn log_determinant(&self, dim: f64) -> f64 {
        -(self.along.ln() + (dim - 1.0) * self.across.ln())
    }

    /// S^-1 (v - bend a), v from the source point to a target point.
    pub fn apply(&self, v: &[f64; 3]) -> [f64; 3] {
        let on = self.project(v);
        let on = self.along * (on - self.bend) - self.across * on;
        std::array::from_fn(|d| self.across * v[d] + on * self.axis[d])
    }

    /// Add share G' S^-1 G of a point to the lower triangle.
    pub fn add_information(&self, mapped: &Mapped, k: usize, share: f64, matrix: &mut [f64]) {
        let mut on_axis = vec![0.0; mapped.tangent];
        for d in 0..mapped.dim {
            let slope = mapped.slope(k, d);
            add_outer(matrix, slope, share * self.across);
            on_axis.iter_mut().zip(slope).for_each(|(sum, g)| *sum += self.axis[d] * g);
        }
        add_outer(matrix, &on_axis, share * (self.along - self.across));
    }

    /// Fisher scoring for s^2: each direction tells by its squared precision how far its square exceeds its tangential width.
    /// `on` is a distance along the axis, `off` a squared one across it.
    pub fn add_variance(&self, on: f64, off: f64, share: f64, dim: usize, sums: &mut [f64; 2]) {
        let on = (on - self.bend) * (on - self.bend);
        let (along, across) = (share * self.along * self.along, share * self.across * self.across);
        let others = dim as f64 - 1.0;
        let tangential = |precision: f64| precision.recip() - self.noise;
        sums[0] += along * (on - tangential(self.along)) + across * (off - others * tangential(self.across));
        sums[1] += along + others * across;
    }
}
