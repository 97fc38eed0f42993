//! Trust regions on manifolds with the Gauss-Newton model: dogleg, Steihaug's truncated conjugate gradients, exact step.

use crate::descent::region::{Exact, RadiusSearch, advance, conjugate_gradients, gauss_newton, proposal, to_boundary};
use crate::descent::{Model, Proposal, StepRule, accept, descend};
use crate::entry::{EntryError, ParameterSpec, Parameters};
use crate::linear::Qr;
use crate::outcome::Outcome;
use crate::problem::LeastSquares;
use crate::session::run;
use crate::solver::{Control, Needs, SolveError, Solver, SolverEntry};

/// How the step within the region is found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RegionStep {
    /// Along the path from the Cauchy point to the Gauss-Newton point (Powell 1970).
    Dogleg,
    /// Conjugate gradients cut off at the boundary (Steihaug 1983); no factorisation, for many columns.
    Steihaug,
    /// The minimiser on the region: damping by More's iteration on the secular equation (as MINPACK's `lmpar`).
    Exact,
}

/// Minimise by steps that minimise `norm(r + J d)^2` within `norm(D d) <= radius`, retracted onto the manifold.
///
/// * D is the scaling of [`crate::solvers::LevenbergMarquardt`].
/// * The first radius is `initial_radius * norm(D theta)` (`initial_radius` where that is 0), with the size of theta along
///   each tangent coordinate from [`crate::Manifold::extent`].
/// * A trial is accepted when `gain_ratio > accept`. The radius becomes `norm(D d) / 4` below a gain ratio of 1/4 and at
///   least `growth * norm(D d)` above 3/4.
/// * Stops by the inequalities of [`crate::Stopping`].
///
/// Sources: Powell, A hybrid method for nonlinear equations (1970); Steihaug, The conjugate gradient method and trust
/// regions in large scale optimization, SIAM J. Numer. Anal. 20 (1983); More (1978); Conn, Gould and Toint (2000).
///
/// ```
/// use cfpose_optim::solvers::{RegionStep, TrustRegion};
/// use cfpose_optim::testproblems::Rosenbrock;
/// use cfpose_optim::{Control, Solver};
/// for step in [RegionStep::Dogleg, RegionStep::Steihaug, RegionStep::Exact] {
///     let solver = TrustRegion { step, ..TrustRegion::default() };
///     let outcome = solver.solve(&Rosenbrock, &[-1.2, 1.0], &mut Control::default()).unwrap();
///     assert!((outcome.theta[0] - 1.0).abs() < 1e-9, "{step:?} {outcome:?}");
/// }
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrustRegion {
    /// How the step is found.
    pub step: RegionStep,
    /// First radius relative to the scaled size of theta.
    pub initial_radius: f64,
    /// Growth of the radius after a good trial.
    pub growth: f64,
    /// A trial with a gain ratio above this is accepted.
    pub accept: f64,
}

impl Default for TrustRegion {
    fn default() -> Self {
        Self { step: RegionStep::Exact, initial_radius: 1.0, growth: 2.0, accept: 1e-4 }
    }
}

impl Solver for TrustRegion {
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
            let mut search = RadiusSearch { initial: self.initial_radius, growth: self.growth, accept: self.accept };
            match self.step {
                RegionStep::Dogleg => descend(session, start, &mut Dogleg::default(), &mut search),
                RegionStep::Steihaug => descend(session, start, &mut Steihaug::default(), &mut search),
                RegionStep::Exact => descend(session, start, &mut Exact::default(), &mut search),
            }
        })
    }
}

/// Powell's dogleg.
#[derive(Debug, Default)]
struct Dogleg {
    qr: Qr,
    newton: Vec<f64>,
    cauchy: Vec<f64>,
}

impl StepRule for Dogleg {
    fn prepare(&mut self, model: &Model) {
        self.qr.factorise(model.rows, model.cols, &model.jacobian, &model.residual);
        self.newton.resize(model.cols, 0.0);
        gauss_newton(model, &mut self.qr, &mut self.newton);
        // Cauchy point: the minimum of the model along the steepest descent in scaled coordinates.
        self.cauchy.clear();
        self.cauchy.extend(model.gradient.iter().zip(&model.scaling).map(|(g, d)| -g / (d * d)));
        let slope = model.scaled_norm(&self.cauchy).powi(2);
        let length = slope / self.qr.image_squared(&self.cauchy);
        let length = if length.is_finite() { length } else { 0.0 };
        self.cauchy.iter_mut().for_each(|c| *c *= length);
    }

    fn step(&mut self, model: &Model, radius: f64, step: &mut [f64]) -> Option<Proposal> {
        let newton_norm = model.scaled_norm(&self.newton);
        let cauchy_norm = model.scaled_norm(&self.cauchy);
        if newton_norm <= radius {
            step.copy_from_slice(&self.newton);
        } else if cauchy_norm >= radius {
            step.fill(0.0);
            advance(step, radius / cauchy_norm, &self.cauchy);
        } else {
            step.copy_from_slice(&self.cauchy);
            let across: Vec<f64> = self.newton.iter().zip(&self.cauchy).map(|(n, c)| n - c).collect();
            let length = to_boundary(&model.scaling, &self.cauchy, &across, radius);
            advance(step, length, &across);
        }
        proposal(model, &self.qr, step, newton_norm <= radius)
    }
}

/// Steihaug's truncated conjugate gradients, preconditioned by the scaling.
#[derive(Debug, Default)]
struct Steihaug {
    qr: Qr,
}

impl StepRule for Steihaug {
    fn prepare(&mut self, model: &Model) {
        self.qr.factorise(model.rows, model.cols, &model.jacobian, &model.residual);
    }

    fn step(&mut self, model: &Model, radius: f64, step: &mut [f64]) -> Option<Proposal> {
        let qr = &self.qr;
        let inside = conjugate_gradients(model, radius, step, |p, out| qr.normal_product(p, out));
        proposal(model, qr, step, inside)
    }
}

/// The line of the solver table.
pub const ENTRY: SolverEntry = SolverEntry {
    name: "trust-region",
    summary: "trust region on manifolds with the Gauss-Newton model: dogleg, Steihaug-CG or exact steps",
    parameters: &[
        ParameterSpec { name: "step", default: "exact", meaning: "exact, dogleg or steihaug" },
        ParameterSpec {
            name: "initial-radius",
            default: "1",
            meaning: "first radius relative to the scaled size of theta, > 0",
        },
        ParameterSpec { name: "growth", default: "2", meaning: "growth of the radius after a good trial, > 1" },
        ParameterSpec {
            name: "accept",
            default: "1e-4",
            meaning: "least gain ratio of an accepted trial, 0 <= . < 1/4",
        },
    ],
    source: "Powell 1970; Steihaug 1983; More 1978; Conn, Gould and Toint 2000",
    build,
};

fn build(parameters: &Parameters) -> Result<Box<dyn Solver>, EntryError> {
    let above = |low: f64| move |v: f64| v.is_finite() && v > low;
    let steps = [("dogleg", RegionStep::Dogleg), ("steihaug", RegionStep::Steihaug), ("exact", RegionStep::Exact)];
    Ok(Box::new(TrustRegion {
        step: parameters.choice("step", &steps)?,
        initial_radius: parameters.number("initial-radius", "a number above 0", above(0.0))?,
        growth: parameters.number("growth", "a number above 1", above(1.0))?,
        accept: accept(parameters)?,
    }))
}
