//! What is known of theta beforehand: a theta and a covariance, joined with what the data say (docs/method.md, *Freedom, bounds,
//! priors*).
//!
//! The data give theta with its covariance C_d, the prior theta_0 with C_0. Where both may be true, the answer minimises
//!
//! (theta - theta_d)' C_d^-1 (theta - theta_d) + (theta - theta_0)' C_0^-1 (theta - theta_0),
//!
//! whose least value is chi-square with as many degrees of freedom as both determine: a large one says that they disagree.
//! The prior also tells modes apart, and a direction that the data leave open is as sure as the prior makes it.

use cfpose_optim::manifold::Manifold;
use serde::{Deserialize, Serialize};

use super::Parts;
use super::candidate::Candidate;
use super::search::Search;
use crate::entry::BuildError;
use crate::geometry::linalg::{add_outer, congruent, invert, solve_normal, symmetric_eigen_any, symmetrise};
use crate::geometry::theta::Layout;
use crate::statistics::chi_square_tail;

/// What is known of theta beforehand, as a normal law.
///
/// ```
/// use cfpose::{Prior, theta::Layout};
/// let pose = Layout::pose3();
/// // A turn known to .05 rad, a position known to .1.
/// let variances = [0.05_f64.powi(2), 0.1_f64.powi(2)];
/// let covariance = (0..36).map(|at| if at % 7 == 0 { variances[at / 21] } else { 0.0 }).collect();
/// let prior = Prior { theta: pose.neutral(), covariance };
/// assert!(prior.check(&pose).is_ok());
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Prior {
    /// Most likely theta, ambient.
    pub theta: Vec<f64>,
    /// Covariance of the tangent step from there (all columns of the model, free or not; tangent x tangent, row by row).
    pub covariance: Vec<f64>,
}

/// What became of a prior.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct PriorReport {
    /// Squared distance between what the data and the prior say, in units of both covariances.
    pub chi_square: f64,
    /// Its degrees of freedom.
    pub degrees_of_freedom: usize,
    /// Probability of a larger one where both are true.
    pub p_value: f64,
    /// Whether the prior is in the answer: one that disagrees is left out.
    pub used: bool,
}

/// Nats that a prior may hold against a mode: it may be wrong, and strong data overrule it.
const MOST_NATS: f64 = 15.0;
/// Eigenvalues of the correlations below this are rounding.
const LEAST_EIGENVALUE: f64 = 1e-12;
/// Gauss-Newton steps of the joined answer; the law is normal, so the second is a correction.
const STEPS: usize = 10;

impl Prior {
    /// Look at the sizes, and that the covariance is positive definite.
    ///
    /// # Errors
    /// [`BuildError::Data`] with what is wrong.
    pub fn check(&self, layout: &Layout) -> Result<(), BuildError> {
        self.information(layout).map(|_| ())
    }

    /// Return the inverse covariance.
    fn information(&self, layout: &Layout) -> Result<Vec<f64>, BuildError> {
        let (ambient, n) = (layout.manifold().ambient(), layout.manifold().tangent());
        let refuse = |problem: String| Err(BuildError::Data { name: "prior".to_string(), problem });
        if self.theta.len() != ambient || !self.theta.iter().all(|v| v.is_finite()) {
            return refuse(format!("theta has {} numbers, this model's ambient theta {ambient}", self.theta.len()));
        }
        if self.covariance.len() != n * n {
            return refuse(format!("the covariance has {} numbers, {n} x {n} are needed", self.covariance.len()));
        }
        let c = |i: usize, j: usize| self.covariance[i * n + j];
        let lopsided = |i: usize, j: usize| (c(i, j) - c(j, i)).abs() > 1e-9 * (c(i, i) * c(j, j)).sqrt();
        if let Some(i) = (0..n).find(|i| !(c(*i, *i) > 0.0 && c(*i, *i).is_finite())) {
            return refuse(format!("variance {} of the covariance is {}: it has to be above 0", i + 1, c(i, i)));
        }
        if (0..n).any(|i| (0..i).any(|j| !c(i, j).is_finite() || lopsided(i, j))) {
            return refuse("the covariance is not symmetric".to_string());
        }
        // In units of the deviations: angles and lengths differ by orders of magnitude.
        let deviations: Vec<f64> = (0..n).map(|i| c(i, i).sqrt()).collect();
        let correlation: Vec<f64> =
            (0..n * n).map(|at| c(at / n, at % n) / (deviations[at / n] * deviations[at % n])).collect();
        let (values, _) = symmetric_eigen_any(n, |i, j| correlation[i * n + j]);
        let is_definite = values.last().is_some_and(|least| *least > LEAST_EIGENVALUE);
        match invert(n, &correlation).filter(|_| is_definite) {
            Some(inverse) => Ok((0..n * n).map(|at| inverse[at] / (deviations[at / n] * deviations[at % n])).collect()),
            None => refuse("the covariance is not positive definite".to_string()),
        }
    }
}

/// A prior whose covariance is inverted.
pub(super) struct ReadyPrior {
    theta: Vec<f64>,
    information: Vec<f64>,
    layout: Layout,
}

/// What data and prior say together.
struct Joined {
    theta: Vec<f64>,
    covariance: Vec<f64>,
    /// Share of the prior in the least value.
    prior_square: f64,
    chi_square: f64,
}

impl ReadyPrior {
    pub fn new(prior: &Prior, layout: &Layout) -> Result<Self, BuildError> {
        let mut theta = prior.theta.clone();
        let information = prior.information(layout)?;
        layout.manifold().project(&mut theta);
        Ok(Self { theta, information, layout: layout.clone() })
    }

    pub fn theta(&self) -> &[f64] {
        &self.theta
    }

    /// Return the step from the prior's theta.
    fn error(&self, theta: &[f64]) -> Vec<f64> {
        let manifold = self.layout.manifold();
        let mut step = vec![0.0; manifold.tangent()];
        manifold.local(&self.theta, &theta[..self.theta.len()], &mut step);
        step
    }

    /// Return ln of the prior density relative to its largest value, bounded below.
    pub fn log_density(&self, theta: &[f64]) -> f64 {
        let error = self.error(theta);
        let n = error.len();
        let square = (0..n).map(|i| error[i] * (0..n).map(|j| self.information[i * n + j] * error[j]).sum::<f64>());
        // A mixture with a law of its own for priors that are wrong.
        let log_wrong = -MOST_NATS;
        let log_right = -0.5 * square.sum::<f64>();
        let most = log_right.max(log_wrong);
        most + ((log_right - most).exp() + (log_wrong - most).exp()).ln() - log_wrong.exp().ln_1p()
    }

    /// Join a theta of the data, its information in units of `scales` along the tangent of `manifold`, with the prior.
    fn join(&self, manifold: &dyn Manifold, theta: &[f64], information: &[f64], scales: &[f64]) -> Option<Joined> {
        let m = scales.len();
        let reach = |step: &[f64]| {
            let step: Vec<f64> = step.iter().zip(scales).map(|(s, scale)| s * scale).collect();
            let mut out = theta.to_vec();
            manifold.retract(theta, &step, &mut out);
            out
        };
        let mut step = vec![0.0; m];
        let mut normal = information.to_vec();
        for _ in 0..STEPS {
            let error = self.error(&reach(&step));
            let n = error.len();
            // Columns of the derivative of the error by central differences: any manifold, any parametrisation.
            let columns: Vec<Vec<f64>> = (0..m)
                .map(|j| {
                    let at = |h: f64| {
                        let mut moved = step.clone();
                        moved[j] += h;
                        self.error(&reach(&moved))
                    };
                    let (plus, minus) = (at(1e-5), at(-1e-5));
                    plus.iter().zip(&minus).map(|(a, b)| (a - b) / 2e-5).collect()
                })
                .collect();
            let weighted = |column: &[f64]| -> Vec<f64> {
                (0..n).map(|i| (0..n).map(|k| self.information[i * n + k] * column[k]).sum()).collect()
            };
            let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
            normal.copy_from_slice(information);
            let mut gradient = vec![0.0; m];
            let pull = weighted(&error);
            for i in 0..m {
                let column = weighted(&columns[i]);
                (0..m).for_each(|j| normal[i * m + j] += dot(&column, &columns[j]));
                let of_data: f64 = (0..m).map(|j| information[i * m + j] * step[j]).sum();
                gradient[i] = -(of_data + dot(&columns[i], &pull));
            }
            let change = solve_normal(m, &normal, &gradient, 0.0)?;
            step.iter_mut().zip(&change).for_each(|(s, c)| *s += c);
            if change.iter().all(|c| c.abs() < 1e-12) {
                break;
            }
        }
        let theta = reach(&step);
        let error = self.error(&theta);
        let n = error.len();
        let prior_square: f64 =
            (0..n).map(|i| error[i] * (0..n).map(|j| self.information[i * n + j] * error[j]).sum::<f64>()).sum();
        let data_square: f64 =
            (0..m).map(|i| step[i] * (0..m).map(|j| information[i * m + j] * step[j]).sum::<f64>()).sum();
        let inverse = invert(m, &normal)?;
        let covariance = (0..m * m).map(|at| inverse[at] * scales[at / m] * scales[at % m]).collect();
        Some(Joined { theta, covariance, prior_square, chi_square: prior_square + data_square })
    }
}

impl Search<'_> {
    /// Join the prior, where there is one, with a candidate: theta, covariance, J, what is undetermined.
    pub fn join_prior(&self, candidate: &mut Candidate) {
        let (Some(prior), Some(statistics)) = (&self.parts.prior, &candidate.statistics) else { return };
        let scales = self.scales(&candidate.theta);
        let m = scales.len();
        let own = self.last().own();
        let Some(information) = information(&statistics.covariance, &scales, candidate) else { return };
        let manifold = own_manifold(self.parts, self.last().model().layout.manifold());
        let Some(joined) = prior.join(manifold, &candidate.theta[..own], &information, &scales) else { return };
        let known = m - candidate.undetermined.len().min(m);
        let total = prior.error(&candidate.theta).len();
        let dof = (total + known).saturating_sub(m);
        let p_value = chi_square_tail(joined.chi_square, dof);
        let used = p_value > self.parts.criteria.p_suspect;
        candidate.prior = Some(PriorReport { chi_square: joined.chi_square, degrees_of_freedom: dof, p_value, used });
        if !used {
            return;
        }
        candidate.move_to(&joined.theta);
        if let Some(statistics) = &mut candidate.statistics {
            statistics.covariance.clone_from(&joined.covariance);
            statistics.j_statistic += joined.prior_square;
            statistics.degrees_of_freedom += total;
            statistics.p_value = chi_square_tail(statistics.j_statistic, statistics.degrees_of_freedom);
        }
        // What the prior determines well enough is determined.
        let deviation = self.deviation(&candidate.theta, &joined.covariance);
        if deviation < self.parts.criteria.deviation {
            candidate.undetermined.clear();
        }
    }
}

/// Return the manifold that tangent steps of theta without nuisance parameters belong to.
fn own_manifold<'a>(parts: &'a Parts, layout: &'a dyn Manifold) -> &'a dyn Manifold {
    parts.manifold.as_deref().unwrap_or(layout)
}

/// Invert a covariance in units of `scales`, nothing being known along undetermined directions; `None` where it cannot be inverted.
fn information(covariance: &[f64], scales: &[f64], candidate: &Candidate) -> Option<Vec<f64>> {
    let m = scales.len();
    if covariance.len() != m * m || !covariance.iter().all(|v| v.is_finite()) {
        return None;
    }
    let scaled: Vec<f64> = (0..m * m).map(|at| covariance[at] / (scales[at / m] * scales[at % m])).collect();
    let inverse = invert(m, &scaled)?;
    let mut keep = vec![0.0; m * m];
    (0..m).for_each(|i| keep[i * m + i] = 1.0);
    for direction in candidate.undetermined.iter().map(|found| &found.direction) {
        add_outer(&mut keep, direction, -1.0);
    }
    symmetrise(m, &mut keep);
    Some(congruent(m, &keep, &inverse))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn diagonal(values: [f64; 6]) -> Vec<f64> {
        (0..36).map(|at| if at % 7 == 0 { values[at / 7] } else { 0.0 }).collect()
    }

    #[test]
    fn two_laws_join_by_their_information() {
        let layout = Layout::pose3();
        let mut there = layout.neutral();
        there[9] = 1.0;
        let prior = Prior { theta: there, covariance: diagonal([0.1; 6]) };
        let ready = ReadyPrior::new(&prior, &layout).unwrap();
        let scales = [1.0, 1.0, 1.0, 2.0, 2.0, 2.0];
        // The data know x with the variance .3: the answer is a quarter of the way, its variance .075.
        let covariance = diagonal([0.1, 0.1, 0.1, 0.3, 0.1, 0.1]);
        let scaled: Vec<f64> = (0..36).map(|at| covariance[at] / (scales[at / 6] * scales[at % 6])).collect();
        let inverse = invert(6, &scaled).unwrap();
        let joined = ready.join(layout.manifold(), &layout.neutral(), &inverse, &scales).unwrap();
        assert!((joined.theta[9] - 0.75).abs() < 1e-9, "{:?}", joined.theta);
        assert!((joined.covariance[21] - 0.075).abs() < 1e-9);
        assert!((joined.chi_square - 1.0 / 0.4).abs() < 1e-6, "{}", joined.chi_square);
        // Without data along x the prior is the answer.
        let mut blind = inverse;
        blind[21] = 0.0;
        let joined = ready.join(layout.manifold(), &layout.neutral(), &blind, &scales).unwrap();
        assert!((joined.theta[9] - 1.0).abs() < 1e-9 && joined.chi_square < 1e-9);
        assert!((joined.covariance[21] - 0.1).abs() < 1e-9);
    }

    #[test]
    fn the_density_is_normal_near_and_bounded_far() {
        let layout = Layout::pose3();
        let prior = Prior { theta: layout.neutral(), covariance: diagonal([0.01; 6]) };
        let ready = ReadyPrior::new(&prior, &layout).unwrap();
        let at = |x: f64| {
            let mut theta = layout.neutral();
            theta[9] = x;
            ready.log_density(&theta)
        };
        assert!(at(0.0).abs() < 1e-12);
        assert!((at(0.2) + 2.0).abs() < 1e-4);
        assert!((at(9.0) + MOST_NATS).abs() < 1e-3);
    }

    #[test]
    fn what_is_no_covariance_is_refused() {
        let layout = Layout::pose3();
        let refused = |covariance: Vec<f64>| {
            Prior { theta: layout.neutral(), covariance }.check(&layout).unwrap_err().to_string()
        };
        assert!(refused(vec![1.0; 9]).contains("6 x 6"));
        assert!(refused(diagonal([1.0, 1.0, 0.0, 1.0, 1.0, 1.0])).contains("variance 3"));
        assert!(refused(vec![1.0; 36]).contains("not positive definite"));
        let mut lopsided = diagonal([1.0; 6]);
        lopsided[1] = 0.5;
        assert!(refused(lopsided).contains("not symmetric"));
        let short = Prior { theta: vec![0.0; 3], covariance: diagonal([1.0; 6]) };
        assert!(short.check(&layout).unwrap_err().to_string().contains("12"));
    }
}
