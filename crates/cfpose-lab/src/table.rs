//! Tables as Markdown text: the summary, and our figures beside printed ones.

use std::collections::BTreeMap;

use serde_json::Value;

use crate::config::Experiment;
use crate::metric::POSE;
use crate::summary::{Calibration, SummaryRow};
use crate::value::canonical;

/// Return the parameters that differ between rows of one scenario, in their order: the columns worth printing.
pub fn varying_parameters(rows: &[SummaryRow]) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for row in rows {
        names.extend(row.parameters.keys().filter(|key| !names.contains(key)).cloned().collect::<Vec<_>>());
    }
    let mut first: BTreeMap<&str, &SummaryRow> = BTreeMap::new();
    for row in rows {
        first.entry(&row.scenario).or_insert(row);
    }
    let differs = |name: &str, row: &SummaryRow| {
        first.get(row.scenario.as_str()).is_some_and(|other| row.parameters.get(name) != other.parameters.get(name))
    };
    names.retain(|name| rows.iter().any(|row| differs(name, row)));
    names
}

/// Write a parameter for people.
pub(crate) fn show(value: Option<&Value>) -> String {
    match value {
        None => String::new(),
        Some(Value::String(text)) => text.clone(),
        Some(other) => other.to_string(),
    }
}

/// Render the summary: one row per cell and method, success in percent with its 95 % Wilson interval.
pub fn summary_table(rows: &[SummaryRow]) -> String {
    let varying = varying_parameters(rows);
    let many_scenarios = rows.iter().any(|row| row.scenario != rows[0].scenario);
    let mut header: Vec<String> = if many_scenarios { vec!["scenario".to_string()] } else { Vec::new() };
    header.extend(varying.iter().cloned());
    header.extend(
        [
            "method",
            "trials",
            "success %",
            "95 % interval",
            "median e",
            "median rot. deg",
            "median transl.",
            "median ms",
        ]
        .map(str::to_string),
    );
    let own = own_metrics(rows);
    header.extend(own.iter().map(|(name, unit)| match *unit {
        "1" => format!("median {name}"),
        unit => format!("median {name} ({unit})"),
    }));
    let with_statistics = rows.iter().any(|row| row.calibration.with_statistics > 0);
    if with_statistics {
        let columns = ["suspect %", "J alarms", "mean d^2", "95 % band", "median d^2", "confidently wrong"];
        header.extend(columns.map(str::to_string));
    }
    let body = rows.iter().map(|row| {
        let mut cells = if many_scenarios { vec![row.scenario.clone()] } else { Vec::new() };
        cells.extend(varying.iter().map(|name| show(row.parameters.get(name))));
        cells.extend([
            row.method.clone(),
            row.trials.to_string(),
            percent(row.successes, row.trials),
            interval(row.wilson95),
            number(row.median_error),
            number(row.median_rotation_deg),
            number(row.median_translation),
            row.median_seconds.map_or_else(dash, |s| format!("{:.1}", 1e3 * s)),
        ]);
        let value = |name: &str| row.metrics.iter().find(|metric| metric.name == name).and_then(|metric| metric.median);
        cells.extend(own.iter().map(|(name, _)| number(value(name))));
        if with_statistics {
            cells.extend(calibration(&row.calibration));
        }
        cells
    });
    markdown(&header, &body.collect::<Vec<_>>())
}

/// Return name and unit of the metrics that are not those of a pose, each once.
fn own_metrics(rows: &[SummaryRow]) -> Vec<(&'static str, &'static str)> {
    let mut own = Vec::new();
    for metric in rows.iter().flat_map(|row| &row.metrics) {
        let is_of_pose = POSE.iter().any(|pose| pose.name == metric.name);
        if !is_of_pose && !own.contains(&(metric.name, metric.unit)) {
            own.push((metric.name, metric.unit));
        }
    }
    own
}

/// Render every published table with our figures beside it: by e, and by the sum of angle and translation.
///
/// Empty when the experiment names no published figure.
pub fn published_tables(experiment: &Experiment, rows: &[SummaryRow]) -> String {
    let mut titles: Vec<&str> = Vec::new();
    for published in &experiment.published {
        if !titles.contains(&published.table.as_str()) {
            titles.push(&published.table);
        }
    }
    let tables = titles.iter().map(|title| format!("### {title}\n\n{}", published_table(experiment, rows, title)));
    tables.collect::<Vec<_>>().join("\n")
}

fn published_table(experiment: &Experiment, rows: &[SummaryRow], title: &str) -> String {
    let figures: Vec<_> = experiment.published.iter().filter(|figure| figure.table == title).collect();
    let mut names: Vec<&String> = Vec::new();
    for figure in &figures {
        names.extend(figure.parameters.keys().filter(|key| !names.contains(key)).collect::<Vec<_>>());
    }
    let mut header: Vec<String> = names.iter().map(|name| (*name).clone()).collect();
    header.extend(
        ["method", "published %", "ours %, e", "95 % interval", "ours %, sum", "95 % interval", "median e", "trials"]
            .map(str::to_string),
    );
    let mut body = Vec::new();
    for figure in figures {
        for row in rows {
            if !figure.matches(&texts_of(row), &row.method) {
                continue;
            }
            let mut cells: Vec<String> = names.iter().map(|name| show(row.parameters.get(*name))).collect();
            cells.extend([
                row.method.clone(),
                canonical(&figure.success.to_string()),
                percent(row.successes, row.trials),
                interval(row.wilson95),
                percent(row.successes_sum, row.trials),
                interval(crate::statistics::wilson95(row.successes_sum, row.trials)),
                number(row.median_error),
                row.trials.to_string(),
            ]);
            body.push(cells);
        }
    }
    markdown(&header, &body)
}

fn texts_of(row: &SummaryRow) -> Vec<(String, String)> {
    row.parameters.iter().map(|(key, value)| (key.clone(), show(Some(value)))).collect()
}

/// Write the columns of reported statistics.
fn calibration(calibration: &Calibration) -> [String; 6] {
    let count = |value: Option<usize>| value.map_or_else(dash, |v| v.to_string());
    [
        calibration.suspect_share.map_or_else(dash, |share| format!("{:.1}", 100.0 * share)),
        count(calibration.j_alarms),
        calibration.mean_mahalanobis.map_or_else(dash, |v| format!("{v:.2}")),
        calibration.mahalanobis_band.map_or_else(dash, |[low, high]| format!("{low:.2}..{high:.2}")),
        calibration.median_mahalanobis.map_or_else(dash, |v| format!("{v:.2}")),
        count(calibration.confidently_wrong),
    ]
}

pub(crate) fn percent(successes: usize, trials: usize) -> String {
    if trials == 0 { dash() } else { format!("{:.1}", 100.0 * successes as f64 / trials as f64) }
}

pub(crate) fn interval([low, high]: [f64; 2]) -> String {
    format!("{:.1}..{:.1}", 100.0 * low, 100.0 * high)
}

pub(crate) fn number(value: Option<f64>) -> String {
    match value {
        None => dash(),
        Some(v) if v != 0.0 && !(1e-4..1e4).contains(&v.abs()) => format!("{v:.2e}"),
        Some(v) => format!("{v:.4}"),
    }
}

fn dash() -> String {
    "-".to_string()
}

/// Lay out a Markdown table with aligned columns.
pub(crate) fn markdown(header: &[String], body: &[Vec<String>]) -> String {
    let mut widths: BTreeMap<usize, usize> = BTreeMap::new();
    for row in body.iter().map(Vec::as_slice).chain([header]) {
        for (column, text) in row.iter().enumerate() {
            let width = widths.entry(column).or_insert(3);
            *width = (*width).max(text.chars().count());
        }
    }
    let line = |row: &[String]| {
        let cells: Vec<String> =
            row.iter().enumerate().map(|(c, text)| format!("{text:>w$}", w = widths[&c])).collect();
        format!("| {} |\n", cells.join(" | "))
    };
    let rule: Vec<String> = (0..header.len()).map(|c| format!("{}:", "-".repeat(widths[&c] - 1))).collect();
    let body: String = body.iter().map(|row| line(row)).collect();
    format!("{}{}{body}", line(header), line(&rule))
}
