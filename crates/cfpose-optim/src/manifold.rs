//! Manifolds: ambient coordinates for storage, tangent coordinates for steps.
//!
//! Each manifold gives a retraction and its second-order Taylor expansion at step 0 over second-order dual numbers, so first
//! *and* second derivatives of any problem flow from tangent seeds by automatic differentiation.

use std::fmt::Debug;

use num_dual::HyperDual64;

mod product;
mod rotation;
mod sphere;

pub use product::Product;
pub use rotation::{
    Rotation3, determinant3, multiply3, quaternion_of, rotation_exp, rotation_log, rotation_of_quaternion,
};
pub use sphere::UnitSphere;

/// A manifold embedded in ambient coordinates.
pub trait Manifold: Send + Sync + Debug {
    /// Return the number of ambient coordinates.
    fn ambient(&self) -> usize;

    /// Return the dimension of the tangent space.
    fn tangent(&self) -> usize;

    /// Write the point reached from `theta` (ambient) by `step` (tangent); a zero step gives `theta` itself.
    fn retract(&self, theta: &[f64], step: &[f64], out: &mut [f64]);

    /// Write the step that leads from `from` to `to`: the local inverse of [`Manifold::retract`].
    fn local(&self, from: &[f64], to: &[f64], step: &mut [f64]);

    /// Write the second-order Taylor expansion of the retraction at step 0, evaluated at the dual step.
    fn lift2(&self, theta: &[f64], step: &[HyperDual64], out: &mut [HyperDual64]);

    /// Write the derivative of the retraction at step 0 (ambient x tangent, row by row).
    fn basis(&self, theta: &[f64], out: &mut [f64]) {
        basis_by_lift(self, theta, out);
    }

    /// Write the derivative of [`Manifold::retract`] at `step`, in the tangent coordinates of the point reached (tangent x
    /// tangent, row by row): the identity at step 0, and what turns a gradient at the point reached into one with respect to
    /// the step.
    fn differential(&self, theta: &[f64], step: &[f64], out: &mut [f64]) {
        differential_by_differences(self, theta, step, out);
    }

    /// Write the size of `theta` seen along each tangent coordinate, the unit in which a relative step is small: `|theta_j|`
    /// in R^n, by default an equal share of `norm(theta)`.
    fn extent(&self, theta: &[f64], out: &mut [f64]) {
        let m = self.tangent();
        out[..m].fill(norm(&theta[..self.ambient()]) / (m.max(1) as f64).sqrt());
    }

    /// Move ambient coordinates that left the manifold by rounding or input back onto it.
    fn project(&self, theta: &mut [f64]);
}

/// Compute [`Manifold::basis`] from [`Manifold::lift2`]: the reference that overrides are tested against.
pub fn basis_by_lift<M: Manifold + ?Sized>(manifold: &M, theta: &[f64], out: &mut [f64]) {
    let (n, m) = (manifold.ambient(), manifold.tangent());
    let zero = HyperDual64::from(0.0);
    let mut lifted = vec![zero; n];
    for j in 0..m {
        let mut step = vec![zero; m];
        step[j].eps1 = 1.0;
        manifold.lift2(theta, &step, &mut lifted);
        for i in 0..n {
            out[i * m + j] = lifted[i].eps1;
        }
    }
}

/// Compute [`Manifold::differential`] from central differences, extrapolated once: the default, and the reference that
/// overrides are tested against (error about 1e-11).
pub fn differential_by_differences<M: Manifold + ?Sized>(manifold: &M, theta: &[f64], step: &[f64], out: &mut [f64]) {
    let (n, m) = (manifold.ambient(), manifold.tangent());
    let mut centre = vec![0.0; n];
    manifold.retract(theta, step, &mut centre);
    let (mut point, mut moved, mut local) = (vec![0.0; n], step.to_vec(), vec![0.0; m]);
    for j in 0..m {
        let width = 1e-3 * step[j].abs().max(1.0);
        let mut column = vec![0.0; m];
        for (factor, h) in [(4.0 / 3.0, 0.5 * width), (-1.0 / 3.0, width)] {
            for sign in [1.0, -1.0] {
                moved[j] = step[j] + sign * h;
                manifold.retract(theta, &moved, &mut point);
                manifold.local(&centre, &point, &mut local);
                for i in 0..m {
                    column[i] += factor * sign * local[i] / (2.0 * h);
                }
            }
        }
        moved[j] = step[j];
        for i in 0..m {
            out[i * m + j] = column[i];
        }
    }
}

/// Return the norm of a vector.
pub fn norm(v: &[f64]) -> f64 {
    v.iter().map(|a| a * a).sum::<f64>().sqrt()
}

/// Return the norm of a 3-vector.
pub fn norm3(v: &[f64; 3]) -> f64 {
    norm(v)
}

/// R^n with addition.
///
/// ```
/// use cfpose_optim::manifold::{Euclidean, Manifold};
/// let mut out = [0.0; 2];
/// Euclidean(2).retract(&[1.0, 2.0], &[0.5, -1.0], &mut out);
/// assert_eq!(out, [1.5, 1.0]);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Euclidean(pub usize);

impl Manifold for Euclidean {
    fn ambient(&self) -> usize {
        self.0
    }
    fn tangent(&self) -> usize {
        self.0
    }
    fn retract(&self, theta: &[f64], step: &[f64], out: &mut [f64]) {
        for i in 0..self.0 {
            out[i] = theta[i] + step[i];
        }
    }
    fn local(&self, from: &[f64], to: &[f64], step: &mut [f64]) {
        for i in 0..self.0 {
            step[i] = to[i] - from[i];
        }
    }
    fn lift2(&self, theta: &[f64], step: &[HyperDual64], out: &mut [HyperDual64]) {
        for i in 0..self.0 {
            out[i] = step[i] + theta[i];
        }
    }
    fn basis(&self, _theta: &[f64], out: &mut [f64]) {
        for i in 0..self.0 {
            for j in 0..self.0 {
                out[i * self.0 + j] = f64::from(u8::from(i == j));
            }
        }
    }
    fn differential(&self, theta: &[f64], _step: &[f64], out: &mut [f64]) {
        self.basis(theta, out);
    }
    fn extent(&self, theta: &[f64], out: &mut [f64]) {
        for i in 0..self.0 {
            out[i] = theta[i].abs();
        }
    }
    fn project(&self, _theta: &mut [f64]) {}
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;

    fn check_basis(manifold: &dyn Manifold, theta: &[f64]) {
        let size = manifold.ambient() * manifold.tangent();
        let (mut direct, mut lifted) = (vec![0.0; size], vec![0.0; size]);
        manifold.basis(theta, &mut direct);
        basis_by_lift(manifold, theta, &mut lifted);
        for (a, b) in direct.iter().zip(&lifted) {
            assert!((a - b).abs() < 1e-14, "{direct:?} {lifted:?}");
        }
    }

    #[test]
    fn direct_bases_equal_the_dual_lift() {
        check_basis(&Rotation3, &rotation_exp(&[0.3, -0.8, 2.0]));
        for x in [[0.6, 0.0, 0.8], [-0.6, 0.48, 0.64], [0.0, 1.0, 0.0]] {
            check_basis(&UnitSphere(2), &x);
        }
        let product = Product::new(vec![Arc::new(Rotation3), Arc::new(UnitSphere(2)), Arc::new(Euclidean(1))]);
        let mut theta = rotation_exp(&[1.0, 0.2, -0.4]).to_vec();
        theta.extend([0.36, 0.48, -0.8, 7.0]);
        check_basis(&product, &theta);
    }

    #[test]
    fn direct_differentials_equal_differences() {
        let product = Product::new(vec![Arc::new(Rotation3), Arc::new(UnitSphere(2)), Arc::new(Euclidean(1))]);
        let mut theta = rotation_exp(&[1.0, 0.2, -0.4]).to_vec();
        theta.extend([0.36, 0.48, -0.8, 7.0]);
        for scale in [0.0, 1e-3, 0.02, 0.7, 1.5] {
            let step = [0.5, -0.7, 0.3, 0.9, -0.4, 2.0].map(|d| d * scale);
            let (mut direct, mut numeric) = ([0.0; 36], [0.0; 36]);
            product.differential(&theta, &step, &mut direct);
            differential_by_differences(&product, &theta, &step, &mut numeric);
            for (a, b) in direct.iter().zip(&numeric) {
                assert!((a - b).abs() < 1e-10, "{scale}: {direct:?} {numeric:?}");
            }
        }
    }

    #[test]
    fn rotation_vector_survives_the_whole_range_of_angles() {
        for angle in [0.0, 1e-9, 1e-5, 0.5, 2.0, 3.0, std::f64::consts::PI - 1e-9, std::f64::consts::PI] {
            let axis = [0.36, -0.48, 0.8];
            let w = axis.map(|a| a * angle);
            let back = rotation_exp(&rotation_log(&rotation_exp(&w)));
            for (a, b) in back.iter().zip(&rotation_exp(&w)) {
                assert!((a - b).abs() < 2e-15, "angle {angle}");
            }
        }
    }
}
