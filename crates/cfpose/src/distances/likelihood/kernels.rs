//! The kernels on the source points: their precisions, and the parts of ln p that do not depend on the target.

use super::shape::Frame;
use super::{Kernel, Mixture, Placed, PointsLikelihood};
use crate::distances::Mapped;
use crate::geometry::linalg::add_outer;

impl PointsLikelihood<'_> {
    /// Return the kernels of all source points.
    pub(super) fn kernels(&self, placed: &Placed, mixture: &Mixture) -> Kernels {
        let dim = placed.mapped.dim;
        let log_inlier = (1.0 - mixture.clutter).ln() - 0.5 * dim as f64 * std::f64::consts::TAU.ln();
        let precisions: Vec<Precision> = placed.frames.iter().map(|frame| Precision::of(frame, mixture)).collect();
        let peaks = precisions.iter().map(|precision| log_inlier + precision.root(dim).ln()).collect();
        let part = |precision: &Precision| [0.0, -0.5 * precision.along, -0.5 * precision.across, precision.bend];
        let parts = precisions.iter().map(part).collect();
        let log_clutter = mixture.clutter.ln() + self.log_uniform;
        let mut kernels = Kernels { mixture: *mixture, parts, peaks, precisions, log_clutter };
        kernels.weigh(&placed.log_weights);
        kernels
    }
}

/// The kernels of all source points at one mixture.
pub(crate) struct Kernels {
    pub(super) mixture: Mixture,
    /// ln of the peak, what multiplies the squares along and across the axis, where the middle lies on it.
    parts: Vec<[f64; 4]>,
    /// ln of the peaks without the weights of the source points.
    peaks: Vec<f64>,
    /// Of every source point.
    pub(super) precisions: Vec<Precision>,
    /// ln of the part of clutter.
    pub(super) log_clutter: f64,
}

impl Kernels {
    /// Give the source points other weights.
    pub(super) fn weigh(&mut self, log_weights: &[f64]) {
        for ((part, peak), log_weight) in self.parts.iter_mut().zip(&self.peaks).zip(log_weights) {
            part[0] = peak + log_weight;
        }
    }

    /// Return ln((1 - c) w N(q; x + b, S)) of source point `k` at the distances of a point from it ([`Placed::distance`]).
    #[inline(always)]
    pub(super) fn log_part(&self, k: usize, [on, off]: [f64; 2]) -> f64 {
        let [peak, along, across, bend] = self.parts[k];
        peak + along * (on - bend) * (on - bend) + across * off
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

    /// Root of det S^-1 in `dim` dimensions.
    fn root(&self, dim: usize) -> f64 {
        let across = self.across.sqrt();
        (1..dim).fold(self.along.sqrt(), |product, _| product * across)
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
    /// Takes the weighted sums of squares along the axis and across it, and that of the weights; returns numerator and denominator of s^2.
    pub fn variance(&self, [on, off, share]: [f64; 3], dim: usize) -> [f64; 2] {
        let (along, across) = (self.along * self.along, self.across * self.across);
        let others = dim as f64 - 1.0;
        let tangential = |precision: f64| precision.recip() - self.noise;
        let square =
            along * (on - share * tangential(self.along)) + across * (off - share * others * tangential(self.across));
        [square, share * (along + others * across)]
    }
}
