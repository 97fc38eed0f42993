//! L-BFGS by argmin.

use argmin::core::State;
use argmin::solver::linesearch::MoreThuenteLineSearch;
use argmin::solver::quasinewton::LBFGS;

use crate::argmin_drive::{First, Operator, Patience, current, drive, round_length};
use crate::entry::ParameterSpec;
use crate::outcome::Outcome;
use crate::problem::LeastSquares;
use crate::session::run;
use crate::solver::{Control, Needs, SolveError, Solver, SolverEntry};
use crate::tangent::{Frame, Round, rounds};

/// Minimise by the limited-memory BFGS method with More-Thuente line searches, over tangent coordinates scaled by the column
/// norms of the Jacobian; restarted at the best point until a restart brings nothing.
///
/// Source: Liu and Nocedal, On the limited memory BFGS method, Math. Program. 45 (1989); back-end argmin.
///
/// ```
/// use cfpose_optim::{Control, solvers, testproblems::Rosenbrock};
/// let solver = solvers::build("l-bfgs").unwrap();
/// let outcome = solver.solve(&Rosenbrock, &[-1.2, 1.0], &mut Control::default()).unwrap();
/// assert!((outcome.theta[0] - 1.0).abs() < 1e-7, "{outcome:?}");
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LBfgs {
    /// Number of remembered steps.
    pub memory: usize,
}

impl Solver for LBfgs {
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

impl LBfgs {
    fn round(&self, frame: &Frame<'_, '_, '_>) -> Round {
        let zero = vec![0.0; frame.size];
        let state = First::new().param(zero).cost(frame.base_cost()).gradient(frame.base_gradient());
        let line_search = MoreThuenteLineSearch::new();
        let method =
            LBFGS::new(line_search, self.memory).with_tolerance_grad(0.0).and_then(|m| m.with_tolerance_cost(0.0));
        let Ok(mut method) = method else { return Round::Decisive };
        let patience = Patience { iterations: round_length(frame), without_gain: 3, own_end: false };
        let operator = Operator { frame, lenient: false, joint: true, moves: None };
        drive(operator, &mut method, state, patience, current);
        Round::Decisive
    }
}

/// The line of the solver table.
pub const ENTRY: SolverEntry = SolverEntry {
    name: "l-bfgs",
    summary: "limited-memory BFGS with More-Thuente line search (argmin)",
    parameters: &[ParameterSpec { name: "memory", default: "7", meaning: "number of remembered steps, 1 to 100" }],
    source: "Liu and Nocedal 1989; argmin 0.11",
    build: |parameters| Ok(Box::new(LBfgs { memory: parameters.count("memory", 1, 100)? })),
};
