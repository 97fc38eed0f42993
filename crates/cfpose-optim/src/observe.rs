//! Observation of a running solve.

use crate::outcome::TraceRow;

/// Called once per iteration; must not change the result.
pub trait Observer {
    /// See one iteration and the point (ambient coordinates) after it.
    fn iteration(&mut self, row: &TraceRow, theta: &[f64]);
}
