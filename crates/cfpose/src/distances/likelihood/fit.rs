//! Ascent of the likelihood: theta by damped Newton steps, noise and clutter by their own.

use super::kernels::Kernels;
use super::{Kernel, Mixture, Placed, PointsLikelihood, Sums, mixture};
use crate::geometry::linalg::solve_normal;

/// A theta at which the likelihood is largest nearby.
#[derive(Debug, Clone)]
pub(crate) struct Fit {
    /// Ambient, nuisance parameters as they came.
    pub theta: Vec<f64>,
    pub mixture: Mixture,
    pub log_likelihood: f64,
    pub iterations: usize,
    /// Whether the last step promised less than a hundredth of a nat.
    pub converged: bool,
}

/// First steps, after which the source points are weighed anew in any case.
const ALWAYS_REWEIGHED: usize = 3;
/// A fit that is so many nats behind after some steps is given up.
const FAR: f64 = 80.0;
/// Steps before that.
const GIVE_UP: usize = 5;
/// Noise up to this multiple of the least one is none.
const NOISE_FREE: f64 = 2.0;
/// A step that promises less than this is the last: where modes are compared, where one is returned.
const NATS: [f64; 2] = [1e-3, 1e-9];
/// Root mean square displacement of a step, in sizes of the target, at most.
const LONGEST: f64 = 0.2;

/// Where an ascent ends, and what it may not change.
#[derive(Clone, Copy)]
struct Ascent<'a> {
    max_iterations: usize,
    /// Given up far below this.
    least: f64,
    /// A step that promises less is the last.
    nats: f64,
    /// Linear form of the tangent that no step changes.
    held: Option<&'a [f64]>,
}

impl PointsLikelihood<'_> {
    /// Ascend from theta with the mixture that is most likely there, `None` where a map is not finite.
    ///
    /// Gives up where the likelihood stays far below `least` after a few steps.
    pub fn ascend(&self, theta: &[f64], kernel: Kernel, max_iterations: usize, least: f64) -> Option<Fit> {
        let mut placed = self.place(theta, true)?;
        let (mixture, _) = self.best_mixture(&mut placed, kernel, 7);
        self.ascend_with(theta, placed, mixture, &Ascent { max_iterations, least, nats: NATS[0], held: None })
    }

    /// Ascend with a linear form of the tangent held: the profile of the likelihood along a direction.
    pub fn ascend_beside(&self, theta: &[f64], kernel: Kernel, max_iterations: usize, held: &[f64]) -> Option<Fit> {
        let mut placed = self.place(theta, true)?;
        let (mixture, _) = self.best_mixture(&mut placed, kernel, 7);
        let ascent = Ascent { max_iterations, least: f64::NEG_INFINITY, nats: NATS[0], held: Some(held) };
        self.ascend_with(theta, placed, mixture, &ascent)
    }

    /// Ascend as [`PointsLikelihood::ascend`] until theta is known to far less than its deviation.
    pub fn ascend_fully(&self, theta: &[f64], kernel: Kernel, max_iterations: usize) -> Option<Fit> {
        let mut placed = self.place(theta, true)?;
        let (mixture, _) = self.best_mixture(&mut placed, kernel, 7);
        let ascent = Ascent { max_iterations, least: f64::NEG_INFINITY, nats: NATS[1], held: None };
        self.ascend_with(theta, placed, mixture, &ascent)
    }

    /// Ascend from a fit on other points of the same sets, whose noise and clutter are about right.
    pub fn ascend_from(&self, fit: &Fit, max_iterations: usize, least: f64) -> Option<Fit> {
        let mut placed = self.place(&fit.theta, true)?;
        let (mixture, _) = self.mixture_from(&mut placed, &fit.mixture);
        self.ascend_with(&fit.theta, placed, mixture, &Ascent { max_iterations, least, nats: NATS[0], held: None })
    }

    fn ascend_with(&self, theta: &[f64], mut placed: Placed, mut mixture: Mixture, ascent: &Ascent<'_>) -> Option<Fit> {
        let Ascent { max_iterations, least, nats, .. } = *ascent;
        let mut theta = theta.to_vec();
        let mut kernels = self.kernels(&placed, &mixture);
        let mut sums = self.sums(&placed, &kernels);
        let (mut damping, mut iterations, mut converged) = (0.1, 0, false);
        // Held frames turn with the last theta they were fitted at; an answer needs those of its own.
        let mut is_final = nats > NATS[1];
        let mut drift = 0.0;
        while iterations < max_iterations && !converged {
            if self.interrupt.is_raised() {
                return None;
            }
            iterations += 1;
            let Some((next, there, gain)) = self.step(&theta, &placed, &sums, &kernels, ascent, &mut damping) else {
                if is_final {
                    converged = true;
                    break;
                }
                is_final = true;
                self.refresh(&mut placed);
                kernels = self.kernels(&placed, &mixture);
                sums = self.sums(&placed, &kernels);
                continue;
            };
            // Frames and weights follow theta while it moves by much, noise and clutter always.
            let has_moved = !placed.same_neighbours(&there);
            (theta, placed) = (next, there);
            converged = gain < nats && is_final;
            let is_refreshed = has_moved || gain < nats;
            if is_refreshed {
                self.refresh(&mut placed);
            }
            is_final |= gain < nats;
            if has_moved || iterations <= ALWAYS_REWEIGHED {
                kernels = self.reweigh(&mut placed, &mixture);
            } else if is_refreshed {
                kernels = self.kernels(&placed, &mixture);
            }
            let before = mixture.sigma;
            mixture = self.updated(&self.survey(&placed, &kernels), &mixture);
            if nats <= NATS[1] {
                mixture.sigma *= ahead(&mut drift, (mixture.sigma / before).ln());
            }
            // An equal mode is far behind while its noise still shrinks, and where there is no noise, until the last step.
            let stands = mixture.sigma > 0.9 * before && mixture.sigma > NOISE_FREE * mixture::SIGMA[0] * self.size;
            if iterations >= GIVE_UP && stands && sums.log_likelihood + gain < least - FAR {
                return None;
            }
            kernels = self.kernels(&placed, &mixture);
            sums = self.sums(&placed, &kernels);
        }
        self.refresh(&mut placed);
        let (mixture, log_likelihood) = self.mixture_from(&mut placed, &mixture);
        Some(Fit { theta, mixture, log_likelihood, iterations, converged })
    }

    /// Make one step that ascends, with the kernels held: (observed + damping complete) step = gradient. Returns theta, the
    /// source there and the gain; `None` where no step ascends.
    fn step(
        &self,
        theta: &[f64],
        placed: &Placed,
        sums: &Sums,
        kernels: &Kernels,
        ascent: &Ascent<'_>,
        damping: &mut f64,
    ) -> Option<(Vec<f64>, Placed, f64)> {
        let n = sums.gradient.len();
        for _ in 0..8 {
            let matrix: Vec<f64> =
                sums.complete.iter().zip(&sums.lost).map(|(c, l)| c * (1.0 + *damping) - l).collect();
            let Some(mut step) = solve_held(n, &matrix, &sums.gradient, ascent.held) else {
                *damping = (*damping * 5.0).max(0.05);
                continue;
            };
            let promised: f64 = step.iter().zip(&sums.gradient).map(|(s, g)| s * g).sum();
            if promised < ascent.nats {
                return None;
            }
            let displaced = sums.nearest.iter().enumerate().filter(|(_, count)| **count > 0.0);
            let displaced: f64 = displaced.map(|(k, count)| count * placed.mapped.displacement(k, &step)).sum();
            let moved = (displaced / self.target.len() as f64).sqrt();
            let longest = LONGEST * self.size;
            if moved > longest {
                step.iter_mut().for_each(|s| *s *= longest / moved);
            }
            let next = self.mover.retract(theta, &step);
            if let Some(there) = self.replace(&next, placed) {
                let gain = self.log_likelihood(&there, kernels) - sums.log_likelihood;
                if gain > 0.0 {
                    *damping *= 0.2;
                    return Some((next, there, gain));
                }
            }
            *damping = (*damping * 6.0).max(0.05);
        }
        None
    }
}

/// Return the Newton step H^-1 g; with a linear form held, the one that does not change it: the multiplier of c's = 0 takes H^-1 c off.
fn solve_held(n: usize, matrix: &[f64], gradient: &[f64], held: Option<&[f64]>) -> Option<Vec<f64>> {
    let step = solve_normal(n, matrix, gradient, 1e-9)?;
    let Some(held) = held else { return Some(step) };
    let along = solve_normal(n, matrix, held, 1e-9)?;
    let dot = |v: &[f64]| -> f64 { held.iter().zip(v).map(|(c, v)| c * v).sum() };
    let multiplier = dot(&step) / dot(&along);
    Some(step.iter().zip(&along).map(|(s, a)| s - multiplier * a).collect())
}

/// Return the factor that leads a geometric sequence of steps of ln s to its limit (Steffensen), from two steps: the fixed point of s goes
/// four fifths of the way left at each.
fn ahead(last: &mut f64, step: f64) -> f64 {
    let ratio = step / *last;
    if (0.1..0.9).contains(&ratio) {
        *last = 0.0;
        return (step * ratio / (1.0 - ratio)).exp();
    }
    *last = step;
    1.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_held_does_not_change_in_any_unit() {
        // H d = g along d = (1, -1, 0) and z, with x + y held; then the same with y and z in a unit of a millionth.
        let (h, g, c) = ([6.0, 2.0, 0.0, 2.0, 4.0, 0.0, 0.0, 0.0, 1.0], [1.0, 2.0, 3.0], [1.0, 1.0, 0.0]);
        let step = solve_held(3, &h, &g, Some(&c)).unwrap();
        let expected = [-1.0 / 6.0, 1.0 / 6.0, 3.0];
        assert!(step.iter().zip(expected).all(|(s, e)| (s - e).abs() < 1e-7), "{step:?}");
        let unit = [1.0, 1e-6, 1e-6];
        let scaled: Vec<f64> = (0..9).map(|at| h[at] * unit[at / 3] * unit[at % 3]).collect();
        let of = |v: [f64; 3]| -> Vec<f64> { v.iter().zip(unit).map(|(v, u)| v * u).collect() };
        let small = solve_held(3, &scaled, &of(g), Some(&of(c))).unwrap();
        assert!((0..3).all(|i| (small[i] * unit[i] - expected[i]).abs() < 1e-7), "{small:?}");
    }

    #[test]
    fn two_steps_of_a_geometric_sequence_tell_its_limit() {
        // ln s goes from 0 towards 1, a fifth of the way left at each step.
        let (mut s, mut last) = (0.0_f64, 0.0);
        for _ in 0..2 {
            let step = 0.2 * (1.0 - s);
            s += step;
            s += ahead(&mut last, step).ln();
        }
        assert!((s - 1.0).abs() < 1e-12, "{s}");
        // A sequence that turns back is left alone.
        let mut last = 0.1;
        assert_eq!(ahead(&mut last, -0.05), 1.0);
    }
}
