//! From records to one row per cell and method.

use std::collections::BTreeMap;

use serde::Serialize;
use serde_json::{Map, Value};

use crate::plan::Plan;
use crate::record::Record;
use crate::statistics::{median, wilson95};
use crate::value::json_of;

/// One element of `summary.json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SummaryRow {
    /// Name of the scenario.
    pub scenario: String,
    /// All parameters of the cell.
    pub parameters: Map<String, Value>,
    /// Name of the method.
    pub method: String,
    /// Number of records.
    pub trials: usize,
    /// Usable estimates within the threshold.
    pub successes: usize,
    /// successes / trials, null without trials.
    pub success_rate: Option<f64>,
    /// 95 % Wilson interval of the rate.
    pub wilson95: [f64; 2],
    /// Median angle in degrees, over all trials; a trial without an estimate counts as infinite (null when the median is).
    pub median_rotation_deg: Option<f64>,
    /// Median norm of the difference of translations, likewise.
    pub median_translation: Option<f64>,
    /// Median of e = sqrt(angle^2 + translation^2), likewise.
    pub median_error: Option<f64>,
    /// Estimates with verdict `good` that are no success.
    pub wrong_but_good: usize,
    /// Median wall-clock seconds.
    pub median_seconds: Option<f64>,
    /// Successes by the sum of angle and translation.
    pub successes_sum: usize,
    /// Median number of residual evaluations.
    pub median_evaluations: Option<f64>,
}

/// Summarise records by cell and method, in the order of the plan; cells without a record give a row of 0 trials.
///
/// Records of trials that are not in the plan are left out.
pub fn summarise(plan: &Plan, records: &[Record]) -> Vec<SummaryRow> {
    let cells: BTreeMap<String, usize> =
        plan.trials.iter().map(|trial| (format!("{:016x}", trial.key), trial.cell)).collect();
    let mut groups: BTreeMap<(usize, &str), Vec<&Record>> = BTreeMap::new();
    for record in records {
        if let Some(cell) = cells.get(&record.key) {
            groups.entry((*cell, &record.method)).or_default().push(record);
        }
    }
    let mut rows = Vec::new();
    for (index, cell) in plan.cells.iter().enumerate() {
        let parameters: Map<_, _> = cell.parameters.iter().map(|(key, text)| (key.clone(), json_of(text))).collect();
        for method in &plan.methods {
            let mine = groups.get(&(index, method.as_str())).map_or(&[][..], Vec::as_slice);
            rows.push(row(&cell.scenario, &parameters, method, mine));
        }
    }
    rows
}

fn row(scenario: &str, parameters: &Map<String, Value>, method: &str, records: &[&Record]) -> SummaryRow {
    let count = |holds: &dyn Fn(&Record) -> bool| records.iter().filter(|r| holds(r)).count();
    let middle = |value: &dyn Fn(&Record) -> Option<f64>| {
        let values: Vec<f64> = records.iter().map(|r| value(r).unwrap_or(f64::INFINITY)).collect();
        median(&values).filter(|v| v.is_finite())
    };
    let (trials, successes) = (records.len(), count(&|r| r.success));
    SummaryRow {
        scenario: scenario.to_string(),
        parameters: parameters.clone(),
        method: method.to_string(),
        trials,
        successes,
        success_rate: (trials > 0).then(|| successes as f64 / trials as f64),
        wilson95: wilson95(successes, trials),
        median_rotation_deg: middle(&|r| r.rotation_deg),
        median_translation: middle(&|r| r.translation),
        median_error: middle(&|r| r.error),
        wrong_but_good: count(&|r| r.verdict.as_deref() == Some("good") && !r.success),
        median_seconds: middle(&|r| Some(r.seconds)),
        successes_sum: count(&|r| r.success_sum),
        median_evaluations: middle(&|r| Some(r.evaluations as f64)),
    }
}
