//! A test problem with its published solution.

use crate::problem::LeastSquares;

/// A problem, its usual start and the published least values of the *sum of squares* `r'r`.
pub struct Reference {
    /// Name, with the number in its collection.
    pub name: String,
    /// The problem.
    pub problem: Box<dyn LeastSquares + Send>,
    /// Usual start.
    pub start: Vec<f64>,
    /// Published values of r'r at the global minimum and, after it, at known local minima.
    pub optima: Vec<f64>,
}

impl Reference {
    /// Say whether a cost (half of r'r) is a published optimum: within `relative`, or below `absolute` for an optimum of 0.
    pub fn is_optimum(&self, cost: f64, relative: f64, absolute: f64) -> bool {
        self.optima.iter().any(|f| (2.0 * cost - f).abs() <= if *f == 0.0 { absolute } else { relative * f })
    }
}
