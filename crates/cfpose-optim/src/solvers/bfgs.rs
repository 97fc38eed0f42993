//! BFGS by argmin.

use argmin::core::State;
use argmin::solver::linesearch::{HagerZhangLineSearch, MoreThuenteLineSearch};
use argmin::solver::quasinewton::BFGS;

use crate::argmin_drive::{Operator, Patience, Second, current, drive, round_length};
use crate::entry::ParameterSpec;
use crate::outcome::Outcome;
use crate::problem::LeastSquares;
use crate::session::run;
use crate::solver::{Control, Needs, SolveError, Solver, SolverEntry};
use crate::tangent::{Frame, Round, rounds};

/// Minimise by the BFGS method with More-Thuente or Hager-Zhang line searches, over tangent coordinates scaled by the column norms of the
/// Jacobian; restarted at the best point until a restart brings nothing.
///
/// Source: Nocedal and Wright, Numerical Optimization (2006), chapter 6; Hager and Zhang, ACM TOMS 32 (2006); back-end argmin.
///
/// ```
/// use cfpose_optim::{Control, solvers, testproblems::Rosenbrock};
/// let solver = solvers::build("bfgs").unwrap();
/// let outcome = solver.solve(&Rosenbrock, &[-1.2, 1.0], &mut Control::default()).unwrap();
/// assert!((outcome.theta[0] - 1.0).abs() < 1e-7, "{outcome:?}");
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Bfgs {
    /// Line search.
    pub line_search: LineSearch,
}

/// Line searches of argmin.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LineSearch {
    /// More and Thuente 1994.
    MoreThuente,
    /// Hager and Zhang 2006; argmin's first bracket is fixed, which overflows on stiff problems.
    HagerZhang,
}

impl Solver for Bfgs {
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

impl Bfgs {
    fn round(&self, frame: &Frame<'_, '_, '_>) -> Round {
        let zero = vec![0.0; frame.size];
        let state = Second::new().param(zero).cost(frame.base_cost()).gradient(frame.base_gradient());
        let identity = |i: usize| (0..frame.size).map(|j| f64::from(u8::from(i == j))).collect();
        let state = state.inv_hessian((0..frame.size).map(identity).collect());
        let patience = Patience { iterations: round_length(frame), without_gain: 3, own_end: false };
        let operator = Operator { frame, lenient: false, joint: true, moves: None };
        match self.line_search {
            LineSearch::MoreThuente => {
                drive(operator, &mut BFGS::new(MoreThuenteLineSearch::new()), state, patience, current);
            }
            LineSearch::HagerZhang => {
                drive(operator, &mut BFGS::new(HagerZhangLineSearch::new()), state, patience, current);
            }
        }
        Round::Decisive
    }
}

/// The line of the solver table.
pub const ENTRY: SolverEntry = SolverEntry {
    name: "bfgs",
    summary: "BFGS with More-Thuente or Hager-Zhang line search (argmin)",
    parameters: &[ParameterSpec {
        name: "line-search",
        default: "more-thuente",
        meaning: "more-thuente or hager-zhang",
    }],
    source: "Nocedal and Wright 2006; Hager and Zhang 2006; argmin 0.11",
    build: |parameters| {
        let choices = [("more-thuente", LineSearch::MoreThuente), ("hager-zhang", LineSearch::HagerZhang)];
        Ok(Box::new(Bfgs { line_search: parameters.choice("line-search", &choices)? }))
    },
};
