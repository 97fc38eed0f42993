//! The bookkeeping of one solve, shared by every solver: counts, limits, best point so far, trace, observer, outcome.
//!
//! A solver evaluates the problem only through its [`Session`]. So no solver can lose the best point, call a limit a
//! convergence, miss the cancel flag or count evaluations in its own way.

use std::sync::atomic::Ordering;
use std::time::Instant;

use crate::observe::Observer;
use crate::outcome::{Counts, Outcome, Status, TraceRow};
use crate::problem::{LeastSquares, half_squared_norm};
use crate::solver::{Control, Needs, SolveError, Solver, Stopping};

/// Largest violation of a constraint at which a point counts as feasible when points are compared.
pub const FEASIBILITY_TOLERANCE: f64 = 1e-8;

/// Costs within this relative distance cannot be told apart: a few units of rounding of a sum of squares.
pub const COST_ROUNDING: f64 = 8.0 * f64::EPSILON;

/// The end of a solve: what a solver body returns, and what an evaluation returns instead of a cost when a limit is reached.
#[derive(Debug, Clone, PartialEq)]
pub struct End {
    /// Why the solve ended.
    pub status: Status,
    /// One sentence with the numbers behind the status.
    pub message: String,
}

impl End {
    /// Join a status and its message.
    pub fn new(status: Status, message: impl Into<String>) -> Self {
        Self { status, message: message.into() }
    }
}

/// What one iteration reports to trace and observer; the session adds the counts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress {
    /// Cost at the current point.
    pub cost: f64,
    /// Norm of the gradient J'r, NaN where the solver has none.
    pub gradient_norm: f64,
    /// Norm of the last step, NaN at the start.
    pub step_norm: f64,
    /// Damping or trust-region radius, NaN where the solver has none.
    pub damping: f64,
    /// Whether the step was accepted.
    pub accepted: bool,
}

/// A function of the residual.
type Objective<'s> = Box<dyn Fn(&[f64]) -> f64 + 's>;

/// One running solve.
pub struct Session<'s, 'a> {
    problem: &'s dyn LeastSquares,
    control: &'s mut Control<'a>,
    began: Instant,
    counts: Counts,
    best: Vec<f64>,
    best_cost: f64,
    best_violation: f64,
    constrained: bool,
    constraint_values: Vec<f64>,
    gradient_norm: f64,
    trace: Vec<TraceRow>,
    /// What is minimised where that is not 1/2 r'r.
    objective: Option<Objective<'s>>,
}

/// Forward the rows of an inner solve with its place in the whole.
struct Shifted<'o, 'b> {
    observer: &'o mut (dyn Observer + 'b),
    before: Counts,
}

impl Observer for Shifted<'_, '_> {
    fn iteration(&mut self, row: &TraceRow, theta: &[f64]) {
        self.observer.iteration(&shift(row, self.before), theta);
    }
}

fn shift(row: &TraceRow, before: Counts) -> TraceRow {
    TraceRow {
        iteration: row.iteration + before.iterations,
        evaluations: row.evaluations + before.residuals,
        ..row.clone()
    }
}

/// Run a solver body within a session and return its outcome.
///
/// The body gets the checked start; it ends with `Ok` or, through `?` on an evaluation, with `Err`: both are ends.
///
/// # Errors
/// [`SolveError`] when the start has the wrong length or is not finite.
///
/// ```
/// use cfpose_optim::session::{End, run};
/// use cfpose_optim::testproblems::Rosenbrock;
/// use cfpose_optim::{Control, Needs, Status};
/// let outcome = run("look-once", Needs::default(), &Rosenbrock, &[-1.2, 1.0], &mut Control::default(), |session, start| {
///     let mut residual = [0.0; 2];
///     session.evaluate(start, &mut residual)?;
///     Ok(End::new(Status::Stalled, "looked once"))
/// }).unwrap();
/// assert_eq!(outcome.counts.residuals, 1);
/// assert!((outcome.cost - 12.1).abs() < 1e-12);
/// ```
pub fn run<'a>(
    name: &str,
    needs: Needs,
    problem: &dyn LeastSquares,
    start: &[f64],
    control: &mut Control<'a>,
    body: impl FnOnce(&mut Session<'_, 'a>, &[f64]) -> Result<End, End>,
) -> Result<Outcome, SolveError> {
    let expected = problem.manifold().ambient();
    if start.len() != expected {
        return Err(SolveError::StartLength { expected, found: start.len() });
    }
    if let Some((index, value)) = start.iter().enumerate().find(|(_, v)| !v.is_finite()) {
        return Err(SolveError::StartNotFinite { index, value: *value });
    }
    let mut session = Session::open(problem, start, control);
    let end = match unsupported(name, needs, problem) {
        Some(end) => end,
        None => body(&mut session, start).unwrap_or_else(|end| end),
    };
    Ok(session.close(end))
}

/// Compare what a solver needs with what a problem has; say why the pair does not fit.
pub fn unsupported(name: &str, needs: Needs, problem: &dyn LeastSquares) -> Option<End> {
    let offered = problem.capabilities();
    let reason = if needs.jacobian && !offered.jacobian {
        "needs a Jacobian and the problem has none"
    } else if needs.curvature && !offered.curvature {
        "needs exact second derivatives and the problem has none"
    } else if problem.bounds().is_some() && !needs.bounds {
        "does not treat bounds and the problem has some"
    } else if problem.constraints().is_some() && !needs.constraints {
        "does not treat general constraints and the problem has some"
    } else {
        return None;
    };
    Some(End::new(Status::Unsupported, format!("skipped: `{name}` {reason}")))
}

/// Return the cost of a residual, infinite when any entry is not finite or the sum overflows.
fn finite_cost(residual: &[f64]) -> f64 {
    let cost = half_squared_norm(residual);
    if cost.is_finite() { cost } else { f64::INFINITY }
}

impl<'s, 'a> Session<'s, 'a> {
    fn open(problem: &'s dyn LeastSquares, start: &[f64], control: &'s mut Control<'a>) -> Self {
        let num_constraints = problem.constraints().map_or(0, |c| c.num_equalities() + c.num_inequalities());
        Self {
            problem,
            control,
            began: Instant::now(),
            counts: Counts::default(),
            best: start.to_vec(),
            best_cost: f64::INFINITY,
            best_violation: f64::INFINITY,
            constrained: num_constraints > 0 || problem.bounds().is_some(),
            constraint_values: vec![0.0; num_constraints],
            gradient_norm: f64::NAN,
            trace: Vec::new(),
            objective: None,
        }
    }

    /// Return the problem.
    pub fn problem(&self) -> &'s dyn LeastSquares {
        self.problem
    }

    /// Return the stopping rules.
    pub fn stopping(&self) -> &Stopping {
        &self.control.stopping
    }

    /// Return the seed of the solver's own randomness.
    pub fn seed(&self) -> u64 {
        self.control.seed
    }

    /// Return the counts so far.
    pub fn counts(&self) -> Counts {
        self.counts
    }

    /// Return the best point seen and its cost (infinite before the first finite evaluation).
    pub fn best(&self) -> (&[f64], f64) {
        (&self.best, self.best_cost)
    }

    /// Return the largest violation of bounds and constraints at the best point.
    pub fn best_violation(&self) -> f64 {
        self.best_violation
    }

    /// Minimise another function of the residual than 1/2 r'r from here on: it becomes the cost of the outcome.
    pub fn set_objective(&mut self, objective: impl Fn(&[f64]) -> f64 + 's) {
        self.objective = Some(Box::new(objective));
    }

    fn cost_of(&self, residual: &[f64]) -> f64 {
        match &self.objective {
            None => finite_cost(residual),
            Some(objective) => Some(objective(residual)).filter(|c| c.is_finite()).unwrap_or(f64::INFINITY),
        }
    }

    /// Evaluate the residual; return its cost, infinite when an entry is not finite.
    ///
    /// # Errors
    /// The [`End`] of the solve when a limit on evaluations or time is reached or the cancel flag is up.
    pub fn evaluate(&mut self, theta: &[f64], residual: &mut [f64]) -> Result<f64, End> {
        self.check_limits()?;
        self.counts.residuals += 1;
        self.problem.residual(theta, residual);
        let cost = self.cost_of(residual);
        self.offer(theta, cost);
        Ok(cost)
    }

    /// Evaluate residual and Jacobian together; return the cost, infinite when an entry of either is not finite.
    ///
    /// # Errors
    /// As [`Session::evaluate`].
    pub fn evaluate_jacobian(&mut self, theta: &[f64], residual: &mut [f64], jacobian: &mut [f64]) -> Result<f64, End> {
        self.check_limits()?;
        self.counts.residuals += 1;
        self.counts.jacobians += 1;
        self.problem.jacobian(theta, residual, jacobian);
        let cost = self.cost_of(residual);
        self.offer(theta, cost);
        Ok(if jacobian.iter().all(|v| v.is_finite()) { cost } else { f64::INFINITY })
    }

    /// Evaluate the curvature term; say whether all entries are finite.
    pub fn curvature(&mut self, theta: &[f64], weights: &[f64], hessian: &mut [f64]) -> bool {
        self.counts.curvatures += 1;
        self.problem.curvature(theta, weights, hessian);
        hessian.iter().all(|v| v.is_finite())
    }

    /// Count an iteration.
    ///
    /// # Errors
    /// The [`End`] of the solve when a limit is reached or the cancel flag is up.
    pub fn next_iteration(&mut self) -> Result<(), End> {
        let limit = self.control.stopping.max_iterations;
        if self.counts.iterations >= limit {
            return Err(End::new(Status::MaxIterations, format!("limit of {limit} iterations reached")));
        }
        self.check_limits()?;
        self.counts.iterations += 1;
        Ok(())
    }

    /// Report an iteration to trace and observer.
    pub fn record(&mut self, theta: &[f64], progress: Progress) {
        if !progress.gradient_norm.is_nan() {
            self.gradient_norm = progress.gradient_norm;
        }
        if !self.control.trace && self.control.observer.is_none() {
            return;
        }
        let row = TraceRow {
            iteration: self.counts.iterations,
            evaluations: self.counts.residuals,
            cost: progress.cost,
            gradient_norm: progress.gradient_norm,
            step_norm: progress.step_norm,
            damping: progress.damping,
            accepted: progress.accepted,
        };
        if let Some(observer) = self.control.observer.as_mut() {
            observer.iteration(&row, theta);
        }
        if self.control.trace {
            self.trace.push(row);
        }
    }

    /// Prefer an accepted point over the best one when their costs differ by rounding only.
    ///
    /// Near a minimum with a non-zero residual the cost is flat to rounding over a distance of 1e-8, so the lowest cost is a
    /// matter of luck there; the later iterate of a descent method has the smaller gradient.
    pub fn settle(&mut self, theta: &[f64], cost: f64) {
        let near = cost <= self.best_cost * (1.0 + COST_ROUNDING);
        let violation = if near { self.violation(theta) } else { f64::INFINITY };
        if near && violation <= self.best_violation.max(FEASIBILITY_TOLERANCE) {
            self.keep(theta, cost, violation);
        }
    }

    /// Return the largest violation of bounds and general constraints at `theta`, 0 when there are none.
    pub fn violation(&mut self, theta: &[f64]) -> f64 {
        if !self.constrained {
            return 0.0;
        }
        let mut worst = 0.0_f64;
        if let Some(bounds) = self.problem.bounds() {
            for ((value, low), high) in theta.iter().zip(&bounds.lower).zip(&bounds.upper) {
                worst = worst.max(low - value).max(value - high);
            }
        }
        if let Some(constraints) = self.problem.constraints() {
            constraints.values(theta, &mut self.constraint_values);
            let num_equalities = constraints.num_equalities();
            for (i, value) in self.constraint_values.iter().enumerate() {
                let excess = if i < num_equalities { value.abs() } else { (-value).max(0.0) };
                worst = if excess.is_nan() { f64::INFINITY } else { worst.max(excess) };
            }
        }
        worst
    }

    /// Check cancel flag, deadline and evaluation limit before the next evaluation.
    ///
    /// # Errors
    /// The [`End`] of the solve when one of them says stop.
    pub fn check_limits(&self) -> Result<(), End> {
        if self.control.cancel.is_some_and(|flag| flag.load(Ordering::Relaxed)) {
            return Err(End::new(Status::Cancelled, "the cancel flag was raised"));
        }
        let limit = self.control.stopping.max_evaluations;
        if self.counts.residuals >= limit {
            return Err(End::new(Status::MaxEvaluations, format!("limit of {limit} evaluations reached")));
        }
        match self.control.stopping.deadline {
            Some(deadline) if self.began.elapsed() >= deadline => {
                Err(End::new(Status::Deadline, format!("deadline of {:.3} s passed", deadline.as_secs_f64())))
            }
            _ => Ok(()),
        }
    }

    /// Run another solver within this solve: on this or on a derived problem, within the budgets that are left, with the same
    /// cancel flag, observer and trace. Its counts are added to ours; its best point is not taken over (see
    /// [`Session::adopt`]), since its problem may be another one.
    ///
    /// # Errors
    /// The [`End`] of this solve when a limit is reached, before or during the inner solve.
    pub fn delegate(
        &mut self,
        solver: &dyn Solver,
        problem: &dyn LeastSquares,
        start: &[f64],
        seed: u64,
        adjust: impl FnOnce(&mut Stopping),
    ) -> Result<(Outcome, Option<End>), End> {
        self.check_limits()?;
        let mut stopping = self.control.stopping.clone();
        adjust(&mut stopping);
        stopping.max_evaluations = self.control.stopping.max_evaluations - self.counts.residuals;
        stopping.max_iterations = self.control.stopping.max_iterations.saturating_sub(self.counts.iterations);
        stopping.deadline = stopping.deadline.map(|limit| limit.saturating_sub(self.began.elapsed()));
        let before = self.counts;
        let mut shifted = self.control.observer.as_deref_mut().map(|observer| Shifted { observer, before });
        let mut control = Control {
            stopping,
            seed,
            cancel: self.control.cancel,
            observer: shifted.as_mut().map(|s| s as &mut dyn Observer),
            trace: self.control.trace,
        };
        let mut outcome = solver
            .solve(problem, start, &mut control)
            .map_err(|error| End::new(Status::NumericalFailure, format!("`{}`: {error}", solver.name())))?;
        self.counts.iterations += outcome.counts.iterations;
        self.counts.residuals += outcome.counts.residuals;
        self.counts.jacobians += outcome.counts.jacobians;
        self.counts.curvatures += outcome.counts.curvatures;
        if !outcome.gradient_norm.is_nan() {
            self.gradient_norm = outcome.gradient_norm;
        }
        self.trace.extend(outcome.trace.drain(..).map(|row| shift(&row, before)));
        let limit = matches!(
            outcome.status,
            Status::MaxEvaluations | Status::MaxIterations | Status::Deadline | Status::Cancelled
        );
        let end = limit.then(|| match self.next_limit() {
            Some(end) => end,
            None => End::new(outcome.status, outcome.message.clone()),
        });
        Ok((outcome, end))
    }

    /// Say which limit is reached, if one is.
    fn next_limit(&self) -> Option<End> {
        let limit = self.control.stopping.max_iterations;
        let iterations = (self.counts.iterations >= limit)
            .then(|| End::new(Status::MaxIterations, format!("limit of {limit} iterations reached")));
        self.check_limits().err().or(iterations)
    }

    /// Offer a point that an inner solve evaluated, with its cost in this problem.
    pub fn adopt(&mut self, theta: &[f64], cost: f64) {
        self.offer(theta, cost);
    }

    /// Compare a point with the best one: lower cost among feasible points, lower violation otherwise.
    fn offer(&mut self, theta: &[f64], cost: f64) {
        if !cost.is_finite() {
            return;
        }
        let violation = self.violation(theta);
        let better = match (violation <= FEASIBILITY_TOLERANCE, self.best_violation <= FEASIBILITY_TOLERANCE) {
            (true, true) => cost < self.best_cost,
            (true, false) => true,
            (false, true) => false,
            (false, false) => violation < self.best_violation,
        };
        if better {
            self.keep(theta, cost, violation);
        }
    }

    fn keep(&mut self, theta: &[f64], cost: f64, violation: f64) {
        self.best.copy_from_slice(theta);
        self.best_cost = cost;
        self.best_violation = violation;
    }

    fn close(mut self, end: End) -> Outcome {
        let End { mut status, mut message } = end;
        // A solve that was stopped before its first evaluation still reports the cost of its start.
        if self.counts.residuals == 0 && self.control.stopping.max_evaluations > 0 {
            let mut residual = vec![0.0; self.problem.num_residuals()];
            self.counts.residuals = 1;
            self.problem.residual(&self.best, &mut residual);
            let (theta, cost) = (self.best.clone(), self.cost_of(&residual));
            self.offer(&theta, cost);
        }
        if !self.best_cost.is_finite() && status.usable() && self.counts.residuals > 0 {
            message = format!("no point with a finite cost was found ({}: {message})", status.name());
            status = Status::NumericalFailure;
        }
        Outcome {
            theta: self.best,
            cost: self.best_cost,
            violation: self.best_violation,
            status,
            message,
            gradient_norm: self.gradient_norm,
            counts: self.counts,
            seconds: self.began.elapsed().as_secs_f64(),
            trace: self.trace,
        }
    }
}
