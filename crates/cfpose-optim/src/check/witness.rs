//! A problem that watches how it is called.

use std::sync::Mutex;

use crate::constraint::{Bounds, Constraints};
use crate::manifold::Manifold;
use crate::outcome::Counts;
use crate::problem::{Capabilities, LeastSquares, half_squared_norm};
use crate::session::FEASIBILITY_TOLERANCE;

/// What was seen.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Seen {
    counts: Counts,
    least: f64,
}

/// A problem that counts its calls and remembers the least cost at a feasible point: a solver's outcome can be held against
/// what really happened.
pub struct Witness<'p> {
    inner: &'p dyn LeastSquares,
    seen: Mutex<Seen>,
}

impl<'p> Witness<'p> {
    /// Watch a problem.
    pub fn new(inner: &'p dyn LeastSquares) -> Self {
        Self { inner, seen: Mutex::new(Seen { counts: Counts::default(), least: f64::INFINITY }) }
    }

    /// Return the numbers of calls (iterations are not seen).
    pub fn counts(&self) -> Counts {
        self.with(|seen| seen.counts)
    }

    /// Return the least cost seen at a feasible point, infinite when there was none.
    pub fn least_cost(&self) -> f64 {
        self.with(|seen| seen.least)
    }

    fn with<T>(&self, action: impl FnOnce(&mut Seen) -> T) -> T {
        action(&mut self.seen.lock().unwrap_or_else(std::sync::PoisonError::into_inner))
    }

    fn note(&self, theta: &[f64], residual: &[f64], with_jacobian: bool) {
        let cost = half_squared_norm(residual);
        let feasible = self.is_feasible(theta);
        self.with(|seen| {
            seen.counts.residuals += 1;
            seen.counts.jacobians += usize::from(with_jacobian);
            if feasible && cost < seen.least {
                seen.least = cost;
            }
        });
    }

    fn is_feasible(&self, theta: &[f64]) -> bool {
        let inside = |b: &Bounds| {
            theta
                .iter()
                .zip(b.lower.iter().zip(&b.upper))
                .all(|(v, (low, high))| *v >= low - FEASIBILITY_TOLERANCE && *v <= high + FEASIBILITY_TOLERANCE)
        };
        let satisfied = |c: &dyn Constraints| {
            let mut values = vec![0.0; c.num_equalities() + c.num_inequalities()];
            c.values(theta, &mut values);
            values.iter().enumerate().all(|(i, v)| {
                if i < c.num_equalities() { v.abs() <= FEASIBILITY_TOLERANCE } else { *v >= -FEASIBILITY_TOLERANCE }
            })
        };
        self.inner.bounds().is_none_or(inside) && self.inner.constraints().is_none_or(satisfied)
    }
}

impl LeastSquares for Witness<'_> {
    fn manifold(&self) -> &dyn Manifold {
        self.inner.manifold()
    }
    fn num_residuals(&self) -> usize {
        self.inner.num_residuals()
    }
    fn residual(&self, theta: &[f64], residual: &mut [f64]) {
        self.inner.residual(theta, residual);
        self.note(theta, residual, false);
    }
    fn jacobian(&self, theta: &[f64], residual: &mut [f64], jacobian: &mut [f64]) {
        self.inner.jacobian(theta, residual, jacobian);
        self.note(theta, residual, true);
    }
    fn curvature(&self, theta: &[f64], weights: &[f64], hessian: &mut [f64]) {
        self.with(|seen| seen.counts.curvatures += 1);
        self.inner.curvature(theta, weights, hessian);
    }
    fn capabilities(&self) -> Capabilities {
        self.inner.capabilities()
    }
    fn bounds(&self) -> Option<&Bounds> {
        self.inner.bounds()
    }
    fn constraints(&self) -> Option<&dyn Constraints> {
        self.inner.constraints()
    }
}
