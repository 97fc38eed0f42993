//! The loop of the own solvers: local model, step, trial, gain ratio, stopping tests.
//!
//! A solver is this loop x a [`Search`] (how the damping or radius follows from the gain ratio) x a [`StepRule`] (which
//! step it gives). Every trial evaluates residual and Jacobian together: so no point is ever evaluated twice, at the price
//! of an unused Jacobian in a rejected trial, which is the rarer case.

use crate::entry::{EntryError, Parameters};
use crate::manifold::{Manifold, norm};
use crate::outcome::Status;
use crate::session::{COST_ROUNDING, End, Progress, Session};

mod boxed;
mod model;
pub mod region;

pub use boxed::TangentBox;
pub use model::Model;

/// A step and what the model promises of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Proposal {
    /// Decrease of the cost that the model predicts, positive for a useful step.
    pub predicted: f64,
    /// norm(D step).
    pub scaled_norm: f64,
    /// Whether the step is (nearly) the one that the model would take without damping, radius or shortening: only the
    /// smallness of such a step says that the minimum is near.
    pub full: bool,
}

/// How a step follows from the model and one control number (damping, radius or step length).
pub trait StepRule {
    /// Prepare factorisations; called once for each new model.
    fn prepare(&mut self, model: &Model);

    /// Write the step for a control number; nothing when there is no finite one.
    fn step(&mut self, model: &Model, control: f64, step: &mut [f64]) -> Option<Proposal>;

    /// Say whether the model needs the exact curvature term.
    fn needs_curvature(&self) -> bool {
        false
    }
}

/// How the control number follows from the success of the trials.
pub trait Search {
    /// Choose the first control number, with norm(D theta) at the start at hand.
    fn begin(&mut self, model: &Model, scaled_start: f64) -> f64;

    /// Judge a trial (gain ratio -inf when it failed) and say whether to accept; change the control number.
    fn judge(&mut self, control: &mut f64, gain_ratio: f64, proposal: Option<Proposal>) -> bool;
}

/// Run the loop from `start`.
///
/// # Errors
/// The [`End`] at a limit; the ends by a test come as `Ok`.
pub fn descend(
    session: &mut Session<'_, '_>,
    start: &[f64],
    rule: &mut dyn StepRule,
    search: &mut dyn Search,
) -> Result<End, End> {
    let mut state = State::begin(session, start, rule)?;
    let mut control = search.begin(&state.model, state.scaled_theta());
    state.record(session, f64::NAN, control, true);
    if let Some(end) = state.test_point(session) {
        return Ok(end);
    }
    loop {
        session.next_iteration()?;
        let proposal = state.propose(rule, control);
        let (mut trial_cost, mut gain_ratio) = (f64::INFINITY, f64::NEG_INFINITY);
        if let Some(Proposal { predicted, .. }) = proposal {
            trial_cost = state.try_step(session)?;
            gain_ratio = rounded_ratio(state.model.cost, state.model.cost - trial_cost, predicted);
        }
        let used = control;
        let accepted = search.judge(&mut control, gain_ratio, proposal) && trial_cost.is_finite();
        let decided = state.test_trial(session, trial_cost, proposal, accepted);
        if accepted {
            state.accept(session, rule);
        }
        state.record(session, norm(&state.step), used, accepted);
        if accepted && let Some(end) = state.test_point(session) {
            return Ok(end);
        }
        if let Some(end) = decided {
            return Ok(end);
        }
        if !(control.is_finite() && control > 0.0) {
            return Ok(End::new(Status::Stalled, "no step lowers the cost, however short"));
        }
    }
}

/// Read the parameter `accept` of a table line: the least gain ratio of an accepted trial.
///
/// # Errors
/// [`EntryError::BadValue`] outside 0 <= accept < 1/4.
pub fn accept(parameters: &Parameters) -> Result<f64, EntryError> {
    parameters.number("accept", "a number from 0 to below 0.25", |v| (0.0..0.25).contains(&v))
}

/// Above this cosine a cost that cannot be lowered any more is not a minimum but a failure of the model.
const STALL_COSINE: f64 = 1e-6;

/// Relative rise of the cost that rounding may cause where residuals are small differences of large numbers.
pub(crate) const ROUNDING_RISE: f64 = 1e-9;

/// Accepted trials in a row that gain nothing worth a tolerance.
const CRAWL_LIMIT: usize = 20;

/// Current point, its model, and the trial.
struct State<'p> {
    manifold: &'p dyn Manifold,
    model: Model,
    candidate: Model,
    theta: Vec<f64>,
    trial_theta: Vec<f64>,
    step: Vec<f64>,
    extent: Vec<f64>,
    bounds: Option<TangentBox>,
    /// Accepted trials in a row whose decrease was within the cost tolerance although their steps were cut short.
    crawled: usize,
}

impl<'p> State<'p> {
    fn begin(session: &mut Session<'p, '_>, start: &[f64], rule: &mut dyn StepRule) -> Result<Self, End> {
        let problem = session.problem();
        let manifold = problem.manifold();
        let (rows, cols) = (problem.num_residuals(), manifold.tangent());
        let mut theta = start.to_vec();
        let bounds = problem.bounds().map(|b| TangentBox::new(b, manifold, &theta, rows)).transpose()?;
        if let Some(bounds) = &bounds {
            bounds.clamp(&mut theta);
        }
        let (mut model, candidate) = (Model::new(rows, cols), Model::new(rows, cols));
        if !session.evaluate_jacobian(&theta, &mut model.residual, &mut model.jacobian)?.is_finite() {
            return Err(not_finite_start(&model));
        }
        let (trial_theta, step, extent) = (theta.clone(), vec![0.0; cols], vec![0.0; cols]);
        let mut state = Self { manifold, model, candidate, theta, trial_theta, step, extent, bounds, crawled: 0 };
        state.refresh(session, rule);
        Ok(state)
    }

    /// Complete a model whose residual and Jacobian are new.
    fn refresh(&mut self, session: &mut Session<'_, '_>, rule: &mut dyn StepRule) {
        self.model.update();
        self.manifold.extent(&self.theta, &mut self.extent);
        if rule.needs_curvature() {
            let m = self.model.cols;
            self.model.curvature.resize(m * m, 0.0);
            if !session.curvature(&self.theta, &self.model.residual, &mut self.model.curvature) {
                // Second derivatives that overflow leave the Gauss-Newton model.
                self.model.curvature.fill(0.0);
            }
            self.model.scale_by_curvature();
        }
        if self.bounds.is_none() {
            rule.prepare(&self.model);
        }
    }

    fn propose(&mut self, rule: &mut dyn StepRule, control: f64) -> Option<Proposal> {
        match &mut self.bounds {
            None => rule.step(&self.model, control, &mut self.step),
            Some(bounds) => bounds.step(rule, &self.model, &self.theta, control, &mut self.step),
        }
    }

    /// Evaluate the point that the step leads to.
    fn try_step(&mut self, session: &mut Session<'_, '_>) -> Result<f64, End> {
        self.manifold.retract(&self.theta, &self.step, &mut self.trial_theta);
        if let Some(bounds) = &self.bounds {
            bounds.clamp(&mut self.trial_theta);
        }
        session.evaluate_jacobian(&self.trial_theta, &mut self.candidate.residual, &mut self.candidate.jacobian)
    }

    fn accept(&mut self, session: &mut Session<'_, '_>, rule: &mut dyn StepRule) {
        std::mem::swap(&mut self.theta, &mut self.trial_theta);
        std::mem::swap(&mut self.candidate.largest_norms, &mut self.model.largest_norms);
        std::mem::swap(&mut self.candidate, &mut self.model);
        self.refresh(session, rule);
        session.settle(&self.theta, self.model.cost);
    }

    fn is_free(&self, j: usize) -> bool {
        self.bounds.as_ref().is_none_or(|bounds| bounds.is_free(&self.model, &self.theta, j))
    }

    fn cosine(&self) -> f64 {
        self.model.cosine(|j| self.is_free(j))
    }

    fn scaled_theta(&self) -> f64 {
        self.model.scaled_norm(&self.extent)
    }

    fn record(&self, session: &mut Session<'_, '_>, step_norm: f64, damping: f64, accepted: bool) {
        let free = (0..self.model.cols).filter(|j| self.is_free(*j));
        let gradient_norm = free.map(|j| self.model.gradient[j].powi(2)).sum::<f64>().sqrt();
        let progress = Progress { cost: self.model.cost, gradient_norm, step_norm, damping, accepted };
        session.record(&self.theta, progress);
    }

    /// Test the point itself: zero residual, gradient.
    fn test_point(&self, session: &Session<'_, '_>) -> Option<End> {
        let (stopping, cost) = (session.stopping(), self.model.cost);
        if stopping.zero_cost.is_some_and(|limit| cost <= limit) {
            return Some(End::new(Status::ZeroResidual, format!("cost {cost:.3e} is zero to rounding")));
        }
        let cosine = self.cosine();
        stopping.gradient_tolerance.is_some_and(|limit| cosine <= limit).then(|| {
            let message = format!("cosine between residual and Jacobian is at most {cosine:.3e}");
            End::new(Status::GradientTolerance, message)
        })
    }

    /// Test a trial: decrease of the cost, length of the step, nothing left above rounding.
    fn test_trial(
        &mut self,
        session: &Session<'_, '_>,
        trial_cost: f64,
        proposal: Option<Proposal>,
        accepted: bool,
    ) -> Option<End> {
        let (stopping, Proposal { predicted, scaled_norm, full }) = (session.stopping(), proposal?);
        let actual = (self.model.cost - trial_cost) / self.model.cost;
        let predicted = predicted / self.model.cost;
        let within = |limit: f64| actual.abs() <= limit && predicted.abs() <= limit;
        let cosine = self.model.scaled_cosine(|j| self.is_free(j));
        // A short step that was cut short tells nothing: then the gradient must be small as well.
        let near = full || cosine <= STALL_COSINE;
        let cost_holds = |t: f64| match accepted {
            true => within(t),
            // A full step that promises no more than the tolerance and still brings a rise shows rounding, not a way down.
            false => predicted.abs() <= t && actual.abs() <= ROUNDING_RISE,
        };
        if near && stopping.cost_tolerance.is_some_and(cost_holds) {
            let message = format!("relative decrease of the cost {actual:.3e}, predicted {predicted:.3e}");
            return Some(End::new(Status::CostTolerance, message));
        }
        let scaled_theta = self.scaled_theta();
        let short = |limit: f64| scaled_norm <= limit * (scaled_theta + limit);
        let message = format!("scaled step {scaled_norm:.3e} at scaled size {scaled_theta:.3e}");
        if near && stopping.step_tolerance.is_some_and(short) {
            return Some(End::new(Status::StepTolerance, message));
        }
        if accepted {
            self.crawled = if stopping.cost_tolerance.is_some_and(within) { self.crawled + 1 } else { 0 };
        }
        let stuck = self.crawled >= CRAWL_LIMIT || (!accepted && short(f64::EPSILON));
        stuck.then(|| End::new(Status::Stalled, stall_message(&message, cosine)))
    }
}

fn stall_message(step: &str, cosine: f64) -> String {
    format!(
        "no decrease to speak of by a {step} although the cosine is {cosine:.1e}: rounding, a wrong Jacobian or a kink"
    )
}

/// Return actual / predicted, with both raised by the rounding of the cost so that noise in the last digit is no failure.
///
/// Source: Conn, Gould and Toint, Trust-Region Methods, section 17.4.2.
fn rounded_ratio(cost: f64, actual: f64, predicted: f64) -> f64 {
    let rounding = COST_ROUNDING * cost;
    let ratio = (actual + rounding) / (predicted + rounding);
    if predicted > 0.0 && !ratio.is_nan() { ratio } else { f64::NEG_INFINITY }
}

/// Name the first value that is not finite at the start.
pub(crate) fn not_finite_start(model: &Model) -> End {
    let message = match model.residual.iter().position(|v| !v.is_finite()) {
        Some(i) => format!("residual {i} at the start is {}", model.residual[i]),
        None => match model.jacobian.iter().position(|v| !v.is_finite()) {
            Some(at) => {
                let (i, j) = (at / model.cols, at % model.cols);
                format!("Jacobian entry ({i}, {j}) at the start is {}", model.jacobian[at])
            }
            None => "the cost at the start overflows".to_string(),
        },
    };
    End::new(Status::NumericalFailure, message)
}
