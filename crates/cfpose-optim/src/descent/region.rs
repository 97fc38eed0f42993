//! Steps within a radius, for step rules whose control number is one: the search for the radius, the exact step, conjugate
//! gradients, the Gauss-Newton step.

use crate::descent::{Model, Proposal, Search, StepRule};
use crate::linear::{Qr, minimum_norm};
use crate::manifold::norm;

/// A control number that is a radius: it shrinks to a quarter of the step below a gain ratio of 1/4 and grows to at least
/// `growth` steps above 3/4.
#[derive(Debug, Clone, Copy)]
pub struct RadiusSearch {
    /// First radius relative to the scaled size of theta.
    pub initial: f64,
    /// Growth of the radius after a good trial, > 1.
    pub growth: f64,
    /// A trial with a gain ratio above this is accepted.
    pub accept: f64,
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
pub fn proposal(model: &Model, qr: &Qr, step: &[f64], full: bool) -> Option<Proposal> {
    let slope: f64 = model.gradient.iter().zip(step).map(|(g, d)| g * d).sum();
    let predicted = -slope - 0.5 * qr.image_squared(step);
    let finite = step.iter().all(|d| d.is_finite());
    finite.then(|| Proposal { predicted, scaled_norm: model.scaled_norm(step), full })
}

/// Write `step += length * direction`.
pub fn advance(step: &mut [f64], length: f64, direction: &[f64]) {
    for (d, p) in step.iter_mut().zip(direction) {
        *d += length * p;
    }
}

/// Return the positive `t` at which `norm(D (from + t along)) = radius`.
pub fn to_boundary(scaling: &[f64], from: &[f64], along: &[f64], radius: f64) -> f64 {
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

/// Write the Gauss-Newton step: by the triangle when its rank is clear, else the step of least scaled norm by SVD.
pub fn gauss_newton(model: &Model, qr: &mut Qr, step: &mut [f64]) {
    if !(qr.rank_is_clear(&model.scaling) && qr.solve_damped(0.0, &model.scaling, step)) {
        minimum_norm(model.rows, model.cols, &model.jacobian, &model.residual, &model.scaling, step);
    }
    step.iter_mut().for_each(|d| *d = -*d);
}

/// Minimise `g'd + 1/2 d'B d` within the region by conjugate gradients; a direction without curvature leads to the boundary.
/// Say whether the step ends inside.
pub fn conjugate_gradients(model: &Model, radius: f64, step: &mut [f64], product: impl Fn(&[f64], &mut [f64])) -> bool {
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
pub struct Exact {
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
