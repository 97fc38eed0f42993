//! How often verdicts are wrong, by the conditions that a scenario draws at random.

use std::collections::BTreeMap;
use std::fmt::Write;

use crate::record::Record;
use crate::table::show;

/// Counts of the records of one method that share a condition.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Counts {
    /// Records.
    pub trials: usize,
    /// Right answers.
    pub right: usize,
    /// Answers called `good`.
    pub good: usize,
    /// Those of them that are wrong, or that the data do not determine.
    pub wrong_but_good: usize,
    /// Right answers that are not called `good` though the data determine theta.
    pub right_but_not_good: usize,
    /// Sum of squared Mahalanobis distances over degrees of freedom of the right answers, and how many have one.
    pub nees: (f64, usize),
    /// J statistics with p < .01, and how many have one, among the right answers of the means.
    pub alarms: (usize, usize),
}

impl Counts {
    /// Add a record.
    pub fn add(&mut self, record: &Record) {
        let good = record.verdict.as_deref() == Some("good");
        self.trials += 1;
        self.right += usize::from(record.success);
        self.good += usize::from(good);
        self.wrong_but_good += usize::from(record.is_wrong_but_good());
        self.right_but_not_good += usize::from(record.success && record.determined && !good);
        if let (true, Some(squared), Some(dof)) = (record.success, record.mahalanobis, record.mahalanobis_dof) {
            self.nees = (self.nees.0 + squared / dof as f64, self.nees.1 + 1);
        }
        if let (true, Some("moments"), Some(p)) = (record.success, record.by.as_deref(), record.p_value) {
            self.alarms = (self.alarms.0 + usize::from(p < crate::summary::ALARM_P), self.alarms.1 + 1);
        }
    }
}

/// Count the records of a method by condition and value; the first line is about all of them.
pub fn by_condition<'a>(records: impl Iterator<Item = &'a Record>) -> Vec<(String, String, Counts)> {
    let mut all = Counts::default();
    let mut groups: BTreeMap<(String, String), Counts> = BTreeMap::new();
    for record in records {
        all.add(record);
        for (name, value) in &record.conditions {
            groups.entry((name.clone(), show(Some(value)))).or_default().add(record);
        }
    }
    let lines = groups.into_iter().map(|((name, value), counts)| (name, value, counts));
    std::iter::once(("all".to_string(), String::new(), all)).chain(lines).collect()
}

/// Return a table in Markdown for every method whose scenario draws conditions; empty where none does.
pub fn condition_tables(records: &[Record]) -> String {
    let mut cells: BTreeMap<(&str, &str), Vec<&Record>> = BTreeMap::new();
    for record in records.iter().filter(|record| !record.conditions.is_empty()) {
        cells.entry((&record.scenario, &record.method)).or_default().push(record);
    }
    let mut text = String::new();
    for ((scenario, method), records) in cells {
        let _ = writeln!(text, "### How often verdicts are wrong: {scenario}, {method}\n");
        text.push_str(
            "| condition | value | trials | right | good | wrong but good | right, not good | NEES / dof | J alarms at 1 % |\n\
             |---|---|---|---|---|---|---|---|---|\n",
        );
        for (name, value, counts) in by_condition(records.into_iter()) {
            let nees = match counts.nees {
                (_, 0) => "-".to_string(),
                (sum, count) => format!("{:.2}", sum / count as f64),
            };
            let _ = writeln!(
                text,
                "| {name} | {value} | {} | {} | {} | {} | {} | {nees} | {} of {} |",
                counts.trials,
                counts.right,
                counts.good,
                counts.wrong_but_good,
                counts.right_but_not_good,
                counts.alarms.0,
                counts.alarms.1
            );
        }
        text.push('\n');
    }
    text
}
