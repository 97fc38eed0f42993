//! From records to one row per cell and method.

use std::collections::BTreeMap;

use serde::Serialize;
use serde_json::{Map, Value};

use crate::calibration::mean_band;
use crate::metric::Metric;
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
    /// The scenario's metrics with their medians over all trials, in its order.
    pub metrics: Vec<MetricRow>,
    /// Whether reported uncertainties are true.
    #[serde(flatten)]
    pub calibration: Calibration,
}

/// One metric of a row.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MetricRow {
    /// Name.
    pub name: &'static str,
    /// Unit.
    pub unit: &'static str,
    /// Whether a smaller value is a better one.
    pub smaller_is_better: bool,
    /// Median; a trial without a value counts as infinitely bad (null when the median is).
    pub median: Option<f64>,
}

impl MetricRow {
    fn of(metric: &Metric, records: &[&Record]) -> Self {
        let Metric { name, unit, smaller_is_better } = *metric;
        let worst = if smaller_is_better { f64::INFINITY } else { f64::NEG_INFINITY };
        let values: Vec<f64> = records.iter().map(|record| record.metric(name).unwrap_or(worst)).collect();
        Self { name, unit, smaller_is_better, median: median(&values).filter(|value| value.is_finite()) }
    }
}

/// A J statistic with a smaller probability is an alarm.
pub const ALARM_P: f64 = 0.01;
/// An error beyond so many predicted standard deviations is confidently wrong.
pub const CONFIDENT_SIGMAS: f64 = 10.0;

/// How the reported statistics of a cell compare with the errors; null where no record has statistics.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Calibration {
    /// Records that report a J statistic.
    pub with_statistics: usize,
    /// Share of verdict `suspect` among them.
    pub suspect_share: Option<f64>,
    /// Number of them with p < [`ALARM_P`].
    pub j_alarms: Option<usize>,
    /// Mean squared Mahalanobis error of the records with verdict `good`.
    pub mean_mahalanobis: Option<f64>,
    /// Where 95 % of such means lie if the reported covariances are true ([`crate::calibration::mean_band`]).
    pub mahalanobis_band: Option<[f64; 2]>,
    /// Median of the same errors; 5.35 for a pose with true covariances.
    pub median_mahalanobis: Option<f64>,
    /// Records with verdict `good` and an error beyond [`CONFIDENT_SIGMAS`] predicted standard deviations: the square root of
    /// the squared Mahalanobis error.
    pub confidently_wrong: Option<usize>,
}

impl Calibration {
    /// Compare the records of one cell and method.
    pub fn of(records: &[&Record]) -> Self {
        let reported: Vec<&&Record> = records.iter().filter(|r| r.j_statistic.is_some()).collect();
        if reported.is_empty() {
            return Self::default();
        }
        let count = |holds: &dyn Fn(&Record) -> bool| reported.iter().filter(|r| holds(r)).count();
        let good: Vec<(f64, usize)> = reported
            .iter()
            .filter(|r| r.verdict.as_deref() == Some("good"))
            .filter_map(|r| Some((r.mahalanobis?, r.mahalanobis_dof?)))
            .collect();
        let squares: Vec<f64> = good.iter().map(|(squared, _)| *squared).collect();
        let dof = good.first().map_or(0, |(_, dof)| *dof);
        Self {
            with_statistics: reported.len(),
            suspect_share: Some(count(&|r| r.verdict.as_deref() == Some("suspect")) as f64 / reported.len() as f64),
            j_alarms: Some(count(&|r| r.p_value.is_some_and(|p| p < ALARM_P))),
            mean_mahalanobis: (!good.is_empty()).then(|| squares.iter().sum::<f64>() / good.len() as f64),
            mahalanobis_band: mean_band(dof, good.len()),
            median_mahalanobis: median(&squares),
            confidently_wrong: Some(squares.iter().filter(|s| s.sqrt() > CONFIDENT_SIGMAS).count()),
        }
    }
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
            let metrics = plan.metrics[index].iter().map(|metric| MetricRow::of(metric, mine)).collect();
            rows.push(row(&cell.scenario, &parameters, method, mine, metrics));
        }
    }
    rows
}

fn row(
    scenario: &str,
    parameters: &Map<String, Value>,
    method: &str,
    records: &[&Record],
    metrics: Vec<MetricRow>,
) -> SummaryRow {
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
        wrong_but_good: count(&Record::is_wrong_but_good),
        median_seconds: middle(&|r| Some(r.seconds)),
        successes_sum: count(&|r| r.success_sum),
        median_evaluations: middle(&|r| Some(r.evaluations as f64)),
        metrics,
        calibration: Calibration::of(records),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(verdict: &str, p_value: Option<f64>, mahalanobis: Option<f64>) -> Record {
        let text = r#"{"experiment": "", "scenario": "", "parameters": {}, "method": "", "repetition": 0, "key": "",
            "success": false, "success_sum": false, "status": "", "usable": true, "evaluations": 0, "iterations": 0,
            "starts": 1, "isa": "", "seconds": 0}"#;
        let record: Record = serde_json::from_str(text).unwrap();
        Record {
            verdict: Some(verdict.to_string()),
            j_statistic: p_value.map(|_| 1.0),
            p_value,
            mahalanobis,
            mahalanobis_dof: mahalanobis.map(|_| 6),
            ..record
        }
    }

    #[test]
    fn calibration_counts_what_it_says() {
        let records = [
            record("good", Some(0.5), Some(5.0)),
            record("good", Some(0.009), Some(9.0)),
            record("good", Some(0.2), Some(101.0)),
            record("suspect", Some(1e-9), Some(1e6)),
            record("failed", None, None),
        ];
        let all: Vec<&Record> = records.iter().collect();
        let of = Calibration::of(&all);
        assert_eq!((of.with_statistics, of.suspect_share, of.j_alarms), (4, Some(0.25), Some(2)));
        assert_eq!((of.mean_mahalanobis, of.median_mahalanobis), (Some(115.0 / 3.0), Some(9.0)));
        assert_eq!((of.confidently_wrong, of.mahalanobis_band), (Some(1), mean_band(6, 3)));
        let none = Calibration::of(&all[4..]);
        assert_eq!(none, Calibration::default());
        assert!(serde_json::to_value(&none).unwrap()["suspect_share"].is_null());
    }
}
