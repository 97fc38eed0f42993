//! Convergence: how far has a solve come down after so many evaluations?

use crate::group::Group;
use crate::record::{BUDGETS, Record};
use crate::statistics::bootstrap::median_interval;
use crate::statistics::{StatisticEntry, Table, TableCell};

/// The line of the table.
pub const ENTRY: StatisticEntry = StatisticEntry {
    name: "convergence",
    summary: "median of the lowest cost of a trial's first solve over the cost at its start, after so many evaluations",
    source: "Efron 1979 for the intervals",
    compute,
};

/// Budgets in the table, as places in the list of budgets.
const SHOWN: [usize; 4] = [2, 5, 8, 11];

/// Return the lowest cost over the cost at the start after every budget of [`BUDGETS`]; a solve that ended earlier stays where it
/// ended. `None` without a trace or with a start of cost 0.
///
/// ```
/// use cfpose_lab::statistics::entries::convergence::relative;
/// assert_eq!(relative(&[4.0, 2.0, 1.0]).unwrap()[..4], [1.0, 0.5, 0.25, 0.25]);
/// assert_eq!(relative(&[]), None);
/// ```
pub fn relative(trace: &[f64]) -> Option<Vec<f64>> {
    let (first, last) = (*trace.first()?, *trace.last()?);
    (first > 0.0 && first.is_finite())
        .then(|| (0..BUDGETS.len()).map(|budget| trace.get(budget).unwrap_or(&last) / first).collect())
}

/// Return median and interval of the relative costs of a method after each of some budgets, as places in [`BUDGETS`]; empty without
/// traces.
pub fn curve(group: &Group<'_>, method: usize, budgets: &[usize]) -> Vec<(f64, [f64; 2])> {
    let all: Vec<Vec<f64>> = group.of(method).filter_map(|record: &Record| relative(&record.trace)).collect();
    let at = |budget: &usize| median_interval(&all.iter().map(|curve| curve[*budget]).collect::<Vec<_>>());
    budgets.iter().filter_map(at).collect()
}

fn compute(group: &Group<'_>) -> Option<Table> {
    let row = |method: usize| {
        let mut cells = vec![TableCell::Text(group.methods[method].to_string())];
        for (middle, interval) in curve(group, method, &SHOWN) {
            cells.extend([TableCell::Number(middle), TableCell::Interval(interval)]);
        }
        (cells.len() > 1).then_some(cells)
    };
    let rows: Vec<_> = (0..group.methods.len()).filter_map(row).collect();
    let columns = vec!["method", "after 3", "95 %", "after 8", "95 %", "after 24", "95 %", "after 64", "95 %"];
    (!rows.is_empty()).then_some(Table { columns, rows })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_headings_name_the_budgets() {
        assert_eq!(SHOWN.map(|place| BUDGETS[place]), [3, 8, 24, 64]);
    }
}
