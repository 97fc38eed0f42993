//! Sequential least squares along the constraints: what `clarabel` and `null-space` share.
//!
//! Every iterate satisfies the equalities (and the inequalities to rounding): a trial is the step of the linearised problem,
//! retracted onto the manifold and then moved back onto the constraints by Newton steps of least norm. So the cost alone
//! decides about acceptance, and the gain ratio needs no merit function.
//!
//! Source: Conn, Gould and Toint, Trust-Region Methods (2000), chapter 15; the feasible path is that of a retraction
//! (Absil, Mahony and Sepulchre, Optimization Algorithms on Matrix Manifolds, 2008, chapter 4).

use crate::descent::{Model, ROUNDING_RISE, not_finite_start};
use crate::manifold::{Manifold, norm};
use crate::outcome::Status;
use crate::problem::half_squared_norm;
use crate::session::{COST_ROUNDING, End, Progress, Session};

mod linearised;
mod loss;

pub(crate) use linearised::Linearised;
pub use loss::Loss;

/// The quadratic model and the linearised constraints at the current point.
pub(crate) struct Local {
    pub(crate) model: Model,
    pub(crate) constraints: Linearised,
}

/// How the step of the linearised problem is found.
pub(crate) trait ConstrainedStep {
    /// Write the step within norm(D step) <= radius, and say whether the region is inactive; nothing when the sub-solver
    /// fails, which asks for a smaller region.
    fn step(&mut self, local: &Local, radius: f64, step: &mut [f64]) -> Option<bool>;
}

/// Gain ratio above which a trial is accepted.
const ACCEPT: f64 = 1e-4;

/// Below this cosine between residual and free columns the cost is flat to rounding.
const FLAT_COSINE: f64 = 1e-6;

/// Run the loop.
///
/// # Errors
/// The [`End`] at a limit; the ends by a test come as `Ok`.
pub(crate) fn minimise(
    session: &mut Session<'_, '_>,
    start: &[f64],
    loss: Loss,
    initial_radius: f64,
    rule: &mut dyn ConstrainedStep,
) -> Result<End, End> {
    if loss != Loss::Squares {
        session.set_objective(move |residual| loss.objective(residual));
    }
    let mut state = State::begin(session, start, loss)?;
    let scaled_start = state.scaled_theta();
    let mut radius = initial_radius * if scaled_start > 0.0 { scaled_start } else { 1.0 };
    state.record(session, f64::NAN, radius, true);
    if let Some(end) = state.test_point(session) {
        return Ok(end);
    }
    loop {
        session.next_iteration()?;
        let used = radius;
        let mut trial = Trial::default();
        if let Some(full) = rule.step(&state.local, radius, &mut state.step) {
            trial = state.try_step(session, full)?;
        }
        if trial.gain_ratio < 0.25 {
            radius = 0.25 * trial.scaled_norm.min(radius);
        } else if trial.gain_ratio > 0.75 {
            radius = radius.max(2.0 * trial.scaled_norm);
        }
        let accepted = trial.gain_ratio > ACCEPT;
        let decided = state.test_trial(session, &trial, accepted);
        if accepted {
            state.accept(session);
        }
        state.record(session, norm(&state.step), used, accepted);
        if accepted && let Some(end) = state.test_point(session) {
            return Ok(end);
        }
        if let Some(end) = decided {
            return Ok(end);
        }
        if !(radius.is_finite() && radius > 0.0) {
            return Ok(End::new(Status::Stalled, "no step lowers the cost, however short"));
        }
    }
}

/// What became of a trial.
#[derive(Debug, Clone, Copy)]
struct Trial {
    cost: f64,
    predicted: f64,
    gain_ratio: f64,
    scaled_norm: f64,
    full: bool,
}

impl Default for Trial {
    fn default() -> Self {
        let failed = f64::NEG_INFINITY;
        Self {
            cost: f64::INFINITY,
            predicted: f64::INFINITY,
            gain_ratio: failed,
            scaled_norm: f64::INFINITY,
            full: false,
        }
    }
}

struct State<'p> {
    manifold: &'p dyn Manifold,
    loss: Loss,
    local: Local,
    /// Constraints at the points on the way of a restoration.
    restoring: Linearised,
    candidate: Model,
    theta: Vec<f64>,
    trial_theta: Vec<f64>,
    step: Vec<f64>,
    extent: Vec<f64>,
    /// Gradient without its part along active constraints.
    free_gradient: Vec<f64>,
}

impl<'p> State<'p> {
    fn begin(session: &mut Session<'p, '_>, start: &[f64], loss: Loss) -> Result<Self, End> {
        let problem = session.problem();
        let manifold = problem.manifold();
        let (rows, cols) = (problem.num_residuals(), manifold.tangent());
        let mut constraints = Linearised::new(problem);
        let mut theta = start.to_vec();
        session.check_limits()?;
        let feasible = constraints.restore(problem, &mut theta, &vec![1.0; cols], 200);
        let (mut model, candidate) = (Model::new(rows, cols), Model::new(rows, cols));
        if !session.evaluate_jacobian(&theta, &mut model.residual, &mut model.jacobian)?.is_finite() {
            return Err(not_finite_start(&model));
        }
        if !feasible {
            let violation = session.violation(&theta);
            let message = format!("no feasible point found from the start, violation {violation:.3e} is left");
            return Err(End::new(Status::Stalled, message));
        }
        let (trial_theta, step, extent) = (theta.clone(), vec![0.0; cols], vec![0.0; cols]);
        let free_gradient = vec![0.0; cols];
        let restoring = constraints.clone();
        let local = Local { model, constraints };
        let mut state =
            Self { manifold, loss, local, restoring, candidate, theta, trial_theta, step, extent, free_gradient };
        state.refresh(session);
        Ok(state)
    }

    fn refresh(&mut self, session: &Session<'_, '_>) {
        let model = &mut self.local.model;
        model.update();
        model.cost = self.loss.objective(&model.residual);
        if self.loss != Loss::Squares {
            model.gradient.fill(0.0);
            for (row, r) in model.jacobian.chunks_exact(model.cols.max(1)).zip(&model.residual) {
                let slope = self.loss.slope(*r);
                model.gradient.iter_mut().zip(row).for_each(|(g, a)| *g += slope * a);
            }
        }
        self.manifold.extent(&self.theta, &mut self.extent);
        self.local.constraints.linearise(session.problem(), &self.theta);
        self.local.constraints.free_gradient(&self.local.model, &mut self.free_gradient);
    }

    /// Retract the step, restore the constraints, evaluate, and compare with the prediction.
    fn try_step(&mut self, session: &mut Session<'_, '_>, full: bool) -> Result<Trial, End> {
        let problem = session.problem();
        let model = &self.local.model;
        let predicted = match self.loss {
            Loss::Squares => model.predicted(&self.step),
            loss => model.cost - loss.objective(&moved_residual(model, &self.step)),
        };
        let scaled_norm = model.scaled_norm(&self.step);
        let mut trial = Trial { predicted, scaled_norm, full: full && predicted > 0.0, ..Trial::default() };
        self.manifold.retract(&self.theta, &self.step, &mut self.trial_theta);
        if !self.restoring.restore(problem, &mut self.trial_theta, &model.scaling, 10) {
            return Ok(trial);
        }
        let (residual, jacobian) = (&mut self.candidate.residual, &mut self.candidate.jacobian);
        trial.cost = session.evaluate_jacobian(&self.trial_theta, residual, jacobian)?;
        let rounding = COST_ROUNDING * model.cost;
        let ratio = (model.cost - trial.cost + rounding) / (predicted + rounding);
        trial.gain_ratio = if predicted > -rounding && !ratio.is_nan() { ratio } else { f64::NEG_INFINITY };
        Ok(trial)
    }

    fn accept(&mut self, session: &mut Session<'_, '_>) {
        std::mem::swap(&mut self.theta, &mut self.trial_theta);
        std::mem::swap(&mut self.candidate.largest_norms, &mut self.local.model.largest_norms);
        std::mem::swap(&mut self.candidate, &mut self.local.model);
        self.refresh(session);
        session.settle(&self.theta, self.local.model.cost);
    }

    fn scaled_theta(&self) -> f64 {
        self.local.model.scaled_norm(&self.extent)
    }

    /// Return the cosine of the gradient test for the part of the gradient that no active constraint holds.
    fn cosine(&self) -> f64 {
        let model = &self.local.model;
        let length = (2.0 * half_squared_norm(&model.residual)).sqrt();
        let cosine = |j: usize| {
            let denominator = model.column_norms[j] * length;
            if denominator > 0.0 { self.free_gradient[j].abs() / denominator } else { 0.0 }
        };
        (0..model.cols).map(cosine).fold(0.0, f64::max)
    }

    fn record(&self, session: &mut Session<'_, '_>, step_norm: f64, damping: f64, accepted: bool) {
        let gradient_norm = norm(&self.free_gradient);
        let progress = Progress { cost: self.local.model.cost, gradient_norm, step_norm, damping, accepted };
        session.record(&self.theta, progress);
    }

    fn test_point(&self, session: &Session<'_, '_>) -> Option<End> {
        let (stopping, cost) = (session.stopping(), self.local.model.cost);
        if stopping.zero_cost.is_some_and(|limit| cost <= limit) {
            return Some(End::new(Status::ZeroResidual, format!("cost {cost:.3e} is zero to rounding")));
        }
        // Absolute values have no gradient where a residual vanishes.
        if self.loss == Loss::Absolute {
            return None;
        }
        let cosine = self.cosine();
        stopping.gradient_tolerance.is_some_and(|limit| cosine <= limit).then(|| {
            let message = format!("cosine between residual and free columns of the Jacobian is at most {cosine:.3e}");
            End::new(Status::GradientTolerance, message)
        })
    }

    fn test_trial(&self, session: &Session<'_, '_>, trial: &Trial, accepted: bool) -> Option<End> {
        let (stopping, cost) = (session.stopping(), self.local.model.cost);
        let (actual, predicted) = ((cost - trial.cost) / cost, trial.predicted / cost);
        let near = trial.full || (self.loss != Loss::Absolute && self.cosine() <= FLAT_COSINE);
        let cost_holds = |t: f64| match accepted {
            true => actual.abs() <= t && predicted.abs() <= t,
            // As in the loop without constraints: a rise where the model promises nothing is rounding.
            false => predicted.abs() <= t && actual.abs() <= ROUNDING_RISE,
        };
        if near && stopping.cost_tolerance.is_some_and(cost_holds) {
            let message = format!("relative decrease of the cost {actual:.3e}, predicted {predicted:.3e}");
            return Some(End::new(Status::CostTolerance, message));
        }
        let scaled_theta = self.scaled_theta();
        let short = |t: f64| trial.scaled_norm <= t * (scaled_theta + t);
        let message = format!("scaled step {:.3e} at scaled size {scaled_theta:.3e}", trial.scaled_norm);
        if near && stopping.step_tolerance.is_some_and(short) {
            return Some(End::new(Status::StepTolerance, message));
        }
        let stuck = !accepted && (short(f64::EPSILON) || predicted.abs() <= COST_ROUNDING);
        stuck.then(|| End::new(Status::Stalled, format!("no decrease even by a {message}")))
    }
}

/// Return r + J d.
fn moved_residual(model: &Model, step: &[f64]) -> Vec<f64> {
    let rows = model.jacobian.chunks_exact(model.cols.max(1)).zip(&model.residual);
    rows.map(|(row, r)| r + row.iter().zip(step).map(|(a, d)| a * d).sum::<f64>()).collect()
}
