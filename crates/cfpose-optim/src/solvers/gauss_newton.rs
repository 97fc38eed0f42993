//! Gauss-Newton with step halving.

use crate::descent::region::gauss_newton;
use crate::descent::{Model, Proposal, Search, StepRule, accept, descend};
use crate::entry::ParameterSpec;
use crate::linear::Qr;
use crate::outcome::Outcome;
use crate::problem::LeastSquares;
use crate::session::run;
use crate::solver::{Control, Needs, SolveError, Solver, SolverEntry};

/// Minimise by steps `d = argmin norm(r + J d)`, the one of least scaled norm where J is rank deficient, shortened until the
/// cost falls: `d, shrink d, shrink^2 d, ...`.
///
/// Fast and without a parameter near a good start; a singular Jacobian on the way stops it where Levenberg-Marquardt goes on.
///
/// Source: Bjorck, Numerical Methods for Least Squares Problems (1996), section 9.2; rank decision by faer's SVD.
///
/// ```
/// use cfpose_optim::solvers::GaussNewton;
/// use cfpose_optim::testproblems::Rosenbrock;
/// use cfpose_optim::{Control, Solver};
/// let outcome = GaussNewton::default().solve(&Rosenbrock, &[-1.2, 1.0], &mut Control::default()).unwrap();
/// assert!((outcome.theta[0] - 1.0).abs() < 1e-12);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GaussNewton {
    /// Factor of the step length after a rejected trial.
    pub shrink: f64,
    /// A trial with a gain ratio above this is accepted.
    pub accept: f64,
}

impl Default for GaussNewton {
    fn default() -> Self {
        Self { shrink: 0.5, accept: 1e-4 }
    }
}

impl Solver for GaussNewton {
    fn name(&self) -> &'static str {
        ENTRY.name
    }

    fn needs(&self) -> Needs {
        Needs { jacobian: true, bounds: true, ..Needs::default() }
    }

    fn solve(
        &self,
        problem: &dyn LeastSquares,
        start: &[f64],
        control: &mut Control<'_>,
    ) -> Result<Outcome, SolveError> {
        run(self.name(), self.needs(), problem, start, control, |session, start| {
            descend(session, start, &mut FullStep::default(), &mut Halving(*self))
        })
    }
}

/// The Gauss-Newton step times the control number.
#[derive(Debug, Default)]
struct FullStep {
    qr: Qr,
    newton: Vec<f64>,
}

impl StepRule for FullStep {
    fn prepare(&mut self, model: &Model) {
        self.qr.factorise(model.rows, model.cols, &model.jacobian, &model.residual);
        self.newton.resize(model.cols, 0.0);
        gauss_newton(model, &mut self.qr, &mut self.newton);
    }

    fn step(&mut self, model: &Model, length: f64, step: &mut [f64]) -> Option<Proposal> {
        for (d, n) in step.iter_mut().zip(&self.newton) {
            *d = length * n;
        }
        // -g'd = norm(J n)^2 for the full step n.
        let predicted = length * (1.0 - 0.5 * length) * self.qr.image_squared(&self.newton);
        let full = length == 1.0;
        step.iter().all(|d| d.is_finite()).then(|| Proposal { predicted, scaled_norm: model.scaled_norm(step), full })
    }
}

struct Halving(GaussNewton);

impl Search for Halving {
    fn begin(&mut self, _model: &Model, _scaled_start: f64) -> f64 {
        1.0
    }

    fn judge(&mut self, length: &mut f64, gain_ratio: f64, _proposal: Option<Proposal>) -> bool {
        let accepted = gain_ratio > self.0.accept;
        *length = if accepted { 1.0 } else { *length * self.0.shrink };
        accepted
    }
}

/// The line of the solver table.
pub const ENTRY: SolverEntry = SolverEntry {
    name: "gauss-newton",
    summary: "Gauss-Newton with step halving and a rank decision",
    parameters: &[
        ParameterSpec { name: "shrink", default: "0.5", meaning: "factor of a rejected step, 0 < . < 1" },
        ParameterSpec {
            name: "accept",
            default: "1e-4",
            meaning: "least gain ratio of an accepted trial, 0 <= . < 1/4",
        },
    ],
    source: "Bjorck 1996",
    build: |parameters| {
        Ok(Box::new(GaussNewton {
            shrink: parameters.number("shrink", "a number between 0 and 1", |v| v > 0.0 && v < 1.0)?,
            accept: accept(parameters)?,
        }))
    },
};
