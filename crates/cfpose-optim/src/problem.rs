//! What a solver sees: residuals and Jacobians on a manifold, as plain slices.

use crate::constraint::{Bounds, Constraints};
use crate::manifold::Manifold;

/// A nonlinear least-squares problem on a manifold: minimise `cost(theta) = 1/2 * sum_i r_i(theta)^2`.
///
/// `theta` is given in the ambient coordinates of [`LeastSquares::manifold`]; derivatives are with respect to the tangent
/// at `theta`: column `j` is the derivative along `step -> retract(theta, step)` at `step = 0`.
/// A value that cannot be computed is written as NaN; solvers treat it as a failed trial, never as a panic.
pub trait LeastSquares: Sync {
    /// Return the manifold on which `theta` lives.
    fn manifold(&self) -> &dyn Manifold;

    /// Return L, the number of residuals.
    fn num_residuals(&self) -> usize;

    /// Write the residual (length L) at `theta` (length ambient).
    fn residual(&self, theta: &[f64], residual: &mut [f64]);

    /// Write the residual (length L) and the Jacobian (L x tangent, row by row).
    ///
    /// When [`Capabilities::jacobian`] is false this must still be callable and may fill the Jacobian with NaN.
    fn jacobian(&self, theta: &[f64], residual: &mut [f64], jacobian: &mut [f64]);

    /// Write `sum_i weights_i * Hess(r_i)` (tangent x tangent, row by row), the second derivative of `r_i` along the
    /// retraction. Only called when [`Capabilities::curvature`] is true.
    fn curvature(&self, _theta: &[f64], _weights: &[f64], hessian: &mut [f64]) {
        hessian.fill(f64::NAN);
    }

    /// Say what this problem offers to solvers.
    fn capabilities(&self) -> Capabilities {
        Capabilities::default()
    }

    /// Return bounds on ambient coordinates, if any.
    fn bounds(&self) -> Option<&Bounds> {
        None
    }

    /// Return general constraints, if any.
    fn constraints(&self) -> Option<&dyn Constraints> {
        None
    }
}

/// What a problem offers; compared with a solver's [`crate::solver::Needs`] before a solve.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Capabilities {
    /// The Jacobian is available.
    pub jacobian: bool,
    /// The curvature term (exact second derivatives) is available.
    pub curvature: bool,
}

impl Default for Capabilities {
    fn default() -> Self {
        Self { jacobian: true, curvature: false }
    }
}

/// Return 1/2 of the squared Euclidean norm: the cost of a residual (eq. `optimization0` with the factor 1/2).
///
/// ```
/// assert_eq!(cfpose_optim::problem::half_squared_norm(&[3.0, 4.0]), 12.5);
/// ```
pub fn half_squared_norm(residual: &[f64]) -> f64 {
    0.5 * residual.iter().map(|r| r * r).sum::<f64>()
}
