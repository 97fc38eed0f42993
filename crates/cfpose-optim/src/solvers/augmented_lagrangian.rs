//! Constraints by weighted residual rows: augmented Lagrangian and pure penalty around any unconstrained solver.

use std::sync::{Mutex, PoisonError};

use crate::constraint::{Bounds, Constraints};
use crate::descent::TangentBox;
use crate::entry::{EntryError, ParameterSpec, Parameters};
use crate::manifold::Manifold;
use crate::outcome::{Outcome, Status};
use crate::problem::{Capabilities, LeastSquares, half_squared_norm};
use crate::session::{End, FEASIBILITY_TOLERANCE, Session, run};
use crate::solver::{Control, Needs, SolveError, Solver, SolverEntry, build_inner};

/// Minimise subject to equalities, inequalities and bounds by a sequence of problems without general constraints,
/// `1/2 norm(r)^2 + weight / 2 * sum (c + y / weight)^2`, whose extra terms are rows of the residual: any solver does.
///
/// With multipliers (`augmented-lagrangian`): `y <- y + weight c` after each inner solve, and a tenfold weight where the
/// violation has not fallen to a quarter. Without (`penalty`): y = 0 and a tenfold weight each time, until the violation is
/// below 1e-8. Inequalities `h >= 0` enter as `max(0, y / weight - h)`; bounds go to the inner solver if it takes them.
///
/// Source: Nocedal and Wright, Numerical Optimization (2006), chapter 17.
///
/// ```
/// use cfpose_optim::{Control, solvers, testproblems::hock_schittkowski};
/// let hs42 = &hock_schittkowski::all()[4];
/// let solver = solvers::build("augmented-lagrangian[solver=trust-region]").unwrap();
/// let outcome = solver.solve(hs42.problem.as_ref(), &hs42.start, &mut Control::default()).unwrap();
/// assert!((2.0 * outcome.cost - (28.0 - 10.0 * 2.0_f64.sqrt())).abs() < 1e-6 && outcome.violation < 1e-8);
/// ```
pub struct Penalised {
    /// Solver of the inner problems.
    pub inner: Box<dyn Solver>,
    /// First weight, relative to the mean squared norm of the columns of J.
    pub weight: f64,
    /// Whether multipliers are kept.
    pub multipliers: bool,
}

impl Solver for Penalised {
    fn name(&self) -> &'static str {
        if self.multipliers { AUGMENTED.name } else { PENALTY.name }
    }

    fn needs(&self) -> Needs {
        let inner = self.inner.needs();
        Needs { bounds: true, constraints: true, ..inner }
    }

    fn solve(
        &self,
        problem: &dyn LeastSquares,
        start: &[f64],
        control: &mut Control<'_>,
    ) -> Result<Outcome, SolveError> {
        run(self.name(), self.needs(), problem, start, control, |session, start| self.sequence(session, start))
    }
}

/// Inner solves at most.
const PASSES: usize = 40;

impl Penalised {
    fn sequence(&self, session: &mut Session<'_, '_>, start: &[f64]) -> Result<End, End> {
        let problem = session.problem();
        let mut rows = Rows::new(problem, self.inner.needs().bounds, start);
        if rows.num_rows() == 0 {
            let (outcome, end) = session.delegate(self.inner.as_ref(), problem, start, session.seed(), |_| {})?;
            session.adopt(&outcome.theta, outcome.cost);
            return Ok(end.unwrap_or(End::new(outcome.status, outcome.message)));
        }
        rows.state.weight = self.weight * rows.scale(start);
        let mut theta = start.to_vec();
        let mut violation = rows.violation(start);
        for pass in 0..PASSES {
            let (outcome, end) = session
                .delegate(self.inner.as_ref(), &rows, &theta, session.seed(), |stopping| stopping.zero_cost = None)?;
            if let Some((best, cost)) = rows.take_best() {
                session.adopt(&best, cost);
            }
            if let Some(end) = end {
                return Err(end);
            }
            if !outcome.usable() {
                return Ok(End::new(outcome.status, outcome.message));
            }
            theta.clone_from(&outcome.theta);
            let (before, now) = (violation, rows.violation(&theta));
            let settled = !self.multipliers || rows.multiplier_change(&theta) <= 1e-7;
            if now <= FEASIBILITY_TOLERANCE && (settled || pass + 1 == PASSES) {
                session.settle(&theta, rows.original_cost(&theta));
                let message =
                    format!("violation {now:.3e} after {} inner solves; the last: {}", pass + 1, outcome.message);
                return Ok(End::new(outcome.status, message));
            }
            if self.multipliers {
                rows.update_multipliers(&theta);
            }
            if !self.multipliers || now > (0.25 * before).max(1e-2 * FEASIBILITY_TOLERANCE) {
                rows.state.weight *= 10.0;
            }
            violation = now;
            if !rows.state.weight.is_finite() {
                break;
            }
        }
        Ok(End::new(Status::Stalled, format!("violation {violation:.3e} is left after {PASSES} inner solves")))
    }
}

/// Multipliers and weight.
#[derive(Debug, Clone)]
struct Multipliers {
    weight: f64,
    values: Vec<f64>,
}

/// The problem with constraints as residual rows.
struct Rows<'p> {
    inner: &'p dyn LeastSquares,
    num_equalities: usize,
    num_general: usize,
    /// Bounds that become rows: ambient index, side, bound.
    bound_rows: Vec<(usize, f64, f64)>,
    pass_bounds: bool,
    state: Multipliers,
    /// Least cost at a feasible point, with the point.
    best: Mutex<Option<(Vec<f64>, f64)>>,
}

impl<'p> Rows<'p> {
    fn new(inner: &'p dyn LeastSquares, solver_takes_bounds: bool, start: &[f64]) -> Self {
        let (num_equalities, num_general) =
            inner.constraints().map_or((0, 0), |c| (c.num_equalities(), c.num_equalities() + c.num_inequalities()));
        // Bounds on curved coordinates are beyond the inner solvers.
        let straight = inner.bounds().is_some_and(|b| TangentBox::new(b, inner.manifold(), start, 0).is_ok());
        let pass_bounds = solver_takes_bounds && straight;
        let mut bound_rows = Vec::new();
        if let (false, Some(b)) = (pass_bounds, inner.bounds()) {
            for i in 0..b.lower.len().min(b.upper.len()) {
                bound_rows.extend(b.lower[i].is_finite().then_some((i, 1.0, b.lower[i])));
                bound_rows.extend(b.upper[i].is_finite().then_some((i, -1.0, b.upper[i])));
            }
        }
        let values = vec![0.0; num_general + bound_rows.len()];
        let state = Multipliers { weight: 1.0, values };
        Self { inner, num_equalities, num_general, bound_rows, pass_bounds, state, best: Mutex::new(None) }
    }

    fn num_rows(&self) -> usize {
        self.state.values.len()
    }

    /// Return the mean squared column norm of the Jacobian at the start, 1 where there is none: the unit of the weight.
    fn scale(&self, theta: &[f64]) -> f64 {
        let m = self.inner.manifold().tangent();
        let rows = self.inner.num_residuals();
        if !self.inner.capabilities().jacobian || m == 0 {
            return 1.0;
        }
        // One constraint Jacobian and one residual Jacobian outside the budget would be a miscount: use the constraints only.
        let (mut values, mut jacobian) = (vec![0.0; self.num_rows()], vec![0.0; self.num_rows() * m]);
        self.constraint_jacobian(theta, &mut values, &mut jacobian);
        let square: f64 = jacobian.iter().map(|a| a * a).sum::<f64>() / self.num_rows().max(1) as f64;
        let scale = rows.max(1) as f64 / square;
        if scale.is_finite() && scale > 0.0 { scale } else { 1.0 }
    }

    fn constraint_values(&self, theta: &[f64], values: &mut [f64]) {
        if let Some(constraints) = self.inner.constraints() {
            constraints.values(theta, &mut values[..self.num_general]);
        }
        for (value, (i, side, bound)) in values[self.num_general..].iter_mut().zip(&self.bound_rows) {
            *value = side * (theta[*i] - bound);
        }
    }

    fn constraint_jacobian(&self, theta: &[f64], values: &mut [f64], jacobian: &mut [f64]) {
        let (n, m) = (self.inner.manifold().ambient(), self.inner.manifold().tangent());
        if let Some(constraints) = self.inner.constraints() {
            let g = self.num_general;
            constraints.jacobian(theta, &mut values[..g], &mut jacobian[..g * m]);
        }
        self.constraint_values(theta, values);
        if self.bound_rows.is_empty() {
            return;
        }
        let mut basis = vec![0.0; n * m];
        self.inner.manifold().basis(theta, &mut basis);
        for (k, (i, side, _)) in self.bound_rows.iter().enumerate() {
            let row = &mut jacobian[(self.num_general + k) * m..(self.num_general + k + 1) * m];
            row.iter_mut().zip(&basis[i * m..(i + 1) * m]).for_each(|(r, b)| *r = side * b);
        }
    }

    /// Turn a constraint value into its row before the root of the weight, and say whether it varies.
    fn row(&self, i: usize, value: f64) -> (f64, f64) {
        let shift = self.state.values[i] / self.state.weight;
        if i < self.num_equalities {
            (value + shift, 1.0)
        } else if shift - value > 0.0 {
            (shift - value, -1.0)
        } else {
            (0.0, 0.0)
        }
    }

    fn violation(&self, theta: &[f64]) -> f64 {
        let mut values = vec![0.0; self.num_rows()];
        self.constraint_values(theta, &mut values);
        let excess = |(i, v): (usize, &f64)| if i < self.num_equalities { v.abs() } else { (-v).max(0.0) };
        values.iter().enumerate().map(excess).fold(0.0, f64::max)
    }

    fn next_multipliers(&self, theta: &[f64]) -> Vec<f64> {
        let mut values = vec![0.0; self.num_rows()];
        self.constraint_values(theta, &mut values);
        values.iter().enumerate().map(|(i, v)| self.state.weight * self.row(i, *v).0).collect()
    }

    fn update_multipliers(&mut self, theta: &[f64]) {
        self.state.values = self.next_multipliers(theta);
    }

    /// Return by how much the multipliers would still change, relative to their size.
    fn multiplier_change(&self, theta: &[f64]) -> f64 {
        let next = self.next_multipliers(theta);
        let size = next.iter().fold(1e-12_f64, |a, y| a.max(y.abs()));
        next.iter().zip(&self.state.values).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) / size
    }

    fn original_cost(&self, theta: &[f64]) -> f64 {
        match &*self.best.lock().unwrap_or_else(PoisonError::into_inner) {
            Some((best, cost)) if best == theta => *cost,
            _ => f64::INFINITY,
        }
    }

    fn take_best(&self) -> Option<(Vec<f64>, f64)> {
        self.best.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Remember a feasible point of least cost in the original problem; before there is one, the point itself.
    fn note(&self, theta: &[f64], residual: &[f64]) {
        let cost = half_squared_norm(residual);
        if !cost.is_finite() {
            return;
        }
        let mut best = self.best.lock().unwrap_or_else(PoisonError::into_inner);
        let (violation, known) = (self.violation(theta), best.as_ref().map(|(at, cost)| (self.violation(at), *cost)));
        let better = match known {
            None => true,
            Some((old, old_cost)) => match (violation <= FEASIBILITY_TOLERANCE, old <= FEASIBILITY_TOLERANCE) {
                (true, true) => cost < old_cost,
                (true, false) => true,
                (false, true) => false,
                (false, false) => violation < old,
            },
        };
        if better {
            *best = Some((theta.to_vec(), cost));
        }
    }
}

impl LeastSquares for Rows<'_> {
    fn manifold(&self) -> &dyn Manifold {
        self.inner.manifold()
    }
    fn num_residuals(&self) -> usize {
        self.inner.num_residuals() + self.num_rows()
    }
    fn residual(&self, theta: &[f64], residual: &mut [f64]) {
        let (own, extra) = residual.split_at_mut(self.inner.num_residuals());
        self.inner.residual(theta, own);
        self.note(theta, own);
        let root = self.state.weight.sqrt();
        self.constraint_values(theta, extra);
        for (i, value) in extra.iter_mut().enumerate() {
            *value = root * self.row(i, *value).0;
        }
    }
    fn jacobian(&self, theta: &[f64], residual: &mut [f64], jacobian: &mut [f64]) {
        let (rows, m) = (self.inner.num_residuals(), self.manifold().tangent());
        let (own, extra) = residual.split_at_mut(rows);
        let (own_jacobian, extra_jacobian) = jacobian.split_at_mut(rows * m);
        self.inner.jacobian(theta, own, own_jacobian);
        self.note(theta, own);
        let root = self.state.weight.sqrt();
        self.constraint_jacobian(theta, extra, extra_jacobian);
        for (i, value) in extra.iter_mut().enumerate() {
            let (row, slope) = self.row(i, *value);
            *value = root * row;
            extra_jacobian[i * m..(i + 1) * m].iter_mut().for_each(|a| *a *= root * slope);
        }
    }
    fn curvature(&self, theta: &[f64], weights: &[f64], hessian: &mut [f64]) {
        let (own, extra) = weights.split_at(self.inner.num_residuals());
        self.inner.curvature(theta, own, hessian);
        let Some(constraints) = self.inner.constraints() else { return };
        let mut values = vec![0.0; self.num_rows()];
        self.constraint_values(theta, &mut values);
        let root = self.state.weight.sqrt();
        let bent: Vec<f64> = extra.iter().enumerate().map(|(i, w)| root * self.row(i, values[i]).1 * w).collect();
        let mut added = vec![0.0; hessian.len()];
        constraints.curvature(theta, &bent[..self.num_general], &mut added);
        hessian.iter_mut().zip(&added).for_each(|(h, a)| *h += a);
    }
    fn capabilities(&self) -> Capabilities {
        let offered = self.inner.capabilities();
        let general = self.inner.constraints().is_none_or(|c| c.has_curvature());
        // Bounds on curved coordinates bend along the retraction in a way that is not at hand.
        Capabilities { curvature: offered.curvature && general && self.bound_rows.is_empty(), ..offered }
    }
    fn bounds(&self) -> Option<&Bounds> {
        if self.pass_bounds { self.inner.bounds() } else { None }
    }
    fn constraints(&self) -> Option<&dyn Constraints> {
        None
    }
}

const PARAMETERS: &[ParameterSpec] = &[
    ParameterSpec {
        name: "solver",
        default: "levenberg-marquardt",
        meaning: "solver of the inner problems, with its own parameters in brackets",
    },
    ParameterSpec {
        name: "weight",
        default: "10",
        meaning: "first weight relative to the scale of the constraints, > 0",
    },
];

/// The line of the solver table for the augmented Lagrangian.
pub const AUGMENTED: SolverEntry = SolverEntry {
    name: "augmented-lagrangian",
    summary: "constraints and bounds by multipliers and weighted rows around any solver",
    parameters: PARAMETERS,
    source: "Nocedal and Wright 2006",
    build: |parameters| build(parameters, true),
};

/// The line of the solver table for the penalty method.
pub const PENALTY: SolverEntry = SolverEntry {
    name: "penalty",
    summary: "constraints and bounds by growing weighted rows around any solver",
    parameters: PARAMETERS,
    source: "Nocedal and Wright 2006",
    build: |parameters| build(parameters, false),
};

fn build(parameters: &Parameters, multipliers: bool) -> Result<Box<dyn Solver>, EntryError> {
    let inner = build_inner(parameters, "solver")?;
    let weight = parameters.number("weight", "a number above 0", |v| v.is_finite() && v > 0.0)?;
    Ok(Box::new(Penalised { inner, weight, multipliers }))
}
