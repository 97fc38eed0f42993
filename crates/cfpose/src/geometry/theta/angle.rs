//! The circle of plane angles.

use std::f64::consts::{PI, TAU};

use cfpose_optim::manifold::Manifold;
use num_dual::HyperDual64;

/// SO(2) as an angle in radians in -pi..pi: a step adds to it.
///
/// ```
/// use cfpose::theta::Angle;
/// use cfpose_optim::manifold::Manifold;
/// let (mut angle, mut step) = ([0.0], [0.0]);
/// Angle.retract(&[3.0], &[0.5], &mut angle);
/// Angle.local(&[3.0], &angle, &mut step);
/// assert!((angle[0] - (3.5 - std::f64::consts::TAU)).abs() < 1e-15 && (step[0] - 0.5).abs() < 1e-15);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Angle;

/// Return the angle of -pi..pi that differs by whole turns; an angle that is there already keeps its bits.
fn wrapped(angle: f64) -> f64 {
    if (-PI..PI).contains(&angle) { angle } else { angle - TAU * ((angle + PI) / TAU).floor() }
}

impl Manifold for Angle {
    fn ambient(&self) -> usize {
        1
    }
    fn tangent(&self) -> usize {
        1
    }
    fn retract(&self, theta: &[f64], step: &[f64], out: &mut [f64]) {
        out[0] = wrapped(theta[0] + step[0]);
    }
    fn local(&self, from: &[f64], to: &[f64], step: &mut [f64]) {
        step[0] = wrapped(to[0] - from[0]);
    }
    fn lift2(&self, theta: &[f64], step: &[HyperDual64], out: &mut [HyperDual64]) {
        out[0] = step[0] + theta[0];
    }
    fn basis(&self, _theta: &[f64], out: &mut [f64]) {
        out[0] = 1.0;
    }
    fn extent(&self, _theta: &[f64], out: &mut [f64]) {
        // An angle has no size: a step is small against one radian.
        out[0] = 1.0;
    }
    fn project(&self, theta: &mut [f64]) {
        theta[0] = wrapped(theta[0]);
    }
}
