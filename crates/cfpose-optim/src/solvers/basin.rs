//! The methods of the crate `basin`.

use ::basin::{
    Bobyqa, BoundedCmaEs, BoundedLevenbergMarquardt, CmaEs, DenseMatrix, Lbfgsb, LevenbergMarquardt, Slsqp,
    TrustRegionReflective,
};

use crate::basin_drive::{Operator, Pace, drive};
use crate::entry::ParameterSpec;
use crate::outcome::{Outcome, Status};
use crate::problem::LeastSquares;
use crate::session::{End, run};
use crate::solver::{Control, Needs, SolveError, Solver, SolverEntry};
use crate::tangent::{Frame, Round, rounds};

/// First width of searches without derivatives, in sizes of theta, and of the rounds that confirm their end.
const WIDTHS: [f64; 2] = [0.5, 1e-3];
/// Width at which such a search is over.
const NARROW: f64 = 1e-9;
/// Generations of CMA-ES without gain before a round is over.
const PATIENT: usize = 60;

/// Which method of basin.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BasinMethod {
    /// Levenberg-Marquardt with MINPACK's damping and pivoted QR.
    LevenbergMarquardt,
    /// Levenberg-Marquardt within bounds.
    BoundedLevenbergMarquardt,
    /// Trust region reflective within bounds (Branch, Coleman and Li 1999; SciPy's variant).
    TrustRegionReflective,
    /// L-BFGS-B (Byrd, Lu, Nocedal and Zhu 1995).
    LBfgsB,
    /// SLSQP (Kraft 1988), with bounds alone.
    Slsqp,
    /// BOBYQA (Powell 2009), without derivatives.
    Bobyqa,
    /// CMA-ES (Hansen), without derivatives.
    CmaEs,
}

/// Minimise by a method of the crate `basin`, over tangent coordinates around the start, and again around the best point until a
/// restart brings nothing. Bounds are respected on vector spaces; general constraints are not treated.
///
/// Source: basin 3.2 and the references of its pages.
///
/// ```
/// use cfpose_optim::{Control, solvers, testproblems::Rosenbrock};
/// for method in ["levenberg-marquardt", "trust-region-reflective", "l-bfgs-b"] {
///     let solver = solvers::build(&format!("basin[method={method}]")).unwrap();
///     let outcome = solver.solve(&Rosenbrock, &[-1.2, 1.0], &mut Control::default()).unwrap();
///     assert!((outcome.theta[0] - 1.0).abs() < 1e-6, "{method}: {outcome:?}");
/// }
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Basin {
    /// The method.
    pub method: BasinMethod,
}

impl Basin {
    fn searches(self) -> bool {
        matches!(self.method, BasinMethod::Bobyqa | BasinMethod::CmaEs)
    }

    /// Run one round and say what it means for the solve.
    fn round(self, frame: &Frame<'_, '_, '_>, index: usize) -> Round {
        let before = frame.base_cost();
        self.minimise(frame, index);
        if index == 0 {
            // The second round confirms the end of the first.
            return if self.searches() { Round::Wide } else { Round::Decisive };
        }
        // At a bound the gradient need not vanish, so that a round without gain is all that tells.
        let gain = (before - frame.best_cost()) / before;
        match frame.stopping().cost_tolerance {
            Some(limit) if frame.bounds().is_some() && gain <= limit => {
                let message = format!("a restarted round within the bounds lowers the cost by {gain:.3e} relative");
                Round::Over(End::new(Status::CostTolerance, message))
            }
            _ => Round::Decisive,
        }
    }

    /// Minimise from the base of the frame.
    fn minimise(self, frame: &Frame<'_, '_, '_>, index: usize) {
        let steps = if frame.is_flat_space() { 2000 } else { 40 };
        let (own, counted) = (Pace::smooth(steps, false), Pace::smooth(steps, true));
        match self.method {
            BasinMethod::LevenbergMarquardt => {
                let method = LevenbergMarquardt::<Vec<f64>, DenseMatrix<f64>>::new()
                    .with_absolute_gradient_tolerance(None)
                    .with_pivoted_qr();
                drive(Operator::smooth(frame), method, counted);
            }
            BasinMethod::BoundedLevenbergMarquardt => {
                let method = BoundedLevenbergMarquardt::<Vec<f64>, DenseMatrix<f64>>::new()
                    .with_absolute_scaled_gradient_tolerance(None);
                drive(Operator::smooth(frame), method, counted);
            }
            BasinMethod::TrustRegionReflective => {
                let method = TrustRegionReflective::new().with_absolute_scaled_gradient_tolerance(None);
                drive(Operator::smooth(frame), method, counted);
            }
            BasinMethod::LBfgsB => {
                let method = Lbfgsb::new()
                    .with_absolute_projected_gradient_tolerance(None)
                    .with_relative_cost_reduction_tolerance(None);
                drive(Operator::smooth(frame), method, own);
            }
            BasinMethod::Slsqp => {
                let method = Slsqp::new().with_absolute_accuracy_tolerance(None);
                drive(Operator::smooth(frame), method, own);
            }
            BasinMethod::Bobyqa => {
                let method = Bobyqa::new().with_initial_radius(WIDTHS[index.min(1)]).with_final_radius(NARROW);
                drive(Operator::searched(frame), method, Pace { steps: 20_000, without_gain: 20_000, counted: false });
            }
            BasinMethod::CmaEs => {
                let (seed, width) = (frame.seed().wrapping_add(index as u64), WIDTHS[index.min(1)]);
                let operator = Operator::searched(frame);
                let pace = Pace { steps: 20_000, without_gain: PATIENT, counted: false };
                if operator.is_bounded() {
                    let method = BoundedCmaEs::<Vec<f64>, DenseMatrix<f64>>::new(seed, width)
                        .with_absolute_distribution_size_tolerance(NARROW);
                    drive(operator, method, pace);
                } else {
                    let method = CmaEs::<Vec<f64>, DenseMatrix<f64>>::new(seed, width)
                        .with_absolute_distribution_size_tolerance(NARROW);
                    drive(operator, method, pace);
                }
            }
        }
    }
}

impl Solver for Basin {
    fn name(&self) -> &'static str {
        ENTRY.name
    }

    fn needs(&self) -> Needs {
        Needs {
            jacobian: !self.searches(),
            bounds: self.method != BasinMethod::LevenbergMarquardt,
            random: self.method == BasinMethod::CmaEs,
            ..Needs::default()
        }
    }

    fn solve(
        &self,
        problem: &dyn LeastSquares,
        start: &[f64],
        control: &mut Control<'_>,
    ) -> Result<Outcome, SolveError> {
        run(self.name(), self.needs(), problem, start, control, |session, start| {
            let manifold = problem.manifold();
            if problem.bounds().is_some() && manifold.ambient() != manifold.tangent() {
                let message = "treats bounds on vector spaces alone, and theta is no vector";
                return Err(End::new(Status::Unsupported, message));
            }
            let mut inside = start.to_vec();
            if let Some(bounds) = problem.bounds() {
                let limits = bounds.lower.iter().zip(&bounds.upper);
                inside.iter_mut().zip(limits).for_each(|(x, (low, high))| *x = x.max(*low).min(*high));
            }
            rounds(session, &inside, !self.searches(), |frame, index| self.round(frame, index))
        })
    }
}

/// The line of the solver table.
pub const ENTRY: SolverEntry = SolverEntry {
    name: "basin",
    summary: "methods of the crate basin: Levenberg-Marquardt, trust region reflective, L-BFGS-B, SLSQP, BOBYQA, CMA-ES",
    parameters: &[ParameterSpec {
        name: "method",
        default: "trust-region-reflective",
        meaning: "levenberg-marquardt, bounded-levenberg-marquardt, trust-region-reflective, l-bfgs-b, slsqp, bobyqa or cma-es; all but the first within bounds",
    }],
    source: "basin 3.2",
    build: |parameters| {
        let method = parameters.choice(
            "method",
            &[
                ("levenberg-marquardt", BasinMethod::LevenbergMarquardt),
                ("bounded-levenberg-marquardt", BasinMethod::BoundedLevenbergMarquardt),
                ("trust-region-reflective", BasinMethod::TrustRegionReflective),
                ("l-bfgs-b", BasinMethod::LBfgsB),
                ("slsqp", BasinMethod::Slsqp),
                ("bobyqa", BasinMethod::Bobyqa),
                ("cma-es", BasinMethod::CmaEs),
            ],
        )?;
        Ok(Box::new(Basin { method }))
    },
};
