//! Nonlinear conjugate gradients by argmin.

use argmin::core::State;
use argmin::solver::conjugategradient::NonlinearConjugateGradient;
use argmin::solver::conjugategradient::beta::PolakRibierePlus;
use argmin::solver::linesearch::MoreThuenteLineSearch;

use crate::argmin_drive::{First, Operator, Patience, current, drive, round_length};
use crate::outcome::Outcome;
use crate::problem::LeastSquares;
use crate::session::run;
use crate::solver::{Control, Needs, SolveError, Solver, SolverEntry};
use crate::tangent::{Frame, Round, rounds};

/// Minimise by nonlinear conjugate gradients (Polak-Ribiere+) with More-Thuente line searches, over tangent coordinates scaled
/// by the column norms of the Jacobian; restarted every 2 m iterations, and at the best point until a restart brings nothing.
///
/// Source: Nocedal and Wright, Numerical Optimization (2006), chapter 5; back-end argmin.
///
/// ```
/// use cfpose_optim::{Control, solvers, testproblems::Rosenbrock};
/// let solver = solvers::build("nonlinear-cg").unwrap();
/// let outcome = solver.solve(&Rosenbrock, &[-1.2, 1.0], &mut Control::default()).unwrap();
/// assert!((outcome.theta[0] - 1.0).abs() < 1e-7, "{outcome:?}");
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NonlinearCg;

impl Solver for NonlinearCg {
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

impl NonlinearCg {
    fn round(&self, frame: &Frame<'_, '_, '_>) -> Round {
        let zero = vec![0.0; frame.size];
        let state = First::new().param(zero).cost(frame.base_cost()).gradient(frame.base_gradient());
        let line_search = MoreThuenteLineSearch::new().with_c(1e-4, 0.1);
        let Ok(line_search) = line_search else { return Round::Decisive };
        let mut method = NonlinearConjugateGradient::new(line_search, PolakRibierePlus::new())
            .restart_iters(2 * frame.size as u64)
            .restart_orthogonality(0.2);
        let patience = Patience { iterations: round_length(frame), without_gain: 3, own_end: false };
        let operator = Operator { frame, lenient: false, joint: true, moves: None };
        drive(operator, &mut method, state, patience, current);
        Round::Decisive
    }
}

/// The line of the solver table.
pub const ENTRY: SolverEntry = SolverEntry {
    name: "nonlinear-cg",
    summary: "nonlinear conjugate gradients, Polak-Ribiere+ with More-Thuente line search (argmin)",
    parameters: &[],
    source: "Nocedal and Wright 2006; argmin 0.11",
    build: |_| Ok(Box::new(NonlinearCg)),
};
