//! What a record keeps of the way to an estimate: where it began, and how fast the cost came down.

use std::collections::BTreeMap;

use cfpose::free::columns;
use cfpose::theta::Layout;
use cfpose_optim::Manifold;
use cfpose_optim::observe::Observer;
use cfpose_optim::outcome::TraceRow;

use crate::record::BUDGETS;
use crate::scenario::Trial;

/// Return the tangent coordinates of a trial's start at its truth, by the direction's name (`rx`, `tz`, ...).
///
/// Empty for a trial without a start.
pub(crate) fn start_offset(layout: &Layout, trial: &Trial) -> BTreeMap<String, f64> {
    let manifold = layout.manifold();
    let Some(start) = trial.start.as_ref().filter(|start| start.len() == manifold.ambient()) else {
        return BTreeMap::new();
    };
    if trial.truth.len() != manifold.ambient() {
        return BTreeMap::new();
    }
    let mut step = vec![0.0; manifold.tangent()];
    manifold.local(&trial.truth, start, &mut step);
    let named = columns(layout).into_iter().map(|column| column.name).zip(step);
    named.filter(|(_, offset)| offset.is_finite()).collect()
}

/// Sees the first solve of an estimate and keeps its lowest cost after every budget of evaluations.
///
/// Later solves (other starts, stages with other points or weights) have other costs, which cannot be compared with the first.
#[derive(Debug, Default)]
pub(crate) struct Trace {
    /// (evaluations, lowest cost so far), ascending.
    rows: Vec<(usize, f64)>,
    is_over: bool,
}

impl Trace {
    /// Return the lowest cost after every budget up to the first that covers the whole solve.
    pub fn costs(&self) -> Vec<f64> {
        let Some((total, _)) = self.rows.last() else { return Vec::new() };
        let last = BUDGETS.iter().position(|budget| budget >= total).map_or(BUDGETS.len(), |place| place + 1);
        // The start costs one evaluation, so that every budget has a row; solvers that evaluate more at once begin with theirs.
        let at = |budget: usize| {
            let count = self.rows.partition_point(|(evaluations, _)| *evaluations <= budget);
            rounded(self.rows[count.saturating_sub(1)].1)
        };
        BUDGETS[..last].iter().map(|budget| at(*budget)).collect()
    }
}

/// Return a cost with six digits: a trace is for curves, and stands in every record.
fn rounded(cost: f64) -> f64 {
    format!("{cost:.5e}").parse().unwrap_or(cost)
}

impl Observer for Trace {
    fn iteration(&mut self, row: &TraceRow, _theta: &[f64]) {
        // A new solve counts from the beginning.
        let begins_anew = self.rows.last().is_some_and(|(evaluations, _)| row.evaluations < *evaluations)
            || (row.iteration == 0 && !self.rows.is_empty());
        self.is_over |= begins_anew;
        if self.is_over || !row.cost.is_finite() {
            return;
        }
        let lowest = self.rows.last().map_or(row.cost, |(_, cost)| cost.min(row.cost));
        self.rows.push((row.evaluations.max(1), lowest));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(iteration: usize, evaluations: usize, cost: f64) -> TraceRow {
        let (gradient_norm, step_norm, damping) = (f64::NAN, f64::NAN, f64::NAN);
        TraceRow { iteration, evaluations, cost, gradient_norm, step_norm, damping, accepted: true }
    }

    #[test]
    fn a_trace_is_the_first_solve_at_its_budgets() {
        let mut trace = Trace::default();
        for row in [row(0, 1, 8.0), row(1, 2, 9.0), row(2, 4, 2.0), row(3, 7, 1.0), row(0, 1, 0.1), row(1, 30, 0.0)] {
            trace.iteration(&row, &[]);
        }
        // Budgets 1, 2, 3, 4, 6, 8.
        assert_eq!(trace.costs(), [8.0, 8.0, 8.0, 2.0, 2.0, 1.0]);
        assert!(Trace::default().costs().is_empty());
    }
}
