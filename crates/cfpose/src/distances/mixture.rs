//! Maximum likelihood of a mixture: every target point is a noisy copy of some mapped source point, or a uniform outlier.

use super::Mover;
use crate::distances::neighbours::{Neighbour, Neighbours};
use crate::geometry::linalg::{add_outer, invert, solve_normal, symmetrise};

/// Options of a fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// Standard deviation of the noise to begin with, units of the feature space.
    pub sigma: f64,
    /// Share of outliers to begin with.
    pub share: f64,
    /// Largest share of outliers that is considered.
    pub max_share: f64,
    /// Source points near a target point that may explain it.
    pub neighbours: usize,
    /// Iterations during which sigma falls to a fifth by a schedule, before it is free; 0 for a start that is near.
    pub annealing: usize,
    /// Iterations after that at most.
    pub max_iterations: usize,
    /// Stop below this norm of a step.
    pub tolerance: f64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            sigma: 0.1,
            share: 0.1,
            max_share: 0.5,
            neighbours: 20,
            annealing: 8,
            max_iterations: 15,
            tolerance: 1e-5,
        }
    }
}

/// A fit of the mixture.
#[derive(Debug, Clone, PartialEq)]
pub struct MixtureFit {
    /// Theta, ambient (nuisance parameters as they came).
    pub theta: Vec<f64>,
    /// Standard deviation of the noise in one coordinate.
    pub sigma: f64,
    /// Share of outliers.
    pub share: f64,
    /// Mean log likelihood of a target point.
    pub log_likelihood: f64,
    /// Covariance of the model's tangent coordinates, row by row (outer product of the scores); sigma is marginalised.
    pub covariance: Vec<f64>,
    /// Iterations.
    pub iterations: usize,
}

/// The parameters that are moved together.
#[derive(Clone)]
struct Parameters {
    theta: Vec<f64>,
    sigma: f64,
    share: f64,
}

/// The likelihood at some parameters, with scores where wanted.
struct Likelihood {
    sum: f64,
    /// Sum of scores with respect to the tangent and log sigma.
    g: Vec<f64>,
    /// Sum of their outer products.
    h: Vec<f64>,
    /// Sum of the probabilities of being no outlier.
    inliers: f64,
}

struct Fit<'a, 'b> {
    mover: &'a Mover<'b>,
    target: &'a [[f64; 3]],
    options: &'a Options,
    /// Density of outliers: one over the volume of the target's bounding box, enlarged by a fifth.
    uniform: f64,
    /// Smallest sigma: below it the source is a set of points, not a shape.
    least_sigma: f64,
}

/// Fit from theta. `target` is in the feature space, not normalised.
pub(crate) fn fit(mover: &Mover<'_>, target: &[[f64; 3]], theta: &[f64], options: &Options) -> Option<MixtureFit> {
    let dim = mover.dim();
    let mut volume = 1.0;
    for d in 0..dim {
        let (low, high) =
            target.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), q| (low.min(q[d]), high.max(q[d])));
        volume *= 1.2 * (high - low);
    }
    if !(volume.is_finite() && volume > 0.0) {
        return None;
    }
    let least_sigma = 0.8 * super::spacing(&mover.map(theta, false));
    let this = Fit { mover, target, options, uniform: volume.recip(), least_sigma };
    this.run(Parameters { theta: theta.to_vec(), sigma: options.sigma.max(least_sigma), share: options.share })
}

impl Fit<'_, '_> {
    /// Ascend by the outer product of the scores (Berndt, Hall, Hall and Hausman 1974), the outlier share by its fixed point.
    fn run(&self, mut at: Parameters) -> Option<MixtureFit> {
        let tangent = self.mover.tangent();
        let n = tangent + 1;
        let mut iterations = 0;
        // While the pose is far off, a likelihood with free sigma and share would rather call everything an outlier: first
        // sigma falls by a schedule, and only theta follows.
        let annealing = self.options.annealing;
        let cooling = if annealing == 0 { 1.0 } else { (0.2_f64).powf(1.0 / annealing as f64) };
        let mut now = self.evaluate(&at, true);
        for iteration in 0..self.options.max_iterations + annealing {
            iterations = iteration + 1;
            let annealed = iteration < annealing;
            let mut step = solve_normal(n, &now.h, &now.g, 1e-3)?;
            step[tangent] = if annealed { 0.0 } else { step[tangent].clamp(-0.5, 0.5) };
            let norm = cfpose_optim::manifold::norm(&step[..tangent]);
            let shorten = if norm > 0.2 { 0.2 / norm } else { 1.0 };
            let mut length = 1.0;
            let mut accepted = None;
            for _ in 0..6 {
                let move_by: Vec<f64> = step[..tangent].iter().map(|s| s * shorten * length).collect();
                let candidate = Parameters {
                    theta: self.mover.retract(&at.theta, &move_by),
                    sigma: (at.sigma * (length * step[tangent]).exp()).max(self.least_sigma),
                    share: at.share,
                };
                let likelihood = self.evaluate(&candidate, false);
                if likelihood.sum > now.sum - 1e-9 {
                    accepted = Some(candidate);
                    break;
                }
                length *= 0.4;
            }
            let done = accepted.is_none()
                || norm * shorten * length < self.options.tolerance && (length * step[tangent]).abs() < 1e-3;
            at = accepted.unwrap_or(at);
            if annealed {
                at.sigma = (at.sigma * cooling).max(self.least_sigma);
            } else {
                now = self.evaluate(&at, true);
                at.share = (1.0 - now.inliers / self.target.len() as f64).clamp(1e-4, self.options.max_share);
            }
            now = self.evaluate(&at, true);
            if done && !annealed {
                break;
            }
        }
        let inverse = invert(n, &now.h)?;
        let covariance = (0..tangent * tangent).map(|i| inverse[i / tangent * n + i % tangent]).collect();
        let log_likelihood = now.sum / self.target.len() as f64;
        let Parameters { theta, sigma, share } = at;
        Some(MixtureFit { theta, sigma, share, log_likelihood, covariance, iterations })
    }

    fn evaluate(&self, at: &Parameters, scores: bool) -> Likelihood {
        let mapped = self.mover.map(&at.theta, scores);
        let (dim, tangent) = (mapped.dim, self.mover.tangent());
        let tree = Neighbours::new(mapped.x.clone(), dim);
        let n = tangent + 1;
        let mut sums = Likelihood { sum: 0.0, g: vec![0.0; n], h: vec![0.0; n * n], inliers: 0.0 };
        let precision = at.sigma.powi(-2);
        let peak = (1.0 - at.share) / mapped.x.len() as f64
            * (std::f64::consts::TAU * at.sigma * at.sigma).powf(-0.5 * dim as f64);
        let outlier = at.share * self.uniform;
        let mut score = vec![0.0; n];
        for q in self.target {
            let found = tree.nearest_n(q, self.options.neighbours);
            let density = |neighbour: &Neighbour| peak * (-0.5 * neighbour.squared * precision).exp();
            let total = outlier + found.iter().map(density).sum::<f64>();
            sums.sum += total.max(f64::MIN_POSITIVE).ln();
            if !scores {
                continue;
            }
            score.fill(0.0);
            for neighbour in &found {
                let share = density(neighbour) / total;
                if share < 1e-9 {
                    continue;
                }
                sums.inliers += share;
                score[tangent] += share * (neighbour.squared * precision - dim as f64);
                for d in 0..dim {
                    let pull = share * precision * (q[d] - mapped.x[neighbour.index][d]);
                    let slope = mapped.slope(neighbour.index, d);
                    score[..tangent].iter_mut().zip(slope).for_each(|(s, x)| *s += pull * x);
                }
            }
            add_outer(&mut sums.h, &score, 1.0);
            sums.g.iter_mut().zip(&score).for_each(|(g, s)| *g += s);
        }
        symmetrise(n, &mut sums.h);
        sums
    }
}
