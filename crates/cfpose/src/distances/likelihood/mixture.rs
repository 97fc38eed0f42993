//! The unknowns beside theta: noise and clutter, and which kernel they are of.

use super::kernels::Kernels;
use super::{Kernel, Mixture, Placed, PointsLikelihood};

/// Clutter is between these shares.
const CLUTTER: [f64; 2] = [1e-3, 0.85];
/// Noise is between these shares of the target's size.
pub(super) const SIGMA: [f64; 2] = [2e-4, 0.25];

/// Sums over the target at one theta and mixture.
pub(super) struct Survey {
    pub log_likelihood: f64,
    /// s^2 is the quotient ([`Precision::variance`](super::kernels::Precision::variance)).
    variance: [f64; 2],
    /// Sum of the probabilities of being no clutter.
    inliers: f64,
}

impl PointsLikelihood<'_> {
    /// Return the mixture of a kernel that is most likely at a placement, and its log likelihood: s over a grid, c by its fixed point,
    /// then both by theirs.
    pub fn best_mixture(&self, placed: &mut Placed, kernel: Kernel, grid: usize) -> (Mixture, f64) {
        let (mixture, _) = self.likely_mixture(placed, kernel, grid);
        let kernels = self.reweigh(placed, &mixture);
        self.settled(placed, kernels)
    }

    /// Return the mixture that is most likely at a placement, from one that is about as likely, and its log likelihood.
    pub fn mixture_from(&self, placed: &mut Placed, mixture: &Mixture) -> (Mixture, f64) {
        let kernels = self.reweigh(placed, mixture);
        let (mixture, _) = self.settled(placed, kernels);
        let kernels = self.reweigh(placed, &mixture);
        self.settled(placed, kernels)
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
            let (mixture, value) = self.with_its_clutter(placed, &Mixture { kernel, sigma, clutter: 0.1 });
            if best.as_ref().is_none_or(|(_, most)| value > *most) {
                best = Some((mixture, value));
            }
        }
        let mixture = best.map_or(Mixture { kernel, sigma: bounds[1], clutter: 0.5 }, |(mixture, _)| mixture);
        self.settled(placed, self.kernels(placed, &mixture))
    }

    /// Take one step of c alone; return the mixture and its log likelihood.
    fn with_its_clutter(&self, placed: &Placed, mixture: &Mixture) -> (Mixture, f64) {
        let each = self.explained(placed, &self.kernels(placed, mixture));
        let next = Mixture { clutter: self.clutter(each.iter().map(|[_, inlier]| inlier).sum()), ..*mixture };
        // p = inlying + outlying, each in proportion to its share of all points.
        let inlying = (1.0 - next.clutter) / (1.0 - mixture.clutter);
        let outlying = next.clutter / mixture.clutter;
        let taking_part = each.iter().enumerate().filter(|(j, _)| !placed.is_left_out(*j));
        let log = |(_, [log, inlier]): (usize, &[f64; 2])| log + (inlier * inlying + (1.0 - inlier) * outlying).ln();
        (next, taking_part.map(log).sum::<f64>() - placed.cost)
    }

    /// Lead s and c to their fixed point, while that gains.
    fn settled(&self, placed: &Placed, kernels: Kernels) -> (Mixture, f64) {
        let (mut mixture, mut survey) = (kernels.mixture, self.survey(placed, &kernels));
        for _ in 0..4 {
            let next = self.updated(&survey, &mixture);
            let there = self.survey(placed, &self.kernels(placed, &next));
            if there.log_likelihood <= survey.log_likelihood + 1e-3 {
                break;
            }
            (mixture, survey) = (next, there);
        }
        (mixture, survey.log_likelihood)
    }

    fn clutter(&self, inliers: f64) -> f64 {
        (1.0 - inliers / self.target.len() as f64).clamp(CLUTTER[0], CLUTTER[1])
    }

    /// Sum over the target what a step of s^2 and c needs.
    pub(super) fn survey(&self, placed: &Placed, kernels: &Kernels) -> Survey {
        let (mut log_likelihood, mut inliers) = (-placed.cost, 0.0);
        let mut squares = vec![[0.0; 3]; placed.mapped.x.len()];
        self.explain(placed, kernels, |j, explained| {
            inliers += explained.inlier;
            if placed.is_left_out(j) {
                return;
            }
            log_likelihood += explained.log;
            for ((share, k), [on, off]) in explained.shares().zip(placed.near_to(j)).zip(placed.distances_to(j)) {
                let (bend, sums) = (kernels.precisions[*k as usize].bend, &mut squares[*k as usize]);
                sums[0] += share * (on - bend) * (on - bend);
                sums[1] += share * off;
                sums[2] += share;
            }
        });
        let mut variance = [0.0; 2];
        for (precision, sums) in kernels.precisions.iter().zip(squares) {
            let [square, weight] = precision.variance(sums, placed.mapped.dim);
            variance[0] += square;
            variance[1] += weight;
        }
        Survey { log_likelihood, variance, inliers }
    }

    /// One step of s^2 and c towards their most likely values.
    pub(super) fn updated(&self, survey: &Survey, mixture: &Mixture) -> Mixture {
        let [least, most] = self.noise.map(|share| share * self.size);
        let [square, weight] = survey.variance;
        let variance = if weight > 0.0 { square / weight } else { mixture.sigma * mixture.sigma };
        let sigma = variance.max(0.1 * mixture.sigma * mixture.sigma).sqrt().clamp(least, most);
        Mixture { kernel: mixture.kernel, sigma, clutter: self.clutter(survey.inliers) }
    }
}
