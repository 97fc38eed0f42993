//! Success rates with Wilson's interval.

use crate::group::Group;
use crate::statistics::{StatisticEntry, Table, TableCell, wilson95};

/// The line of the table.
pub const ENTRY: StatisticEntry =
    StatisticEntry { name: "success", summary: "success rate with its 95 % interval", source: "Wilson 1927", compute };

/// Return successes and trials of a method.
pub fn counts(group: &Group<'_>, method: usize) -> (usize, usize) {
    group.of(method).fold((0, 0), |(hits, all), record| (hits + usize::from(record.success), all + 1))
}

fn compute(group: &Group<'_>) -> Option<Table> {
    let row = |method: usize| {
        let (hits, trials) = counts(group, method);
        vec![
            TableCell::Text(group.methods[method].to_string()),
            TableCell::Count(trials),
            TableCell::Share(hits as f64 / trials as f64),
            TableCell::ShareInterval(wilson95(hits, trials)),
            TableCell::Count(group.of(method).filter(|record| record.is_wrong_but_good()).count()),
        ]
    };
    let rows = (0..group.methods.len()).map(row).collect();
    Some(Table { columns: vec!["method", "trials", "success %", "95 % interval", "wrong but good"], rows })
}
