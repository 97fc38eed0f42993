//! Medians of error, evaluations and time with bootstrap intervals.

use crate::group::{Group, error_of};
use crate::record::Record;
use crate::statistics::bootstrap::median_interval;
use crate::statistics::{StatisticEntry, Table, TableCell};

/// The line of the table.
pub const ENTRY: StatisticEntry = StatisticEntry {
    name: "median",
    summary: "medians of error, evaluations and milliseconds with their 95 % bootstrap intervals",
    source: "Efron 1979",
    compute,
};

fn compute(group: &Group<'_>) -> Option<Table> {
    let row = |method: usize| {
        let of = |value: fn(&Record) -> f64| {
            let values: Vec<f64> = group.of(method).map(value).collect();
            let (middle, interval) = median_interval(&values).unwrap_or((f64::NAN, [f64::NAN; 2]));
            [TableCell::Number(middle), TableCell::Interval(interval)]
        };
        let mut cells = vec![TableCell::Text(group.methods[method].to_string())];
        cells.extend(of(error_of));
        cells.extend(of(|record| record.evaluations as f64));
        cells.extend(of(|record| 1e3 * record.seconds));
        cells
    };
    let columns = vec!["method", "median error", "95 %", "median evaluations", "95 %", "median ms", "95 %"];
    Some(Table { columns, rows: (0..group.methods.len()).map(row).collect() })
}
