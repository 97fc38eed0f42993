//! Gauss-Newton along equality constraints by null-space steps.

use crate::constrained::{ConstrainedStep, Local, Loss, minimise};
use crate::descent::region::Exact;
use crate::descent::{Model, StepRule};
use crate::entry::ParameterSpec;
use crate::linear::NullSpace;
use crate::outcome::{Outcome, Status};
use crate::problem::LeastSquares;
use crate::session::{End, run};
use crate::solver::{Control, Needs, SolveError, Solver, SolverEntry};

/// Minimise subject to equalities: steps `min norm(r + J d)` with `c + A d = 0` and `norm(D d) <= radius`, found in the null
/// space of A, retracted and moved back onto the constraints.
///
/// Treats no bounds and no inequalities (see `clarabel`).
///
/// Source: Bjorck, Numerical Methods for Least Squares Problems (1996), section 5.1; loop as in
/// Conn, Gould and Toint (2000), chapter 15.
///
/// ```
/// use cfpose_optim::{Control, solvers, testproblems::hock_schittkowski};
/// let hs42 = &hock_schittkowski::all()[4];
/// let solver = solvers::build("null-space").unwrap();
/// let outcome = solver.solve(hs42.problem.as_ref(), &hs42.start, &mut Control::default()).unwrap();
/// assert!((2.0 * outcome.cost - (28.0 - 10.0 * 2.0_f64.sqrt())).abs() < 1e-8 && outcome.violation < 1e-10);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NullSpaceGaussNewton {
    /// First radius relative to the scaled size of theta.
    pub initial_radius: f64,
}

impl Solver for NullSpaceGaussNewton {
    fn name(&self) -> &'static str {
        ENTRY.name
    }

    fn needs(&self) -> Needs {
        Needs { jacobian: true, constraints: true, ..Needs::default() }
    }

    fn solve(
        &self,
        problem: &dyn LeastSquares,
        start: &[f64],
        control: &mut Control<'_>,
    ) -> Result<Outcome, SolveError> {
        run(self.name(), self.needs(), problem, start, control, |session, start| {
            if problem.constraints().is_some_and(|c| c.num_inequalities() > 0) {
                let why = "skipped: `null-space` treats equalities only; use `clarabel` or `augmented-lagrangian`";
                return Ok(End::new(Status::Unsupported, why));
            }
            minimise(session, start, Loss::Squares, self.initial_radius, &mut Step::default())
        })
    }
}

/// The step in scaled coordinates x = D d, where the region is a ball in the null space too.
#[derive(Debug, Default)]
struct Step {
    space: NullSpace,
    exact: Exact,
    reduced: Model,
}

impl ConstrainedStep for Step {
    fn step(&mut self, local: &Local, radius: f64, step: &mut [f64]) -> Option<bool> {
        let (model, constraints) = (&local.model, &local.constraints);
        let (rows, m, p) = (model.rows, model.cols, constraints.num_equalities);
        let unscale = |matrix: &[f64]| -> Vec<f64> {
            matrix.iter().enumerate().map(|(at, v)| v / model.scaling[at % m.max(1)]).collect()
        };
        let (jacobian, rows_a) = (unscale(&model.jacobian), unscale(&constraints.jacobian[..p * m]));
        self.space.reduce(rows, m, &jacobian, &model.residual, p, &rows_a, &constraints.values[..p]);
        let free = m - self.space.rank();
        let fixed = self.space.particular_squared();
        if fixed >= radius * radius {
            return None;
        }
        let reduced = &mut self.reduced;
        *reduced = Model::new(rows, free);
        reduced.residual.copy_from_slice(self.space.residual());
        reduced.jacobian.copy_from_slice(self.space.jacobian());
        reduced.update_gradient();
        self.exact.prepare(reduced);
        let mut z = vec![0.0; free];
        let full = self.exact.step(reduced, (radius * radius - fixed).sqrt(), &mut z)?.full;
        self.space.expand(&z, step);
        step.iter_mut().zip(&model.scaling).for_each(|(d, s)| *d /= s);
        Some(full)
    }
}

/// The line of the solver table.
pub const ENTRY: SolverEntry = SolverEntry {
    name: "null-space",
    summary: "Gauss-Newton along equality constraints by null-space steps in a trust region",
    parameters: &[ParameterSpec {
        name: "initial-radius",
        default: "1",
        meaning: "first radius relative to the scaled size of theta, > 0",
    }],
    source: "Bjorck 1996; Conn, Gould and Toint 2000",
    build: |parameters| {
        let initial_radius = parameters.number("initial-radius", "a number above 0", |v| v.is_finite() && v > 0.0)?;
        Ok(Box::new(NullSpaceGaussNewton { initial_radius }))
    },
};
