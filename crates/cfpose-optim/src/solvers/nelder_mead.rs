//! Nelder-Mead by argmin.

use argmin::core::State;
use argmin::solver::neldermead::NelderMead as Method;

use crate::argmin_drive::{Operator, Patience, Plain, current, drive};
use crate::entry::ParameterSpec;
use crate::outcome::Outcome;
use crate::problem::LeastSquares;
use crate::session::run;
use crate::solver::{Control, Needs, SolveError, Solver, SolverEntry};
use crate::tangent::{Frame, Round, rounds};

/// Minimise by a simplex over tangent coordinates, restarted with a smaller simplex at the best point until a restart brings
/// nothing. Needs no derivative.
///
/// Source: Nelder and Mead, A simplex method for function minimization, Comput. J. 7 (1965); back-end argmin.
///
/// ```
/// use cfpose_optim::{Control, solvers, testproblems::Rosenbrock};
/// let solver = solvers::build("nelder-mead").unwrap();
/// let outcome = solver.solve(&Rosenbrock, &[-1.2, 1.0], &mut Control::default()).unwrap();
/// assert!((outcome.theta[0] - 1.0).abs() < 1e-6 && outcome.counts.jacobians == 0);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NelderMead {
    /// Edge of the first simplex relative to the size of theta.
    pub edge: f64,
}

impl Solver for NelderMead {
    fn name(&self) -> &'static str {
        ENTRY.name
    }

    fn needs(&self) -> Needs {
        Needs::default()
    }

    fn solve(
        &self,
        problem: &dyn LeastSquares,
        start: &[f64],
        control: &mut Control<'_>,
    ) -> Result<Outcome, SolveError> {
        run(self.name(), self.needs(), problem, start, control, |session, start| {
            rounds(session, start, false, |frame, index| self.round(frame, index))
        })
    }
}

impl NelderMead {
    fn round(&self, frame: &Frame<'_, '_, '_>, index: usize) -> Round {
        // Every second restart is wider again: a simplex may have collapsed into a subspace.
        let edge = self.edge * [1.0, 0.1, 0.3, 0.01][index % 4];
        let mut simplex = vec![vec![0.0; frame.size]];
        for (j, extent) in frame.extent().into_iter().enumerate() {
            let mut corner = vec![0.0; frame.size];
            corner[j] = edge * extent;
            simplex.push(corner);
        }
        let tolerance = f64::EPSILON * frame.base_cost();
        let Ok(mut method) = Method::new(simplex).with_sd_tolerance(tolerance) else { return Round::Decisive };
        let patience = Patience { iterations: 400 * frame.size, without_gain: 60 * frame.size, own_end: true };
        let operator = Operator { frame, lenient: true, joint: false, moves: None };
        drive(operator, &mut method, Plain::new(), patience, current);
        Round::Decisive
    }
}

/// The line of the solver table.
pub const ENTRY: SolverEntry = SolverEntry {
    name: "nelder-mead",
    summary: "Nelder-Mead simplex with restarts, no derivatives (argmin)",
    parameters: &[ParameterSpec {
        name: "edge",
        default: "0.1",
        meaning: "edge of the first simplex relative to the size of theta, > 0",
    }],
    source: "Nelder and Mead 1965; argmin 0.11",
    build: |parameters| {
        let edge = parameters.number("edge", "a number above 0", |v| v.is_finite() && v > 0.0)?;
        Ok(Box::new(NelderMead { edge }))
    },
};
