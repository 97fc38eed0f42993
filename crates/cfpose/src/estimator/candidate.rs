//! One theta and everything that is known about it.

use std::sync::Arc;

use cfpose_optim::problem::LeastSquares;
use cfpose_optim::{Outcome, Status};
use serde::{Deserialize, Serialize};

use super::Parts;
use super::modes::Mode;
use super::pipeline::Stage;
use super::points::Evidence;
use super::prior::PriorReport;
use super::stage::ReadyStage;
use super::undetermined::Undetermined;
use super::workbench::Data;
use crate::distances::sampling::Sampling;
use crate::distances::support::Support;
use crate::problem::MomentProblem;
use crate::statistics::{Randomness, Statistics, chi_square_tail};

/// What a theta is the best fit of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum By {
    /// Means of feature functions.
    Moments,
    /// Likelihood of the points.
    Points,
}

/// Where the covariance behind a weighting was computed, and from which randomness.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct WeightedAt {
    /// Ambient theta, nuisance parameters included.
    pub theta: Vec<f64>,
    /// Noise and sampling.
    pub randomness: Randomness,
}

/// What an estimate minimised last, as data: enough to evaluate the same weighted problem again.
///
/// [`Estimator::evaluate_minimised`](super::Estimator::evaluate_minimised) gives the cost of the estimate from it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Minimised {
    /// The stage, every choice filled in: model variant, features, normaliser, weighting, noise, solver.
    pub stage: Stage,
    /// Ambient theta of the estimate with the nuisance parameters of the stage.
    pub theta: Vec<f64>,
    /// Theta (ambient) that fixed the statistics of a target side that moves.
    pub reference: Vec<f64>,
    /// Where the weighting was computed, `None` for the identity.
    pub weighted_at: Option<WeightedAt>,
    /// Rows of the source file (from 1) that were left out.
    pub left_out_source: Vec<usize>,
    /// Rows of the target file (from 1) that were left out.
    pub left_out_target: Vec<usize>,
    /// Tangent columns that were free, `None` for all.
    pub free: Option<Vec<usize>>,
    /// Seed of everything random.
    pub seed: u64,
}

impl Minimised {
    /// Return the rows (from 0) that are left of a side of `len` rows; `None` for all.
    pub(super) fn kept(left_out: &[usize], len: usize) -> Option<Vec<usize>> {
        if left_out.is_empty() {
            return None;
        }
        let mut keep = vec![true; len];
        left_out.iter().filter(|row| (1..=len).contains(*row)).for_each(|row| keep[row - 1] = false);
        Some((0..len).filter(|k| keep[*k]).collect())
    }
}

/// A theta that an estimate may return. Cost, J, and Jacobian are those of `problem` at `theta`.
#[derive(Clone)]
pub(super) struct Candidate {
    /// Ambient theta, nuisance parameters included.
    pub theta: Vec<f64>,
    pub by: By,
    /// The weighted problem that judges theta.
    pub problem: MomentProblem,
    pub weighted_at: Option<WeightedAt>,
    /// How the solve that led here ended; brought up to date when theta moves.
    pub outcome: Outcome,
    pub statistics: Option<Statistics>,
    pub support: Option<Support>,
    pub sampling: Option<Sampling>,
    /// In front of the camera, front-facing.
    pub plausible: bool,
    /// Whether the statistics and the distances agree with the fit.
    pub accepted: bool,
    /// Rank: distance between the points, or the cost.
    pub score: f64,
    /// Share of the target points that were left out as outliers.
    pub clutter: Option<f64>,
    /// What the likelihood of the points says.
    pub evidence: Option<Evidence>,
    /// The other modes of that likelihood, most likely first.
    pub modes: Vec<Mode>,
    /// Share of the target that neither this theta nor those that the points cannot tell from it explain, where there are such.
    pub unexplained: Option<f64>,
    /// Directions that the points do not determine.
    pub undetermined: Vec<Undetermined>,
    /// What became of the prior.
    pub prior: Option<PriorReport>,
    /// Root of the trace of the covariance: radians, lengths in sizes of the source.
    pub deviation: Option<f64>,
    /// Rows of the files that `problem` is about, `None` for all.
    pub kept_source: Option<Arc<Vec<usize>>>,
    pub kept_target: Option<Arc<Vec<usize>>>,
    pub evaluations: usize,
    pub iterations: usize,
}

/// A fit by distances: what is known about it without the means.
#[derive(Debug, Clone)]
pub(super) struct PointFit {
    pub theta: Vec<f64>,
    /// Standard deviation of the noise in one coordinate.
    pub sigma: f64,
    /// Covariance of the model's tangent coordinates.
    pub covariance: Vec<f64>,
    /// How the fit ended.
    pub message: String,
    pub converged: bool,
}

impl Candidate {
    /// Say which rows of the files the problem is about.
    pub fn on(mut self, data: &Data) -> Self {
        self.kept_source.clone_from(&data.kept_source);
        self.kept_target.clone_from(&data.kept_target);
        self
    }

    /// Return what was minimised last.
    pub fn minimised(&self, stage: &ReadyStage, parts: &Parts, counts: [usize; 2]) -> Minimised {
        let left_out = |kept: &Option<Arc<Vec<usize>>>, len: usize| match kept {
            None => Vec::new(),
            Some(kept) => {
                let mut missing = vec![true; len];
                kept.iter().for_each(|k| missing[*k] = false);
                (0..len).filter(|k| missing[*k]).map(|k| k + 1).collect()
            }
        };
        Minimised {
            stage: stage.stage.clone(),
            theta: self.theta.clone(),
            reference: parts.reference.clone(),
            weighted_at: self.weighted_at.clone(),
            left_out_source: left_out(&self.kept_source, counts[0]),
            left_out_target: left_out(&self.kept_target, counts[1]),
            free: parts.settings.free.clone(),
            seed: parts.settings.seed,
        }
    }

    /// Move to another theta of the same problem: cost and J are evaluated there.
    pub fn move_to(&mut self, theta: &[f64]) {
        let mut residual = vec![0.0; self.problem.num_residuals()];
        self.theta[..theta.len()].copy_from_slice(theta);
        self.problem.residual(&self.theta, &mut residual);
        let cost = cfpose_optim::problem::half_squared_norm(&residual);
        self.outcome.theta.clone_from(&self.theta);
        self.outcome.cost = cost;
        if let Some(statistics) = &mut self.statistics {
            statistics.j_statistic = 2.0 * cost;
            statistics.p_value = chi_square_tail(statistics.j_statistic, statistics.degrees_of_freedom);
        }
    }

    /// Take the theta of a fit by distances, with its covariance and noise; status and message become those of that fit.
    pub fn take(&mut self, fit: &PointFit) {
        self.move_to(&fit.theta);
        self.by = By::Points;
        self.outcome.status = if fit.converged { Status::StepTolerance } else { Status::MaxIterations };
        self.outcome.message.clone_from(&fit.message);
        self.outcome.gradient_norm = f64::NAN;
        if let Some(statistics) = &mut self.statistics {
            // No unknown was fitted to the means: each of them is a degree of freedom again.
            statistics.degrees_of_freedom += (statistics.covariance.len() as f64).sqrt() as usize;
            statistics.p_value = chi_square_tail(statistics.j_statistic, statistics.degrees_of_freedom);
            statistics.covariance.clone_from(&fit.covariance);
            statistics.noise_sigma = Some(fit.sigma);
        }
    }
}
