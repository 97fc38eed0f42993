//! MINPACK's Levenberg-Marquardt by the crate `levenberg-marquardt`.

use ::levenberg_marquardt::{LeastSquaresProblem, LevenbergMarquardt, TerminationReason};
use nalgebra034::storage::Owned;
use nalgebra034::{DMatrix, DVector, Dyn};

use crate::entry::ParameterSpec;
use crate::outcome::{Outcome, Status};
use crate::problem::LeastSquares;
use crate::session::{End, run};
use crate::solver::{Control, Needs, SolveError, Solver, SolverEntry};
use crate::tangent::{Frame, Round, guarded, rounds};

/// Minimise by the Rust port of MINPACK's `lmder`, over tangent coordinates around the start, and again around the best
/// point until a restart brings nothing (on a vector space one restart confirms the end).
///
/// The scaling is MINPACK's own (running maximum of the column norms), its tolerances are those of
/// [`crate::Stopping`] (`ftol`, `xtol`, `gtol`), switched off where those are.
///
/// Source: More, Garbow and Hillstrom, User guide for MINPACK-1 (1980); back-end `levenberg-marquardt`.
///
/// ```
/// use cfpose_optim::{Control, solvers, testproblems::Rosenbrock};
/// let solver = solvers::build("minpack").unwrap();
/// let outcome = solver.solve(&Rosenbrock, &[-1.2, 1.0], &mut Control::default()).unwrap();
/// assert!((outcome.theta[0] - 1.0).abs() < 1e-12);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Minpack {
    /// First radius relative to the scaled size of the step coordinates (`factor` of MINPACK).
    pub step_bound: f64,
}

impl Solver for Minpack {
    fn name(&self) -> &'static str {
        ENTRY.name
    }

    fn needs(&self) -> Needs {
        Needs { jacobian: true, ..Needs::default() }
    }

    fn solve(
        &self,
        problem: &dyn LeastSquares,
        start: &[f64],
        control: &mut Control<'_>,
    ) -> Result<Outcome, SolveError> {
        run(self.name(), self.needs(), problem, start, control, |session, start| {
            rounds(session, start, true, |frame, _| self.round(frame))
        })
    }
}

impl Minpack {
    fn round(&self, frame: &Frame<'_, '_, '_>) -> Round {
        let stopping = frame.stopping();
        let method = LevenbergMarquardt::new()
            .with_ftol(stopping.cost_tolerance.unwrap_or(0.0).max(0.0))
            .with_xtol(stopping.step_tolerance.unwrap_or(0.0).max(0.0))
            .with_gtol(stopping.gradient_tolerance.unwrap_or(0.0).max(0.0))
            .with_stepbound(self.step_bound)
            .with_patience(1_000_000);
        let origin = frame.origin();
        let problem = Flat { frame, x: DVector::from_vec(origin.clone()), origin };
        let Some((_, report)) = guarded(|| method.minimize(problem)) else { return Round::Decisive };
        // The tests of MINPACK are the tests of `Stopping`: nothing to confirm.
        let status = match report.termination {
            TerminationReason::Orthogonal => Status::GradientTolerance,
            TerminationReason::Converged { ftol: true, .. } => Status::CostTolerance,
            TerminationReason::Converged { .. } => Status::StepTolerance,
            _ => return Round::Decisive,
        };
        Round::Over(End::new(status, format!("MINPACK's test held: {:?}", report.termination)))
    }
}

/// The problem as the back-end sees it; `x - origin` are the frame's coordinates.
struct Flat<'o, 'f, 's, 'a> {
    frame: &'o Frame<'f, 's, 'a>,
    x: DVector<f64>,
    origin: Vec<f64>,
}

impl Flat<'_, '_, '_, '_> {
    fn coordinates(&self) -> Vec<f64> {
        self.x.iter().zip(&self.origin).map(|(x, o)| x - o).collect()
    }
}

impl LeastSquaresProblem<f64, Dyn, Dyn> for Flat<'_, '_, '_, '_> {
    type ResidualStorage = Owned<f64, Dyn>;
    type JacobianStorage = Owned<f64, Dyn, Dyn>;
    type ParameterStorage = Owned<f64, Dyn>;

    fn set_params(&mut self, x: &DVector<f64>) {
        self.x.copy_from(x);
    }

    fn params(&self) -> DVector<f64> {
        self.x.clone()
    }

    fn residuals(&self) -> Option<DVector<f64>> {
        let mut residual = match self.frame.residual_and_jacobian(&self.coordinates()) {
            Some((residual, _)) => residual,
            None if self.frame.is_over() => return None,
            // A trial whose values are not finite is a failed one: the back-end would give up, a huge value makes it step back.
            None => vec![1e3 * (1.0 + (2.0 * self.frame.best_cost()).sqrt()); self.frame.num_residuals()],
        };
        // The back-end wants at least as many rows as columns.
        residual.resize(residual.len().max(self.x.len()), 0.0);
        Some(DVector::from_vec(residual))
    }

    fn jacobian(&self) -> Option<DMatrix<f64>> {
        let (residual, mut jacobian) = self.frame.residual_and_jacobian(&self.coordinates())?;
        let (rows, cols) = (residual.len().max(self.x.len()), self.x.len());
        jacobian.resize(rows * cols, 0.0);
        Some(DMatrix::from_row_slice(rows, cols, &jacobian))
    }
}

/// The line of the solver table.
pub const ENTRY: SolverEntry = SolverEntry {
    name: "minpack",
    summary: "MINPACK's Levenberg-Marquardt (crate levenberg-marquardt)",
    parameters: &[ParameterSpec {
        name: "step-bound",
        default: "100",
        meaning: "first radius relative to the scaled size of the coordinates (MINPACK's factor), > 0",
    }],
    source: "More, Garbow and Hillstrom 1980; levenberg-marquardt 0.15",
    build: |parameters| {
        let step_bound = parameters.number("step-bound", "a number above 0", |v| v.is_finite() && v > 0.0)?;
        Ok(Box::new(Minpack { step_bound }))
    },
};
