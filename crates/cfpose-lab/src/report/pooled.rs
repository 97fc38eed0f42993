//! The pooled table of a page: cells that agree in the parameters of [`Page`] make one row, or one column.

use std::collections::BTreeMap;

use crate::config::Page;
use crate::group::error_of;
use crate::record::Record;
use crate::statistics::{median, wilson95};
use crate::table::{interval, markdown, number, percent, show};

/// Return the table of the page: rows of `by` and method; columns are what was measured or, with `across`, the combinations of its
/// values, each with successes of trials and the median number of evaluations.
///
/// Rows and columns come in the order of the records.
pub fn pooled_table(page: &Page, records: &[Record]) -> String {
    if page.across.is_empty() { measured(page, records) } else { crossed(page, records) }
}

/// Records of one row, by the values of its parameters and the method.
type Pools<'a> = Vec<(Vec<String>, Vec<&'a Record>)>;

/// Pool records by what a function says of them, in the order in which its values come first.
fn pool<'a>(records: &[&'a Record], key: impl Fn(&Record) -> Vec<String>) -> Pools<'a> {
    let mut places: BTreeMap<Vec<String>, usize> = BTreeMap::new();
    let mut pools: Pools<'a> = Vec::new();
    for &record in records {
        let key = key(record);
        let place = *places.entry(key.clone()).or_insert(pools.len());
        if place == pools.len() {
            pools.push((key, Vec::new()));
        }
        pools[place].1.push(record);
    }
    pools
}

/// Return a record's values of some parameters; empty where its scenario does not have one.
fn values(record: &Record, names: &[String]) -> Vec<String> {
    let value = |name: &String| match name.as_str() {
        "scenario" => record.scenario.clone(),
        name => show(record.parameters.get(name)),
    };
    names.iter().map(value).collect()
}

fn with_method(record: &Record, names: &[String]) -> Vec<String> {
    let mut key = values(record, names);
    key.push(record.method.clone());
    key
}

fn header(names: &[String], more: &[&str]) -> Vec<String> {
    names.iter().cloned().chain(more.iter().map(ToString::to_string)).collect()
}

fn successes(records: &[&Record]) -> usize {
    records.iter().filter(|record| record.success).count()
}

fn median_evaluations(records: &[&Record]) -> String {
    let evaluations: Vec<f64> = records.iter().map(|record| record.evaluations as f64).collect();
    median(&evaluations).map_or_else(|| "-".to_string(), |value| format!("{value:.0}"))
}

/// One row for each pool: trials, success with its interval, verdicts, median error, evaluations and seconds.
fn measured(page: &Page, records: &[Record]) -> String {
    let all: Vec<&Record> = records.iter().collect();
    let columns = [
        "method",
        "trials",
        "success %",
        "95 % interval",
        "good",
        "wrong but good",
        "median error",
        "median evaluations",
        "median s",
    ];
    let body = pool(&all, |record| with_method(record, &page.by)).into_iter().map(|(mut cells, records)| {
        let trials = records.len();
        let right = successes(&records);
        let is_good = |record: &&&Record| record.verdict.as_deref() == Some("good");
        let good = records.iter().filter(is_good).count();
        let wrong = records.iter().filter(is_good).filter(|record| !record.success || !record.determined).count();
        let has_verdict = records.iter().any(|record| record.verdict.is_some());
        let errors: Vec<f64> = records.iter().map(|record| error_of(record)).collect();
        let seconds: Vec<f64> = records.iter().map(|record| record.seconds).collect();
        let of_verdict = |count: usize| if has_verdict { count.to_string() } else { "no verdict".to_string() };
        cells.extend([
            trials.to_string(),
            percent(right, trials),
            interval(wilson95(right, trials)),
            of_verdict(good),
            of_verdict(wrong),
            number(median(&errors).filter(|value| value.is_finite())),
            median_evaluations(&records),
            median(&seconds).map_or_else(|| "-".to_string(), |value| format!("{value:.3}")),
        ]);
        cells
    });
    markdown(&header(&page.by, &columns), &body.collect::<Vec<_>>())
}

/// One row for each combination of `by` and method, one column for each of `across`.
fn crossed(page: &Page, records: &[Record]) -> String {
    let all: Vec<&Record> = records.iter().collect();
    let column = |record: &Record| vec![values(record, &page.across).join(" ").trim().to_string()];
    let columns: Vec<String> = pool(&all, column).into_iter().flat_map(|(name, _)| name).collect();
    let body = pool(&all, |record| with_method(record, &page.by)).into_iter().map(|(mut cells, records)| {
        let by_column: BTreeMap<String, Vec<&Record>> =
            pool(&records, column).into_iter().map(|(mut name, records)| (name.remove(0), records)).collect();
        cells.extend(columns.iter().map(|name| {
            by_column.get(name).map_or_else(
                || "-".to_string(),
                |records| format!("{} of {} ({})", successes(records), records.len(), median_evaluations(records)),
            )
        }));
        cells
    });
    let titles: Vec<&str> = std::iter::once("method").chain(columns.iter().map(String::as_str)).collect();
    markdown(&header(&page.by, &titles), &body.collect::<Vec<_>>())
}
