//! The summary as a table of the page and as rows of a CSV file.

use std::fmt::Write;

use serde_json::Value;

use super::escaped;
use crate::summary::SummaryRow;
use crate::table::{show, varying_parameters};

/// Headings after scenario and parameters.
const COLUMNS: [&str; 12] = [
    "method",
    "trials",
    "successes",
    "success_rate",
    "wilson_low",
    "wilson_high",
    "median_error",
    "median_rotation_deg",
    "median_translation",
    "wrong_but_good",
    "median_evaluations",
    "median_seconds",
];

/// Return a heading and one row for every row of the summary.
pub(super) fn csv_rows(rows: &[SummaryRow]) -> Vec<Vec<Value>> {
    let varying = varying_parameters(rows);
    let mut header: Vec<Value> = vec!["scenario".into()];
    header.extend(varying.iter().map(|name| Value::from(name.as_str())));
    header.extend(COLUMNS.map(Value::from));
    let row = |row: &SummaryRow| {
        let mut cells: Vec<Value> = vec![row.scenario.as_str().into()];
        cells.extend(varying.iter().map(|name| row.parameters.get(name).cloned().unwrap_or_default()));
        cells.extend([row.method.as_str().into(), row.trials.into(), row.successes.into()]);
        let numbers = [
            row.success_rate,
            Some(row.wilson95[0]),
            Some(row.wilson95[1]),
            row.median_error,
            row.median_rotation_deg,
            row.median_translation,
            Some(row.wrong_but_good as f64),
            row.median_evaluations,
            row.median_seconds,
        ];
        cells.extend(numbers.map(|number| number.map(crate::figure::short).into()));
        cells
    };
    std::iter::once(header).chain(rows.iter().map(row)).collect()
}

/// Return the summary as a table, at most so many rows.
pub(super) fn table_html(rows: &[SummaryRow], limit: usize) -> String {
    let varying = varying_parameters(rows);
    let parameters: String = varying.iter().map(|name| format!("<th>{}</th>", escaped(name))).collect();
    let mut text = format!(
        "<table><thead><tr><th class=\"words\">scenario</th>{parameters}<th class=\"words\">method</th><th>trials</th><th>success</th>\
         <th>95 % interval</th><th></th><th>median e</th><th>median rotation, deg</th><th>median translation</th>\
         <th>wrong but good</th><th>median ms</th></tr></thead><tbody>\n"
    );
    for row in rows.iter().take(limit) {
        let fixed = |value: Option<f64>, digits| value.map_or_else(|| "-".to_string(), |v| format!("{v:.digits$}"));
        let percent = |fraction: f64| format!("{:.1}", 100.0 * fraction);
        let _ = write!(text, "<tr><td class=\"words\">{}</td>", escaped(&row.scenario));
        for name in &varying {
            let _ = write!(text, "<td>{}</td>", escaped(&show(row.parameters.get(name))));
        }
        let _ = write!(text, "<td class=\"words\">{}</td>", escaped(&row.method));
        for cell in [
            row.trials.to_string(),
            row.success_rate.map_or_else(|| "-".to_string(), |rate| format!("{} %", percent(rate))),
            format!("{} .. {}", percent(row.wilson95[0]), percent(row.wilson95[1])),
            bar(row),
            fixed(row.median_error, 5),
            fixed(row.median_rotation_deg, 4),
            fixed(row.median_translation, 5),
            row.wrong_but_good.to_string(),
            fixed(row.median_seconds.map(|s| 1e3 * s), 2),
        ] {
            let _ = write!(text, "<td>{cell}</td>");
        }
        text.push_str("</tr>\n");
    }
    text.push_str("</tbody></table>\n");
    if rows.len() > limit {
        let _ = writeln!(text, "<p>The first {limit} of {} rows; all of them stand in summary.json.</p>", rows.len());
    }
    text
}

/// Draw a rate and its interval.
fn bar(row: &SummaryRow) -> String {
    let Some(rate) = row.success_rate else { return String::new() };
    let [low, high] = row.wilson95.map(|x| 120.0 * x);
    format!(
        "<svg width=\"122\" height=\"12\"><rect width=\"120\" height=\"12\" rx=\"2\" fill=\"var(--grid)\"/>\
         <rect width=\"{:.1}\" height=\"12\" rx=\"2\" fill=\"var(--m0)\" opacity=\".55\"/>\
         <path d=\"M{low:.1} 6H{high:.1}M{low:.1} 2v8M{high:.1} 2v8\" stroke=\"var(--ink)\" fill=\"none\"/></svg>",
        120.0 * rate
    )
}
