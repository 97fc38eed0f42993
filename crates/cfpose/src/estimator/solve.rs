//! How a stage is solved, in the steps of docs/method.md: once, weighted, continuously, and what the statistics say.

use cfpose_optim::{Control, LeastSquares, Outcome, SolveError, Solver, Status, Stopping};

use super::candidate::{By, Candidate, WeightedAt};
use super::continuous::Continuous;
use super::stage::ReadyStage;
use super::workbench::of_side;
use super::{Parts, Watch};
use crate::distances::likelihood::PointsLikelihood;
use crate::distances::sampling::Sampling;
use crate::distances::support::Support;
use crate::error::{Error, Side};
use crate::problem::MomentProblem;
use crate::statistics::weighting::Update;
use crate::statistics::{self, Statistics};

/// Source points, at most, that a fit is aligned on before its sampling is asked.
const NEAR_SOURCE: usize = 5000;

/// How far, in spacings, the alignment moves a fit at least for its distances to be asked again.
const STILL: f64 = 0.1;

/// Runs the solver of a stage under the stopping rules of the settings, and counts.
pub(super) struct Runner<'a, 'b> {
    pub parts: &'a Parts,
    pub watch: &'a mut Watch<'b>,
    stopping: Stopping,
    evaluations: usize,
    iterations: usize,
}

impl<'a, 'b> Runner<'a, 'b> {
    /// Take the limits of a stage and of the settings.
    pub fn new(parts: &'a Parts, watch: &'a mut Watch<'b>, stage: &ReadyStage) -> Self {
        let given = &parts.settings.stopping;
        let stopping = Stopping { max_iterations: stage.stage.iterations.min(given.max_iterations), ..given.clone() };
        Self { parts, watch, stopping, evaluations: 0, iterations: 0 }
    }

    /// Say whether to end early.
    fn is_interrupted(&self) -> bool {
        self.watch.interrupt.is_raised()
    }

    /// Solve a problem from theta.
    pub fn run(
        &mut self,
        problem: &dyn LeastSquares,
        theta: &[f64],
        solver: &dyn Solver,
    ) -> Result<Outcome, SolveError> {
        let interrupt = self.watch.interrupt;
        let mut control = Control {
            stopping: Stopping { deadline: interrupt.left(), ..self.stopping.clone() },
            seed: self.parts.settings.seed,
            cancel: interrupt.cancel(),
            ..Control::default()
        };
        if let Some(observer) = self.watch.observer.as_deref_mut() {
            control.observer = Some(observer);
        }
        let outcome = solver.solve(problem, theta, &mut control)?;
        self.evaluations += outcome.counts.residuals;
        self.iterations += outcome.counts.iterations;
        Ok(outcome)
    }
}

/// Where a solve of a stage stands.
struct Progress {
    /// Ambient theta, nuisance parameters included.
    theta: Vec<f64>,
    outcome: Outcome,
    /// The problem that `outcome` belongs to.
    problem: MomentProblem,
    weighted_at: Option<WeightedAt>,
    sampling: Option<(Support, Sampling)>,
}

impl Progress {
    fn moved_to(&mut self, outcome: Outcome) {
        self.theta.clone_from(&outcome.theta);
        self.outcome = outcome;
    }
}

impl ReadyStage {
    /// Solve from theta of another stage (or a start): once, then again with each weighting.
    ///
    /// # Errors
    /// [`Error`] for misuse of the solver and points mapped to infinity; not converging is a status.
    pub fn solve(&self, start: &[f64], parts: &Parts, watch: &mut Watch<'_>) -> Result<Candidate, Error> {
        let mut runner = Runner::new(parts, watch, self);
        let mut progress = self.first(start, &mut runner)?;
        if progress.outcome.usable() && !runner.is_interrupted() {
            match self.weighting.update() {
                Update::Never => {}
                Update::Steps(steps) => self.weighted(&mut progress, steps, &mut runner)?,
                Update::EveryEvaluation => {
                    self.weighted(&mut progress, 1, &mut runner)?;
                    self.continuous(&mut progress, &mut runner)?;
                }
            }
        }
        let (evaluations, iterations) = (runner.evaluations, runner.iterations);
        Ok(Candidate { evaluations, iterations, ..self.candidate(progress, parts) })
    }

    /// The first solve: the residual as it is, from a start.
    fn first(&self, start: &[f64], runner: &mut Runner<'_, '_>) -> Result<Progress, Error> {
        let mut theta = self.adopt(start, runner.parts);
        if self.stage.coarse_to_fine {
            theta = self.coarse_to_fine(&theta, runner)?;
        }
        let outcome = runner.run(&self.problem, &theta, self.solver.as_ref())?;
        let problem = self.problem.clone();
        Ok(Progress { theta: outcome.theta.clone(), outcome, problem, weighted_at: None, sampling: None })
    }

    /// The weighted solves: W = S^-1 at the last theta (two-step generalised method of moments), so many times.
    fn weighted(&self, progress: &mut Progress, steps: usize, runner: &mut Runner<'_, '_>) -> Result<(), Error> {
        let parts = runner.parts;
        // The sampling is found by distances at the first solution, before anything is fitted to the residual's scatter.
        let support = self.near_support(&progress.theta, parts)?;
        let sampling = parts.settings.sampling.unwrap_or_else(|| self.detect(&support, parts));
        progress.sampling = Some((support, sampling));
        if runner.is_interrupted() {
            return Ok(());
        }
        let mut weighted: Option<MomentProblem> = None;
        for _ in 0..steps {
            let (theta, kappa) = (&progress.theta, self.kappa(sampling));
            let randomness = self.randomness(theta, weighted.as_ref(), &support, kappa, parts);
            let problem = self.weighted_at(theta, &randomness, parts.settings.seed)?;
            progress.weighted_at = Some(WeightedAt { theta: theta.clone(), randomness });
            let outcome = runner.run(&problem, theta, self.solver.as_ref())?;
            progress.problem = problem.clone();
            progress.moved_to(outcome);
            weighted = Some(problem);
            if !progress.outcome.usable() || runner.is_interrupted() {
                break;
            }
        }
        Ok(())
    }

    /// The continuously updated solve: W = S(theta)^-1 follows theta; at its end W is held, so that cost and J are of one W.
    fn continuous(&self, progress: &mut Progress, runner: &mut Runner<'_, '_>) -> Result<(), Error> {
        let (Some((support, sampling)), true) = (progress.sampling, progress.outcome.usable()) else { return Ok(()) };
        if runner.is_interrupted() {
            return Ok(());
        }
        let parts = runner.parts;
        let kappa = self.kappa(sampling);
        let randomness = self.randomness(&progress.theta, Some(&progress.problem), &support, kappa, parts);
        let problem = Continuous::new(self, randomness, parts);
        let outcome = runner.run(&problem, &progress.theta, self.solver.as_ref())?;
        let randomness = problem.randomness(&outcome.theta);
        let usable = outcome.usable();
        progress.moved_to(outcome);
        if usable {
            progress.problem = self.weighted_at(&progress.theta, &randomness, parts.settings.seed)?;
            progress.weighted_at = Some(WeightedAt { theta: progress.theta.clone(), randomness });
        }
        Ok(())
    }

    /// The statistics: J, its p-value and the covariance of theta, where the weighting has them.
    fn candidate(&self, progress: Progress, parts: &Parts) -> Candidate {
        let Progress { theta, outcome, problem, weighted_at, sampling } = progress;
        let has_statistic = self.weighting.has_statistic() && problem.whitening().is_some() && outcome.usable();
        let statistics = weighted_at.as_ref().filter(|_| has_statistic).and_then(|at| {
            let statistics = statistics::of_whitened(&problem, &theta, self.own_tangent())?;
            let noise_sigma = self.known_noise_sigma(&problem, &theta, parts);
            Some(Statistics { noise_sigma, kappa: at.randomness.kappa, ..statistics })
        });
        Candidate {
            theta,
            by: By::Moments,
            problem,
            weighted_at,
            outcome,
            statistics,
            support: sampling.map(|(support, _)| support),
            sampling: sampling.map(|(_, sampling)| sampling),
            plausible: true,
            accepted: false,
            score: f64::INFINITY,
            clutter: None,
            evidence: None,
            modes: Vec::new(),
            unexplained: None,
            undetermined: Vec::new(),
            prior: None,
            deviation: None,
            kept_source: None,
            kept_target: None,
            evaluations: 0,
            iterations: 0,
        }
    }

    /// Make a candidate of a theta of another stage without a solve: the best of a search that was interrupted.
    pub fn unsolved(&self, theta: &[f64], parts: &Parts) -> Candidate {
        let theta = self.adopt(theta, parts);
        let (residual, _) = self.problem.unweighted(&theta, false);
        let cost = cfpose_optim::problem::half_squared_norm(&residual);
        let outcome = Outcome::unsolved(theta.clone(), cost, Status::Cancelled, "not solved");
        let problem = self.problem.clone();
        self.candidate(Progress { theta, outcome, problem, weighted_at: None, sampling: None }, parts)
    }

    /// Compare the points at theta, or, where its misfit may hide the sampling, at a theta that is refined a little.
    fn near_support(&self, theta: &[f64], parts: &Parts) -> Result<Support, Error> {
        let (support, criteria) = (self.support(theta)?, &parts.criteria);
        let far = support.normal_sigma > criteria.near_sampling * support.source_spacing;
        if self.model().target.is_moving() || support.mutual > criteria.mutual || far {
            return Ok(support);
        }
        let some = every_nth(&self.sides.mapped_target.rows(), criteria.refine_points);
        // A part of a large source shows where the shape is.
        let rows: Vec<usize> =
            (0..self.all_source.len()).step_by(self.all_source.len().div_ceil(NEAR_SOURCE)).collect();
        let part = self.all_source.select(&rows).map_err(of_side(Side::Source))?;
        let Some(near) = PointsLikelihood::new(&self.problem, &part, some, 4) else { return Ok(support) };
        match near.align(theta, &[0.05, 0.02, 0.01], 2) {
            Some((_, moved)) if near.mover.apart(theta, &moved) > STILL * support.source_spacing => {
                self.support(&moved)
            }
            _ => Ok(support),
        }
    }
}

impl ReadyStage {
    /// Return where the weighting of the stage is computed for an evaluation at theta, `None` where it reads no covariance.
    ///
    /// # Errors
    /// [`Error`] where a mapped point is not finite.
    pub fn weighting_at(&self, theta: &[f64], parts: &Parts) -> Result<Option<WeightedAt>, Error> {
        if self.weighting.update() == Update::Never {
            return Ok(None);
        }
        let support = self.support(theta)?;
        let sampling = parts.settings.sampling.unwrap_or_else(|| self.detect(&support, parts));
        let randomness = self.randomness(theta, None, &support, self.kappa(sampling), parts);
        Ok(Some(WeightedAt { theta: theta.to_vec(), randomness }))
    }

    /// Build the weighted problem of the stage again from what is known of it.
    ///
    /// # Errors
    /// As [`ReadyStage::weighted_at`].
    pub fn rebuilt(&self, weighted_at: Option<&WeightedAt>, seed: u64) -> Result<MomentProblem, Error> {
        match weighted_at {
            None => Ok(self.problem.clone()),
            Some(WeightedAt { theta, randomness }) => self.weighted_at(theta, randomness, seed),
        }
    }
}

/// Return every n-th row, so that at most `limit` are left.
fn every_nth(rows: &[[f64; 3]], limit: usize) -> Vec<[f64; 3]> {
    rows.iter().step_by(rows.len().div_ceil(limit)).copied().collect()
}
