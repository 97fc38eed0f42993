//! Sequential convex programming with Clarabel.

use crate::constrained::{ConstrainedStep, Local, Loss, minimise};
use crate::entry::ParameterSpec;
use crate::outcome::Outcome;
use crate::problem::LeastSquares;
use crate::session::run;
use crate::solver::{Control, Needs, SolveError, Solver, SolverEntry};

mod program;

pub use program::{ConeProblem, ConeStep};

/// Minimise subject to equalities, inequalities and bounds by steps
/// `min sum_i loss(r_i + J_i d)` with `c + A d = 0`, `h + G d >= 0`, `norm(D d) <= radius`,
/// each a second-order cone program, retracted and moved back onto the constraints.
///
/// * One solver object lives through a solve; its data are updated, its structure never changes.
/// * The program is posed in units in which step and residual are of order 1, so that its accuracy is relative to the step,
///   and over the triangle of J, so that the condition of J is not squared.
/// * `AlmostSolved` and `InsufficientProgress` count as a failed step and shrink the region.
/// * Bounds may lie on any ambient coordinate, also of a curved factor.
///
/// Source: Goulart and Chen, Clarabel: an interior-point solver for conic programs with quadratic objectives (2024); loop as
/// in Conn, Gould and Toint (2000), chapter 15.
///
/// ```
/// use cfpose_optim::{Control, solvers, testproblems::hock_schittkowski};
/// let hs42 = &hock_schittkowski::all()[4];
/// let solver = solvers::build("clarabel").unwrap();
/// let outcome = solver.solve(hs42.problem.as_ref(), &hs42.start, &mut Control::default()).unwrap();
/// assert!((2.0 * outcome.cost - (28.0 - 10.0 * 2.0_f64.sqrt())).abs() < 1e-8 && outcome.violation < 1e-10);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Clarabel {
    /// What is summed over the residuals.
    pub loss: Loss,
    /// First radius relative to the scaled size of theta.
    pub initial_radius: f64,
}

impl Solver for Clarabel {
    fn name(&self) -> &'static str {
        ENTRY.name
    }

    fn needs(&self) -> Needs {
        Needs { jacobian: true, bounds: true, constraints: true, ..Needs::default() }
    }

    fn solve(
        &self,
        problem: &dyn LeastSquares,
        start: &[f64],
        control: &mut Control<'_>,
    ) -> Result<Outcome, SolveError> {
        run(self.name(), self.needs(), problem, start, control, |session, start| {
            let mut rule = ConeStep::new(self.loss);
            minimise(session, start, self.loss, self.initial_radius, &mut rule)
        })
    }
}

impl ConstrainedStep for ConeStep {
    fn step(&mut self, local: &Local, radius: f64, step: &mut [f64]) -> Option<bool> {
        let (model, constraints) = (&local.model, &local.constraints);
        let problem = ConeProblem {
            rows: model.rows,
            cols: model.cols,
            residual: &model.residual,
            jacobian: &model.jacobian,
            gradient: &model.gradient,
            num_equalities: constraints.num_equalities,
            values: &constraints.values,
            constraints: &constraints.jacobian,
            scaling: &model.scaling,
        };
        self.solve(&problem, radius, step)
    }
}

/// The line of the solver table.
pub const ENTRY: SolverEntry = SolverEntry {
    name: "clarabel",
    summary: "sequential second-order cone programs: equalities, inequalities, bounds, robust losses (Clarabel)",
    parameters: &[
        ParameterSpec {
            name: "loss",
            default: "squares",
            meaning: "squares, l1 or huber; the cost of the outcome is its sum",
        },
        ParameterSpec { name: "scale", default: "1", meaning: "residual at which the loss huber turns linear, > 0" },
        ParameterSpec {
            name: "initial-radius",
            default: "1",
            meaning: "first radius relative to the scaled size of theta, > 0",
        },
    ],
    source: "Goulart and Chen 2024; Conn, Gould and Toint 2000; clarabel 0.11",
    build: |parameters| {
        let positive = |v: f64| v.is_finite() && v > 0.0;
        let scale = parameters.number("scale", "a number above 0", positive)?;
        let losses = [("squares", Loss::Squares), ("l1", Loss::Absolute), ("huber", Loss::Huber { scale })];
        Ok(Box::new(Clarabel {
            loss: parameters.choice("loss", &losses)?,
            initial_radius: parameters.number("initial-radius", "a number above 0", positive)?,
        }))
    },
};
