//! Performance profiles: which share of the trials does a method solve within a multiple of the best method's cost?

use crate::group::Group;
use crate::record::Record;
use crate::statistics::{StatisticEntry, Table, TableCell, wilson95};

/// The line of the table.
pub const ENTRY: StatisticEntry = StatisticEntry {
    name: "performance-profile",
    summary: "share of the trials solved within a multiple of the least evaluations of any method",
    source: "Dolan and More 2002",
    compute,
};

/// Multiples of the least cost in the table.
const MULTIPLES: [f64; 4] = [1.0, 2.0, 4.0, 10.0];

/// Return, for every method, the ratios of its cost to the least cost of any method in the same problem, ascending; infinite where a
/// method failed. `costs` has one list a problem, one cost a method, infinite for a failure.
///
/// Source: Dolan and More, Benchmarking optimization software with performance profiles (2002), r_(p,s).
///
/// ```
/// use cfpose_lab::statistics::entries::performance_profile::ratios;
/// let fail = f64::INFINITY;
/// assert_eq!(ratios(&[vec![10.0, 20.0], vec![30.0, 15.0], vec![fail, 7.0]]), [[1.0, 2.0, fail], [1.0, 1.0, 2.0]]);
/// ```
pub fn ratios(costs: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let methods = costs.first().map_or(0, Vec::len);
    let mut ratios = vec![Vec::with_capacity(costs.len()); methods];
    for problem in costs {
        let least = problem.iter().copied().fold(f64::INFINITY, f64::min);
        for (method, cost) in problem.iter().enumerate() {
            ratios[method].push(if cost.is_finite() { cost / least } else { f64::INFINITY });
        }
    }
    ratios.iter_mut().for_each(|list| list.sort_by(f64::total_cmp));
    ratios
}

/// Return how many of ascending values are at most `bound`.
pub fn count_within(sorted: &[f64], bound: f64) -> usize {
    sorted.partition_point(|value| *value <= bound)
}

/// Return the costs of the trials that every method has, problem by problem: what `cost` says of a success, at least 1e-9, else
/// infinite.
pub fn costs(group: &Group<'_>, cost: fn(&Record) -> f64) -> Vec<Vec<f64>> {
    let of = |record: &Record| if record.success { cost(record).max(1e-9) } else { f64::INFINITY };
    let problems = group.problems.iter();
    problems.filter_map(|problem| problem.records.iter().map(|record| Some(of((*record)?))).collect()).collect()
}

/// The cost of a trial in residual evaluations, at least 1.
pub fn evaluations(record: &Record) -> f64 {
    record.evaluations.max(1) as f64
}

fn compute(group: &Group<'_>) -> Option<Table> {
    let costs = costs(group, evaluations);
    if group.methods.len() < 2 || costs.is_empty() {
        return None;
    }
    let row = |(method, ratios): (usize, Vec<f64>)| {
        let mut cells = vec![TableCell::Text(group.methods[method].to_string())];
        for multiple in MULTIPLES {
            let count = count_within(&ratios, multiple);
            cells.push(TableCell::Share(count as f64 / ratios.len() as f64));
            cells.push(TableCell::ShareInterval(wilson95(count, ratios.len())));
        }
        cells
    };
    let rows = ratios(&costs).into_iter().enumerate().map(row).collect();
    let columns =
        vec!["method", "fewest %", "95 %", "within x2 %", "95 %", "within x4 %", "95 %", "within x10 %", "95 %"];
    Some(Table { columns, rows })
}
