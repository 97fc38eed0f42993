//! Trust regions on manifolds with the Gauss-Newton model: dogleg, Steihaug's truncated conjugate gradients, exact step.

use crate::entry::{EntryError, ParameterSpec, Parameters};
use crate::linear::{Qr, minimum_norm};
use crate::manifold::norm;
use crate::outcome::Outcome;
use crate::problem::LeastSquares;
use crate::session::run;
use crate::solver::{Control, Needs, SolveError, Solver, SolverEntry};
use crate::solvers::descent::{Model, Proposal, Search, StepRule, descend};

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

/// Radius by gain ratio.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RadiusSearch {
    pub(crate) initial: f64,
    pub(crate) growth: f64,
    pub(crate) accept: f64,
}

impl Search for RadiusSearch {
    fn begin(&mut self, _model: &Model, scaled_start: f64) -> f64 {
        if scaled_start > 0.0 { self.initial * scaled_start } else { self.initial }
    }

    fn judge(&mut self, radius: &mut f64, gain_ratio: f64, proposal: Option<Proposal>) -> bool {
        let length = proposal.map_or(*radius, |p| p.scaled_norm);
        if gain_ratio < 0.25 {
            *radius = 0.25 * length.min(*radius);
        } else if gain_ratio > 0.75 {
            *radius = radius.max(self.growth * length);
        }
        gain_ratio > self.accept
    }
}

/// Join a step and what the Gauss-Newton model predicts of it; nothing when it is not finite.
fn proposal(model: &Model, qr: &Qr, step: &[f64], full: bool) -> Option<Proposal> {
    let slope: f64 = model.gradient.iter().zip(step).map(|(g, d)| g * d).sum();
    let predicted = -slope - 0.5 * qr.image_squared(step);
    let finite = step.iter().all(|d| d.is_finite());
    finite.then(|| Proposal { predicted, scaled_norm: model.scaled_norm(step), full })
}

/// Write `step += length * direction`.
fn advance(step: &mut [f64], length: f64, direction: &[f64]) {
    for (d, p) in step.iter_mut().zip(direction) {
        *d += length * p;
    }
}

/// Return the positive `t` at which `norm(D (from + t along)) = radius`.
pub(crate) fn to_boundary(scaling: &[f64], from: &[f64], along: &[f64], radius: f64) -> f64 {
    let (mut aa, mut fa, mut ff) = (0.0, 0.0, 0.0);
    for j in 0..scaling.len() {
        let (f, a) = (scaling[j] * from[j], scaling[j] * along[j]);
        aa += a * a;
        fa += f * a;
        ff += f * f;
    }
    let missing = (radius * radius - ff).max(0.0);
    let root = (fa * fa + aa * missing).sqrt();
    // The form without cancellation.
    if fa > 0.0 { missing / (fa + root) } else { (root - fa) / aa }
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

/// Write the Gauss-Newton step: by the triangle when its rank is clear, else the step of least scaled norm by SVD.
pub(crate) fn gauss_newton(model: &Model, qr: &mut Qr, step: &mut [f64]) {
    if !(qr.rank_is_clear(&model.scaling) && qr.solve_damped(0.0, &model.scaling, step)) {
        minimum_norm(model.rows, model.cols, &model.jacobian, &model.residual, &model.scaling, step);
    }
    step.iter_mut().for_each(|d| *d = -*d);
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

/// Minimise `g'd + 1/2 d'B d` within the region by conjugate gradients; a direction without curvature leads to the boundary.
/// Say whether the step ends inside.
pub(crate) fn conjugate_gradients(
    model: &Model,
    radius: f64,
    step: &mut [f64],
    product: impl Fn(&[f64], &mut [f64]),
) -> bool {
    let m = model.cols;
    step.fill(0.0);
    let mut residual = model.gradient.clone();
    let precondition = |v: &[f64]| -> Vec<f64> { v.iter().zip(&model.scaling).map(|(a, d)| a / (d * d)).collect() };
    let mut preconditioned = precondition(&residual);
    let mut direction: Vec<f64> = preconditioned.iter().map(|v| -v).collect();
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
    let mut rho = dot(&residual, &preconditioned);
    let target = rho * 1e-28;
    let mut image = vec![0.0; m];
    // Rounding spoils conjugacy on ill-conditioned problems: allow more passes than the m of exact arithmetic.
    for _ in 0..10 * m {
        if rho <= target || rho == 0.0 {
            return true;
        }
        product(&direction, &mut image);
        let curvature = dot(&direction, &image);
        let length = rho / curvature;
        let mut next = step.to_vec();
        advance(&mut next, length, &direction);
        if curvature <= 0.0 || !length.is_finite() || model.scaled_norm(&next) >= radius {
            let length = to_boundary(&model.scaling, step, &direction, radius);
            advance(step, length, &direction);
            return false;
        }
        step.copy_from_slice(&next);
        advance(&mut residual, length, &image);
        preconditioned = precondition(&residual);
        let next_rho = dot(&residual, &preconditioned);
        let beta = next_rho / rho;
        for (d, z) in direction.iter_mut().zip(&preconditioned) {
            *d = beta * *d - z;
        }
        rho = next_rho;
    }
    true
}

/// The exact minimiser on the region.
#[derive(Debug, Default)]
pub(crate) struct Exact {
    qr: Qr,
    newton: Vec<f64>,
}

impl StepRule for Exact {
    fn prepare(&mut self, model: &Model) {
        self.qr.factorise(model.rows, model.cols, &model.jacobian, &model.residual);
        self.newton.resize(model.cols, 0.0);
        gauss_newton(model, &mut self.qr, &mut self.newton);
    }

    fn step(&mut self, model: &Model, radius: f64, step: &mut [f64]) -> Option<Proposal> {
        let full = model.scaled_norm(&self.newton) <= 1.1 * radius;
        if full {
            step.copy_from_slice(&self.newton);
        } else {
            secular_step(model, &mut self.qr, radius, step)?;
        }
        proposal(model, &self.qr, step, full)
    }
}

/// Find the damping with `|norm(D d) - radius| <= radius / 10` by safeguarded Newton steps on the secular equation
/// `norm(D d(damping)) = radius` (More 1978, section 5).
fn secular_step(model: &Model, qr: &mut Qr, radius: f64, step: &mut [f64]) -> Option<()> {
    let scaled_gradient: f64 = norm(&model.gradient.iter().zip(&model.scaling).map(|(g, d)| g / d).collect::<Vec<_>>());
    let (mut low, mut high) = (0.0_f64, scaled_gradient / radius);
    let mut damping = 1e-3 * high;
    let mut derivative = vec![0.0; model.cols];
    for _ in 0..30 {
        if !(damping > low && damping < high) {
            damping = (low * high).sqrt().max(1e-3 * high);
        }
        if !qr.solve_damped(damping, &model.scaling, step) {
            return None;
        }
        step.iter_mut().for_each(|d| *d = -*d);
        let length = model.scaled_norm(step);
        let excess = length - radius;
        if excess.abs() <= 0.1 * radius {
            return Some(());
        }
        if excess > 0.0 {
            low = low.max(damping)
        } else {
            high = high.min(damping)
        }
        // d norm / d damping = -norm(R^-T D^2 d)^2 / norm(D d) with the damped triangle R.
        for j in 0..model.cols {
            derivative[j] = model.scaling[j] * model.scaling[j] * step[j];
        }
        let solved = qr.solve_transposed_damped(&mut derivative);
        damping += excess / radius * length * length / solved;
    }
    Some(())
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
        accept: parameters.number("accept", "a number from 0 to below 0.25", |v| (0.0..0.25).contains(&v))?,
    }))
}
