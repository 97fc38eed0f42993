//! Data profiles: which share of the trials does a method solve within a budget of evaluations?

use crate::group::Group;
use crate::statistics::{StatisticEntry, Table, TableCell, wilson95};

/// The line of the table.
pub const ENTRY: StatisticEntry = StatisticEntry {
    name: "data-profile",
    summary: "share of the trials solved within a budget of evaluations, in units of unknowns + 1",
    source: "More and Wild 2009",
    compute,
};

/// Budgets in the table.
const BUDGETS: [f64; 4] = [1.0, 5.0, 20.0, 100.0];

/// Return the budgets at which a method's problems are solved, ascending: evaluations / (unknowns + 1), infinite for a failure.
///
/// Source: More and Wild, Benchmarking derivative-free optimization algorithms (2009), d_s(alpha); a unit is what a gradient by
/// differences costs.
///
/// ```
/// use cfpose_lab::statistics::entries::data_profile::budgets;
/// assert_eq!(budgets(&[(14.0, 6), (f64::INFINITY, 6), (9.0, 2)]), [2.0, 3.0, f64::INFINITY]);
/// ```
pub fn budgets(solved: &[(f64, usize)]) -> Vec<f64> {
    let mut budgets: Vec<f64> =
        solved.iter().map(|(evaluations, unknowns)| evaluations / (unknowns + 1) as f64).collect();
    budgets.sort_by(f64::total_cmp);
    budgets
}

/// Return evaluations (infinite for a failure) and unknowns of every trial of a method.
pub fn solved(group: &Group<'_>, method: usize) -> Vec<(f64, usize)> {
    let of = |problem: &crate::group::Problem<'_>| {
        let record = problem.records[method]?;
        // A method that failed may not know; another one on the same trial does.
        let unknowns = problem.records.iter().flatten().map(|record| record.num_unknowns()).max().unwrap_or(0);
        Some((if record.success { record.evaluations.max(1) as f64 } else { f64::INFINITY }, unknowns))
    };
    group.problems.iter().filter_map(of).collect()
}

fn compute(group: &Group<'_>) -> Option<Table> {
    let row = |method: usize| {
        let budgets = budgets(&solved(group, method));
        let mut cells = vec![TableCell::Text(group.methods[method].to_string())];
        for bound in BUDGETS {
            let count = budgets.partition_point(|value| *value <= bound);
            cells.push(TableCell::Share(count as f64 / budgets.len() as f64));
            cells.push(TableCell::ShareInterval(wilson95(count, budgets.len())));
        }
        cells
    };
    let rows = (0..group.methods.len()).map(row).collect();
    let columns =
        vec!["method", "within 1 %", "95 %", "within 5 %", "95 %", "within 20 %", "95 %", "within 100 %", "95 %"];
    Some(Table { columns, rows })
}
