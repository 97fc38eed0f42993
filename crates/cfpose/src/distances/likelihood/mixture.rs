//! The unknowns beside theta: noise and clutter, and which kernel they are of.

use super::kernels::Precision;
use super::{Kernel, Mixture, NEGLIGIBLE, Placed, PointsLikelihood};

/// Clutter is between these shares.
const CLUTTER: [f64; 2] = [1e-3, 0.85];
/// Noise is between these shares of the target's size.
pub(super) const SIGMA: [f64; 2] = [2e-4, 0.25];
impl PointsLikelihood<'_> {
    /// Return the mixture of a kernel that is most likely at a placement, and its log likelihood: s over a grid, c by its fixed point,
    /// then both by theirs.
    pub fn best_mixture(&self, placed: &mut Placed, kernel: Kernel, grid: usize) -> (Mixture, f64) {
        let (mixture, _) = self.likely_mixture(placed, kernel, grid);
        self.reweigh(placed, &mixture);
        self.settled(placed, mixture, self.log_likelihood(placed, &mixture))
    }

    /// Return the mixture that is most likely at a placement, from one that is about as likely, and its log likelihood.
    pub fn mixture_from(&self, placed: &mut Placed, mixture: &Mixture) -> (Mixture, f64) {
        self.reweigh(placed, mixture);
        let (mixture, _) = self.settled(placed, *mixture, self.log_likelihood(placed, mixture));
        self.reweigh(placed, &mixture);
        self.settled(placed, mixture, self.log_likelihood(placed, &mixture))
    }

    /// Return the kernel that is more likely at theta. Where noise hides the spacing the two are nearly the same: copies have to be
    /// ahead by `nats`, because a shape knows less.
    pub fn likely_kernel(&self, theta: &[f64], nats: f64) -> Option<Kernel> {
        let value = |kernel| Some(self.best_mixture(&mut self.place(theta, false)?, kernel, 12).1);
        let ahead = value(Kernel::Copies)? - value(Kernel::Shape)?;
        Some(if ahead > nats { Kernel::Copies } else { Kernel::Shape })
    }

    fn likely_mixture(&self, placed: &Placed, kernel: Kernel, grid: usize) -> (Mixture, f64) {
        let bounds = self.noise.map(|share| share * self.size);
        let mut best: Option<(Mixture, f64)> = None;
        for k in 0..grid {
            if self.interrupt.is_raised() {
                break;
            }
            let sigma = bounds[0] * (bounds[1] / bounds[0]).powf(k as f64 / (grid - 1) as f64);
            let mut mixture = Mixture { kernel, sigma, clutter: 0.1 };
            let (_, inliers) = self.total(placed, &mixture);
            mixture.clutter = self.clutter(inliers);
            let (value, _) = self.total(placed, &mixture);
            if best.as_ref().is_none_or(|(_, most)| value > *most) {
                best = Some((mixture, value));
            }
        }
        let (mixture, value) = best.unwrap_or((Mixture { kernel, sigma: bounds[1], clutter: 0.5 }, f64::NEG_INFINITY));
        self.settled(placed, mixture, value)
    }

    /// Lead s and c to their fixed point, while that gains.
    fn settled(&self, placed: &Placed, mut mixture: Mixture, mut value: f64) -> (Mixture, f64) {
        for _ in 0..4 {
            let next = self.updated(self.variance(placed, &mixture), &mixture);
            let reached = self.log_likelihood(placed, &next);
            if reached <= value + 1e-3 {
                break;
            }
            (mixture, value) = (next, reached);
        }
        (mixture, value)
    }

    fn clutter(&self, inliers: f64) -> f64 {
        (1.0 - inliers / self.target.len() as f64).clamp(CLUTTER[0], CLUTTER[1])
    }

    /// Sum what a step of s^2 and c needs: weighted squares and weights of [`Precision::add_variance`], inliers.
    pub(super) fn variance(&self, placed: &Placed, mixture: &Mixture) -> ([f64; 2], f64) {
        let kernels = self.kernels(placed, mixture);
        let (mut shares, mut variance, mut inliers) = (vec![0.0; placed.each], [0.0; 2], 0.0);
        for j in 0..self.target.len() {
            inliers += kernels.responsibilities(placed, j, &mut shares).1;
            if placed.is_left_out(j) {
                continue;
            }
            for (at, (share, k)) in shares.iter().zip(placed.near_to(j)).enumerate() {
                if *share > NEGLIGIBLE {
                    let [on, off] = placed.distances[j * placed.each + at];
                    let precision = Precision::of(&placed.frames[*k as usize], mixture);
                    precision.add_variance(on, off, *share, placed.mapped.dim, &mut variance);
                }
            }
        }
        (variance, inliers)
    }

    /// One step of s^2 and c towards their most likely values.
    pub(super) fn updated(&self, (variance, inliers): ([f64; 2], f64), mixture: &Mixture) -> Mixture {
        let [least, most] = self.noise.map(|share| share * self.size);
        let [square, weight] = variance;
        let variance = if weight > 0.0 { square / weight } else { mixture.sigma * mixture.sigma };
        let sigma = variance.max(0.1 * mixture.sigma * mixture.sigma).sqrt().clamp(least, most);
        Mixture { kernel: mixture.kernel, sigma, clutter: self.clutter(inliers) }
    }
}
