//! The rotations of which only some Euler angles move.

use cfpose_kernel::scalar::Scalar;
use cfpose_optim::manifold::{Manifold, Rotation3};
use num_dual::HyperDual64;

use crate::geometry::theta::{Angle, euler_of_rotation, rotation_of_euler};

/// Largest angle about y: a quarter turn, less what keeps the angles about x and z apart.
pub(super) const QUARTER: f64 = std::f64::consts::FRAC_PI_2 - 1e-6;

/// Rotations R = Rz Ry Rx with one or two free angles; ambient coordinates are the matrix, row by row.
///
/// The fixed angles are read from the matrix itself, so they keep the value of the start. A sub-space of SO(3)'s tangent
/// would not do: steps about two axes one after the other also turn about the third.
#[derive(Debug, Clone)]
pub(super) struct EulerAngles {
    /// Free angles about x, y, z (0, 1, 2), ascending.
    pub free: Vec<usize>,
}

/// Return R = Rz Ry Rx over any number, row by row.
fn matrix<S: Scalar>(angles: [S; 3]) -> [S; 9] {
    let ((sx, cx), (sy, cy), (sz, cz)) = (angles[0].sin_cos(), angles[1].sin_cos(), angles[2].sin_cos());
    [
        cz * cy,
        cz * sy * sx - sz * cx,
        cz * sy * cx + sz * sx,
        sz * cy,
        sz * sy * sx + cz * cx,
        sz * sy * cx - cz * sx,
        -sy,
        cy * sx,
        cy * cx,
    ]
}

impl Manifold for EulerAngles {
    fn ambient(&self) -> usize {
        9
    }
    fn tangent(&self) -> usize {
        self.free.len()
    }
    fn retract(&self, theta: &[f64], step: &[f64], out: &mut [f64]) {
        if step[..self.free.len()].iter().all(|value| *value == 0.0) {
            out[..9].copy_from_slice(&theta[..9]);
            return;
        }
        let mut angles = euler_of_rotation(theta);
        for (value, axis) in step.iter().zip(&self.free) {
            angles[*axis] += value;
        }
        // Past a quarter turn about y the same rotation has other angles about x and z: what is fixed would not be.
        angles[1] = angles[1].clamp(-QUARTER, QUARTER);
        out[..9].copy_from_slice(&rotation_of_euler(&angles));
    }
    fn local(&self, from: &[f64], to: &[f64], step: &mut [f64]) {
        let (from, to) = (euler_of_rotation(from), euler_of_rotation(to));
        for (value, axis) in step.iter_mut().zip(&self.free) {
            let mut wrapped = [0.0];
            Angle.local(&[from[*axis]], &[to[*axis]], &mut wrapped);
            *value = wrapped[0];
        }
    }
    fn lift2(&self, theta: &[f64], step: &[HyperDual64], out: &mut [HyperDual64]) {
        let mut angles = euler_of_rotation(theta).map(HyperDual64::from);
        for (value, axis) in step.iter().zip(&self.free) {
            angles[*axis] += *value;
        }
        out[..9].copy_from_slice(&matrix(angles));
    }
    fn extent(&self, _theta: &[f64], out: &mut [f64]) {
        out[..self.free.len()].fill(1.0);
    }
    fn project(&self, theta: &mut [f64]) {
        Rotation3.project(theta);
    }
}
