//! Bounds and general constraints.

/// Bounds on ambient coordinates: `lower_i <= theta_i <= upper_i`; infinities mean no bound.
#[derive(Debug, Clone, PartialEq)]
pub struct Bounds {
    /// Lower bounds, one per ambient coordinate.
    pub lower: Vec<f64>,
    /// Upper bounds, one per ambient coordinate.
    pub upper: Vec<f64>,
}

/// General constraints with derivatives along the tangent of the problem's manifold: equalities `c(theta) = 0` first,
/// then inequalities `c(theta) >= 0`.
pub trait Constraints: Sync {
    /// Return the number of equalities.
    fn num_equalities(&self) -> usize;

    /// Return the number of inequalities.
    fn num_inequalities(&self) -> usize;

    /// Write all constraint values (equalities, then inequalities).
    fn values(&self, theta: &[f64], values: &mut [f64]);

    /// Write values and Jacobian (constraints x tangent, row by row).
    fn jacobian(&self, theta: &[f64], values: &mut [f64], jacobian: &mut [f64]);

    /// Write `sum_i weights_i * Hess(c_i)` (tangent x tangent, row by row) along the retraction. Only called when
    /// [`Constraints::has_curvature`] is true.
    fn curvature(&self, _theta: &[f64], _weights: &[f64], hessian: &mut [f64]) {
        hessian.fill(f64::NAN);
    }

    /// Say whether exact second derivatives are available.
    fn has_curvature(&self) -> bool {
        false
    }
}
