//! The conformance suite: every solver x every failure, the same for all.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use num_dual::DualNum;

use super::Witness;
use crate::auto::{AutoFunction, AutoProblem};
use crate::manifold::Euclidean;
use crate::observe::Observer;
use crate::outcome::{Outcome, Status, TraceRow};
use crate::problem::{LeastSquares, half_squared_norm};
use crate::session::unsupported;
use crate::solver::{Control, SolveError, Solver};
use crate::testproblems::Rosenbrock;
use crate::testproblems::pose::Alignment;

/// The verdict on one case.
#[derive(Debug, Clone, PartialEq)]
pub struct Finding {
    /// Name of the case.
    pub case: &'static str,
    /// What is wrong; nothing when the case is passed.
    pub problem: Option<String>,
}

/// Name of a case and what runs it.
type Case = (&'static str, fn(&dyn Solver) -> Result<(), String>);

/// Run a solver through every case: values that are not finite, a rank-deficient Jacobian, a start at the solution, zero
/// residual, an infeasible start, budgets, deadline, cancelling, misuse, counts, best point, repetition bit for bit, and a
/// pose on its manifold.
///
/// Solvers that use random numbers or no Jacobian are held to looser distances from the optimum, to nothing else.
///
/// ```
/// use cfpose_optim::{check, solvers};
/// let solver = solvers::build("levenberg-marquardt").unwrap();
/// for finding in check::conformance(solver.as_ref()) {
///     assert_eq!(finding.problem, None, "{}", finding.case);
/// }
/// ```
pub fn conformance(solver: &dyn Solver) -> Vec<Finding> {
    let cases: &[Case] = &[
        ("wrong start", wrong_start),
        ("NaN in the residual everywhere", nan_everywhere),
        ("NaN in the residual away from the start", nan_beyond),
        ("NaN in the Jacobian", nan_jacobian),
        ("rank-deficient Jacobian", rank_deficient),
        ("more parameters than residuals", wide),
        ("no parameters", no_parameters),
        ("start at the solution", start_at_solution),
        ("zero residual at the start", zero_residual),
        ("infeasible start, bounds", infeasible_bounds),
        ("infeasible start, constraint", infeasible_constraint),
        ("immediate cancel", immediate_cancel),
        ("deadline of zero", no_time),
        ("budget of one evaluation", one_evaluation),
        ("budget of one iteration", one_iteration),
        ("no tolerances", no_tolerances),
        ("same seed, same trace", repeatable),
        ("observer sees the trace", observed),
        ("pose in closed form", pose),
    ];
    cases.iter().map(|(case, run)| Finding { case, problem: run(solver).err() }).collect()
}

/// Residuals of the synthetic cases.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Synthetic {
    /// NaN at every point.
    Nan,
    /// (x - 0.6, y - 0.1, 1), NaN outside the unit square around the start (0.9, 0.3).
    NanBeyond,
    /// Depends on x + y only.
    Dependent,
    /// A line of solutions.
    Wide,
    /// (x - 3, y + 1, x + y - 1): one solution, residual not 0.
    Linear,
    /// (y - x^2, x - 2 y + 1) with a unit offset, for bounds.
    Curved,
}

impl AutoFunction for Synthetic {
    fn num_values(&self) -> usize {
        if *self == Synthetic::Wide { 1 } else { 3 }
    }

    fn values<T: DualNum<Primitive = f64> + Copy>(&self, theta: &[T], r: &mut [T]) {
        let (x, y) = (theta[0], theta[1]);
        let outside = (x.re() - 0.9).abs() > 0.5 || (y.re() - 0.3).abs() > 0.5;
        match self {
            Synthetic::Nan => r.fill(T::from(f64::NAN)),
            Synthetic::NanBeyond if outside => r.fill(T::from(f64::NAN)),
            Synthetic::NanBeyond => r.copy_from_slice(&[x - 0.6, y - 0.1, T::from(1.0)]),
            Synthetic::Dependent => r.copy_from_slice(&[x + y - 3.0, (x + y) * 2.0 - 1.0, (x + y).powi(2) * 0.1]),
            Synthetic::Wide => r[0] = (x + y * 2.0 - 1.0).exp() - 2.0,
            Synthetic::Linear => r.copy_from_slice(&[x - 3.0, y + 1.0, x + y - 1.0]),
            Synthetic::Curved => r.copy_from_slice(&[y - x * x, x - y * 2.0 + 1.0, T::from(1.0)]),
        }
    }
}

impl Synthetic {
    fn problem(self) -> AutoProblem<Synthetic> {
        AutoProblem::new(self, Arc::new(Euclidean(2)))
    }
}

/// The unit circle as an equality.
struct Circle;

impl AutoFunction for Circle {
    fn num_values(&self) -> usize {
        1
    }
    fn values<T: DualNum<Primitive = f64> + Copy>(&self, theta: &[T], values: &mut [T]) {
        values[0] = theta[0] * theta[0] + theta[1] * theta[1] - 1.0;
    }
}

/// A problem with a finite residual and a Jacobian of NaN.
struct BadJacobian(AutoProblem<Synthetic>);

impl LeastSquares for BadJacobian {
    fn manifold(&self) -> &dyn crate::manifold::Manifold {
        self.0.manifold()
    }
    fn num_residuals(&self) -> usize {
        self.0.num_residuals()
    }
    fn residual(&self, theta: &[f64], residual: &mut [f64]) {
        self.0.residual(theta, residual);
    }
    fn jacobian(&self, theta: &[f64], residual: &mut [f64], jacobian: &mut [f64]) {
        self.0.residual(theta, residual);
        jacobian.fill(f64::NAN);
    }
}

/// A problem without parameters.
struct Constant;

impl AutoFunction for Constant {
    fn num_values(&self) -> usize {
        2
    }
    fn values<T: DualNum<Primitive = f64> + Copy>(&self, _theta: &[T], values: &mut [T]) {
        values.fill(T::from(1.0));
    }
}

/// Budgets that let slow but right solvers finish.
fn generous() -> Control<'static> {
    let mut control = Control { seed: 7, trace: true, ..Control::default() };
    control.stopping.max_iterations = 20_000;
    control.stopping.max_evaluations = 100_000;
    control
}

/// Return how far above the optimum a solver may end: derivatives reach rounding, samples do not.
fn excess(solver: &dyn Solver) -> f64 {
    match solver.needs() {
        needs if needs.random && !needs.jacobian => 1e-4,
        needs if !needs.jacobian => 1e-6,
        _ => 1e-7,
    }
}

fn require(condition: bool, message: impl Fn() -> String) -> Result<(), String> {
    if condition { Ok(()) } else { Err(message()) }
}

/// Solve, and hold the outcome against what the problem saw: counts, cost at theta, best point, budget.
fn solve(
    solver: &dyn Solver,
    problem: &dyn LeastSquares,
    start: &[f64],
    control: &mut Control<'_>,
) -> Result<Outcome, String> {
    let witness = Witness::new(problem);
    let outcome = solver.solve(&witness, start, control).map_err(|e| format!("refused a good start: {e}"))?;
    let (seen, told) = (witness.counts(), outcome.counts);
    let same = (seen.residuals, seen.jacobians, seen.curvatures) == (told.residuals, told.jacobians, told.curvatures);
    require(same, || format!("counted {told:?}, made {seen:?}"))?;
    require(told.residuals <= control.stopping.max_evaluations.max(1), || "overran its budget".to_string())?;
    require(outcome.theta.len() == start.len(), || "theta has the wrong length".to_string())?;
    require(outcome.theta.iter().all(|v| v.is_finite()), || format!("theta is {:?}", outcome.theta))?;
    require(!outcome.message.is_empty(), || "no message".to_string())?;
    let least = witness.least_cost();
    require(!least.is_finite() || outcome.cost <= least * (1.0 + 1e-13) + 1e-300, || {
        format!("lost the best point: saw {least:e}, returned {:e}", outcome.cost)
    })?;
    if outcome.cost.is_finite() {
        let mut residual = vec![0.0; problem.num_residuals()];
        problem.residual(&outcome.theta, &mut residual);
        let cost = half_squared_norm(&residual);
        require((cost - outcome.cost).abs() <= 1e-14 * cost, || {
            format!("cost {:e} is not the cost at theta, {cost:e}", outcome.cost)
        })?;
    }
    let needless = outcome.status == Status::Unsupported && unsupported("", solver.needs(), problem).is_none();
    require(!needless, || format!("calls the problem unsupported: {}", outcome.message))?;
    Ok(outcome)
}

/// Say whether the pair of solver and problem fits; if not, check that it is reported.
fn skipped(solver: &dyn Solver, problem: &dyn LeastSquares, start: &[f64]) -> Result<bool, String> {
    if unsupported(solver.name(), solver.needs(), problem).is_none() {
        return Ok(false);
    }
    let outcome = solve(solver, problem, start, &mut generous())?;
    require(outcome.status == Status::Unsupported && outcome.theta == start, || {
        format!("an unsupported pair ends with {}", outcome.status.name())
    })?;
    Ok(true)
}

fn expect_cost(solver: &dyn Solver, outcome: &Outcome, optimum: f64) -> Result<(), String> {
    let limit = optimum * (1.0 + excess(solver)) + 1e-2 * excess(solver);
    require(outcome.usable() && outcome.cost <= limit, || {
        format!(
            "cost {:e} where {optimum:e} can be reached ({}: {})",
            outcome.cost,
            outcome.status.name(),
            outcome.message
        )
    })
}

fn expect_status(outcome: &Outcome, allowed: &[Status]) -> Result<(), String> {
    require(allowed.contains(&outcome.status), || format!("ends with {}: {}", outcome.status.name(), outcome.message))
}

fn wrong_start(solver: &dyn Solver) -> Result<(), String> {
    let short = solver.solve(&Rosenbrock, &[1.0], &mut Control::default());
    require(short == Err(SolveError::StartLength { expected: 2, found: 1 }), || format!("{short:?}"))?;
    let nan = solver.solve(&Rosenbrock, &[1.0, f64::NAN], &mut Control::default());
    require(matches!(nan, Err(SolveError::StartNotFinite { index: 1, .. })), || format!("{nan:?}"))
}

fn nan_everywhere(solver: &dyn Solver) -> Result<(), String> {
    let start = [0.9, 0.3];
    let outcome = solve(solver, &Synthetic::Nan.problem(), &start, &mut Control::default())?;
    expect_status(&outcome, &[Status::NumericalFailure])?;
    require(outcome.theta == start && !outcome.usable(), || format!("{outcome:?}"))
}

fn nan_beyond(solver: &dyn Solver) -> Result<(), String> {
    let outcome = solve(solver, &Synthetic::NanBeyond.problem(), &[0.9, 0.3], &mut generous())?;
    expect_cost(solver, &outcome, 0.5)
}

fn nan_jacobian(solver: &dyn Solver) -> Result<(), String> {
    let problem = BadJacobian(Synthetic::Linear.problem());
    if skipped(solver, &problem, &[0.0, 0.0])? {
        return Ok(());
    }
    let outcome = solve(solver, &problem, &[0.0, 0.0], &mut generous())?;
    require(outcome.cost.is_finite() && outcome.cost <= 5.5, || format!("lost the finite start: {outcome:?}"))?;
    if solver.needs().jacobian { expect_status(&outcome, &[Status::NumericalFailure]) } else { Ok(()) }
}

fn rank_deficient(solver: &dyn Solver) -> Result<(), String> {
    let outcome = solve(solver, &Synthetic::Dependent.problem(), &[0.3, -0.8], &mut generous())?;
    // With s = x + y: minimum of 1/2 ((s - 3)^2 + (2 s - 1)^2 + 0.01 s^4) at the root of 0.02 s^3 + 5 s = 5.
    let s = 0.996_035_507_917_264_8_f64;
    let optimum = 0.5 * ((s - 3.0).powi(2) + (2.0 * s - 1.0).powi(2) + 0.01 * s.powi(4));
    expect_cost(solver, &outcome, optimum)
}

fn wide(solver: &dyn Solver) -> Result<(), String> {
    let outcome = solve(solver, &Synthetic::Wide.problem(), &[0.0, 0.0], &mut generous())?;
    expect_cost(solver, &outcome, 0.0)
}

fn no_parameters(solver: &dyn Solver) -> Result<(), String> {
    let problem = AutoProblem::new(Constant, Arc::new(Euclidean(0)));
    let outcome = solve(solver, &problem, &[], &mut Control::default())?;
    require(outcome.cost == 1.0 && outcome.usable(), || format!("{outcome:?}"))
}

fn start_at_solution(solver: &dyn Solver) -> Result<(), String> {
    let start = [8.0 / 3.0, -4.0 / 3.0];
    let outcome = solve(solver, &Synthetic::Linear.problem(), &start, &mut generous())?;
    require(outcome.status.converged(), || format!("ends with {}: {}", outcome.status.name(), outcome.message))?;
    let moved = outcome.theta.iter().zip(&start).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    require(moved < 1e-6, || format!("left the solution by {moved:e}"))
}

fn zero_residual(solver: &dyn Solver) -> Result<(), String> {
    let outcome = solve(solver, &Rosenbrock, &[1.0, 1.0], &mut generous())?;
    expect_status(&outcome, &[Status::ZeroResidual])?;
    require(outcome.theta == [1.0, 1.0] && outcome.cost == 0.0, || format!("{outcome:?}"))?;
    require(outcome.counts.residuals <= 8, || format!("{} evaluations to see a zero", outcome.counts.residuals))
}

fn infeasible_bounds(solver: &dyn Solver) -> Result<(), String> {
    let problem = Synthetic::Curved.problem().with_bounds(&[-0.5, 0.25], &[0.2, 4.0]);
    if skipped(solver, &problem, &[-3.0, 9.0])? {
        return Ok(());
    }
    let outcome = solve(solver, &problem, &[-3.0, 9.0], &mut generous())?;
    require(outcome.violation <= 1e-8, || format!("violation {:e}", outcome.violation))?;
    // At x = -1/2 and y = 1/4 both varying residuals vanish.
    expect_cost(solver, &outcome, 0.5)
}

fn infeasible_constraint(solver: &dyn Solver) -> Result<(), String> {
    let problem = Synthetic::Linear.problem().with_constraints(Circle, 1);
    if skipped(solver, &problem, &[2.0, 2.0])? {
        return Ok(());
    }
    let outcome = solve(solver, &problem, &[2.0, 2.0], &mut generous())?;
    require(outcome.violation <= 1e-7, || format!("violation {:e}", outcome.violation))?;
    let mut optimum = f64::INFINITY;
    for k in 0..200_000 {
        let angle = k as f64 * std::f64::consts::TAU / 200_000.0;
        let (y, x) = angle.sin_cos();
        optimum = optimum.min(half_squared_norm(&[x - 3.0, y + 1.0, x + y - 1.0]));
    }
    expect_cost(solver, &outcome, optimum)
}

fn immediate_cancel(solver: &dyn Solver) -> Result<(), String> {
    let flag = AtomicBool::new(true);
    let mut control = Control { cancel: Some(&flag), ..Control::default() };
    let outcome = solve(solver, &Rosenbrock, &[-1.2, 1.0], &mut control)?;
    expect_status(&outcome, &[Status::Cancelled])?;
    let kept = outcome.theta == [-1.2, 1.0] && outcome.cost.is_finite() && outcome.counts.residuals <= 1;
    require(kept, || format!("{outcome:?}"))
}

fn no_time(solver: &dyn Solver) -> Result<(), String> {
    let mut control = Control::default();
    control.stopping.deadline = Some(Duration::ZERO);
    let outcome = solve(solver, &Rosenbrock, &[-1.2, 1.0], &mut control)?;
    expect_status(&outcome, &[Status::Deadline])?;
    require(outcome.cost.is_finite(), || format!("{outcome:?}"))
}

fn one_evaluation(solver: &dyn Solver) -> Result<(), String> {
    let mut control = Control::default();
    control.stopping.max_evaluations = 1;
    let outcome = solve(solver, &Rosenbrock, &[-1.2, 1.0], &mut control)?;
    expect_status(&outcome, &[Status::MaxEvaluations])?;
    require(outcome.cost.is_finite() && outcome.counts.residuals == 1, || format!("{outcome:?}"))?;
    // The one evaluation must be of the start: no other point is known to be worth it.
    require(outcome.theta == [-1.2, 1.0], || format!("{outcome:?}"))
}

fn one_iteration(solver: &dyn Solver) -> Result<(), String> {
    let mut control = Control::default();
    control.stopping.max_iterations = 1;
    let outcome = solve(solver, &Rosenbrock, &[-1.2, 1.0], &mut control)?;
    expect_status(&outcome, &[Status::MaxIterations])?;
    require(outcome.counts.iterations <= 1 && outcome.cost <= 12.1 + 1e-9, || format!("{outcome:?}"))
}

fn no_tolerances(solver: &dyn Solver) -> Result<(), String> {
    let mut control = Control::default();
    let stopping = &mut control.stopping;
    (stopping.gradient_tolerance, stopping.cost_tolerance) = (None, None);
    (stopping.step_tolerance, stopping.zero_cost) = (None, None);
    let outcome = solve(solver, &Synthetic::Linear.problem(), &[0.0, 0.0], &mut control)?;
    // Without tests nothing may be called converged.
    let allowed = [Status::MaxIterations, Status::MaxEvaluations, Status::Stalled];
    expect_status(&outcome, &allowed)
}

fn repeatable(solver: &dyn Solver) -> Result<(), String> {
    let run = || solve(solver, &Rosenbrock, &[-1.2, 1.0], &mut generous());
    let (a, b) = (run()?, run()?);
    require(!a.trace.is_empty(), || "no trace".to_string())?;
    let bits = |o: &Outcome| -> Vec<u64> {
        let rows = o.trace.iter().flat_map(|t| {
            [
                t.cost.to_bits(),
                t.gradient_norm.to_bits(),
                t.step_norm.to_bits(),
                t.damping.to_bits(),
                t.evaluations as u64,
            ]
        });
        rows.chain(o.theta.iter().map(|v| v.to_bits())).collect()
    };
    require(bits(&a) == bits(&b) && a.status == b.status && a.message == b.message, || "runs differ".to_string())
}

/// Collects what it is shown.
struct Collector(Vec<TraceRow>);

impl Observer for Collector {
    fn iteration(&mut self, row: &TraceRow, _theta: &[f64]) {
        self.0.push(row.clone());
    }
}

fn observed(solver: &dyn Solver) -> Result<(), String> {
    let mut collector = Collector(Vec::new());
    let mut control = Control { observer: Some(&mut collector), trace: true, ..Control::default() };
    let outcome = solver.solve(&Rosenbrock, &[-1.2, 1.0], &mut control).map_err(|e| e.to_string())?;
    // NaN marks what a solver has not: compare as text.
    let same = format!("{:?}", collector.0) == format!("{:?}", outcome.trace);
    require(same && !outcome.trace.is_empty(), || "observer and trace differ".to_string())?;
    let ordered = outcome.trace.windows(2).all(|w| w[0].evaluations <= w[1].evaluations);
    require(ordered && outcome.trace[0].accepted, || "the trace is not in order".to_string())
}

fn pose(solver: &dyn Solver) -> Result<(), String> {
    let points = Alignment::simulate(12, 0.6, 0.05, 3);
    let truth = points.closed_form().ok_or("no closed form")?;
    let problem = points.problem();
    let start = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0];
    let outcome = solve(solver, &problem, &start, &mut generous())?;
    let distance = outcome.theta.iter().zip(&truth).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    let limit = if solver.needs().random {
        1e-3
    } else if solver.needs().jacobian {
        1e-6
    } else {
        1e-5
    };
    require(distance < limit, || {
        format!("{distance:e} from the closed form ({}: {})", outcome.status.name(), outcome.message)
    })?;
    let mut projected = outcome.theta.clone();
    problem.manifold().project(&mut projected);
    let off = outcome.theta.iter().zip(&projected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    require(off < 1e-12, || format!("{off:e} off the manifold"))
}
