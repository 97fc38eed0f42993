//! Problems with known solutions: for tests of solvers, for examples and for benches.

pub mod hock_schittkowski;
pub mod more_garbow_hillstrom;
pub mod nist;
pub mod pose;
mod reference;

pub use reference::Reference;

use crate::manifold::{Euclidean, Manifold};
use crate::problem::{Capabilities, LeastSquares};

/// Rosenbrock's valley: r = (10 (x2 - x1^2), 1 - x1), minimum 0 at (1, 1), usual start (-1.2, 1). All derivatives by hand.
///
/// Source: H. H. Rosenbrock, An automatic method for finding the greatest or least value of a function, Comput. J. 3 (1960).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Rosenbrock;

impl LeastSquares for Rosenbrock {
    fn manifold(&self) -> &dyn Manifold {
        &Euclidean(2)
    }
    fn num_residuals(&self) -> usize {
        2
    }
    fn residual(&self, theta: &[f64], residual: &mut [f64]) {
        residual[0] = 10.0 * (theta[1] - theta[0] * theta[0]);
        residual[1] = 1.0 - theta[0];
    }
    fn jacobian(&self, theta: &[f64], residual: &mut [f64], jacobian: &mut [f64]) {
        self.residual(theta, residual);
        jacobian.copy_from_slice(&[-20.0 * theta[0], 10.0, -1.0, 0.0]);
    }
    fn curvature(&self, _theta: &[f64], weights: &[f64], hessian: &mut [f64]) {
        hessian.copy_from_slice(&[-20.0 * weights[0], 0.0, 0.0, 0.0]);
    }
    fn capabilities(&self) -> Capabilities {
        Capabilities { jacobian: true, curvature: true }
    }
}
