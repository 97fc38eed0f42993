//! A trust region with Steihaug steps by argmin.

use argmin::core::State;
use argmin::solver::trustregion::{Steihaug, TrustRegion};

use crate::argmin_drive::{Operator, Patience, Second, current, drive, round_length};
use crate::outcome::Outcome;
use crate::problem::LeastSquares;
use crate::session::run;
use crate::solver::{Control, Needs, SolveError, Solver, SolverEntry};
use crate::tangent::{Frame, Round, rounds};

/// Minimise by argmin's trust region with Steihaug steps and the Gauss-Newton Hessian, over tangent coordinates scaled by the
/// column norms of the Jacobian. It never ends by itself: the frame does that.
///
/// Source: Nocedal and Wright, Numerical Optimization (2006), chapter 4; Steihaug (1983); back-end argmin.
///
/// ```
/// use cfpose_optim::{Control, solvers, testproblems::Rosenbrock};
/// let solver = solvers::build("argmin-trust-region").unwrap();
/// let outcome = solver.solve(&Rosenbrock, &[-1.2, 1.0], &mut Control::default()).unwrap();
/// assert!((outcome.theta[0] - 1.0).abs() < 1e-7, "{outcome:?}");
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ArgminTrustRegion;

impl Solver for ArgminTrustRegion {
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

impl ArgminTrustRegion {
    fn round(&self, frame: &Frame<'_, '_, '_>) -> Round {
        let zero = vec![0.0; frame.size];
        let state = Second::new().param(zero).cost(frame.base_cost()).gradient(frame.base_gradient());
        let extent = frame.extent();
        let radius = extent.iter().map(|e| e * e).sum::<f64>().sqrt();
        let method = TrustRegion::new(Steihaug::new().with_max_iters(10 * frame.size as u64));
        let method = method.with_max_radius(1e3 * radius).and_then(|m| m.with_radius(radius));
        let Ok(mut method) = method else { return Round::Decisive };
        let patience = Patience { iterations: round_length(frame), without_gain: 25, own_end: false };
        let operator = Operator { frame, lenient: true, joint: true, moves: None };
        drive(operator, &mut method, state, patience, current);
        Round::Decisive
    }
}

/// The line of the solver table.
pub const ENTRY: SolverEntry = SolverEntry {
    name: "argmin-trust-region",
    summary: "trust region with Steihaug steps and the Gauss-Newton Hessian (argmin)",
    parameters: &[],
    source: "Nocedal and Wright 2006; Steihaug 1983; argmin 0.11",
    build: |_| Ok(Box::new(ArgminTrustRegion)),
};
