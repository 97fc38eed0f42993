//! Files made from records: CSV tables and a self-contained page.

use std::collections::BTreeSet;
use std::fmt::Write;

use serde_json::Value;

use crate::config::Experiment;
use crate::record::Record;
use crate::summary::SummaryRow;
use crate::table::{self, show};

/// Return `results.csv`: one row a record, in the order given, without any time.
pub fn results_csv(records: &[Record]) -> String {
    let mut names: Vec<&String> = Vec::new();
    for record in records {
        names.extend(record.parameters.keys().filter(|key| !names.contains(key)).collect::<Vec<_>>());
    }
    let parameters: String = names.iter().map(|name| format!("{},", quoted(name))).collect();
    let metrics: BTreeSet<&String> = records.iter().flat_map(|record| record.metrics.keys()).collect();
    let own: String = metrics.iter().map(|name| format!(",{}", quoted(name))).collect();
    let mut text = format!(
        "scenario,{parameters}method,repetition,key,success,success_sum,rotation_deg,translation,error,e_sum,\
         status,usable,verdict,noise_sigma,j_statistic,degrees_of_freedom,p_value,mahalanobis,cost,evaluations,iterations,starts,timed_out,isa{own}\n"
    );
    for record in records {
        let mut cells = vec![record.scenario.clone()];
        cells.extend(names.iter().map(|name| show(record.parameters.get(*name))));
        cells.extend([
            record.method.clone(),
            record.repetition.to_string(),
            record.key.clone(),
            record.success.to_string(),
            record.success_sum.to_string(),
        ]);
        cells.extend([record.rotation_deg, record.translation, record.error, record.e_sum].map(number));
        cells.extend([
            record.status.clone(),
            record.usable.to_string(),
            record.verdict.clone().unwrap_or_default(),
            number(record.noise_sigma),
            number(record.j_statistic),
            record.degrees_of_freedom.map_or_else(String::new, |dof| dof.to_string()),
            number(record.p_value),
            number(record.mahalanobis),
            number(record.cost),
            record.evaluations.to_string(),
            record.iterations.to_string(),
            record.starts.to_string(),
            record.timed_out.to_string(),
            record.isa.clone(),
        ]);
        cells.extend(metrics.iter().map(|name| number(record.metrics.get(*name).copied())));
        push_row(&mut text, &cells);
    }
    text
}

/// Return `timings.csv`: key, method, seconds.
pub fn timings_csv(records: &[Record]) -> String {
    let mut text = "key,method,repetition,seconds\n".to_string();
    for record in records {
        let cells =
            [record.key.clone(), record.method.clone(), record.repetition.to_string(), record.seconds.to_string()];
        push_row(&mut text, &cells);
    }
    text
}

fn push_row(text: &mut String, cells: &[String]) {
    let quoted: Vec<String> = cells.iter().map(|cell| quoted(cell)).collect();
    text.push_str(&quoted.join(","));
    text.push('\n');
}

fn number(value: Option<f64>) -> String {
    value.map_or_else(String::new, |v| Value::from(v).to_string())
}

/// Quote a cell of a CSV file where it needs quoting (RFC 4180).
fn quoted(cell: &str) -> String {
    if cell.contains(['"', ',', '\n', '\r']) { format!("\"{}\"", cell.replace('"', "\"\"")) } else { cell.to_string() }
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

const STYLE: &str = "body{font:15px/1.5 system-ui,sans-serif;max-width:72em;margin:2em auto;padding:0 1em;color:#222}\
table{border-collapse:collapse;margin:1em 0}td,th{padding:.25em .7em;border-bottom:1px solid #ddd;text-align:right}\
th{background:#f4f4f4}pre{background:#f7f7f7;padding:1em;overflow:auto}svg{vertical-align:middle}";

/// Return `report.html`: a table with intervals drawn, the comparison with printed figures, the experiment. No file, font
/// or script from elsewhere is needed.
pub fn html(experiment: &Experiment, rows: &[SummaryRow], records: usize, expected: usize) -> String {
    let mut page = format!(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>cfpose experiment {fingerprint}</title>\
         <style>{STYLE}</style></head><body>\n<h1>Experiment {fingerprint}</h1>\n\
         <p>{records} of {expected} records, seed {seed}. Bars: success rate with its 95 % Wilson interval. \
         Medians are over all trials.</p>\n",
        fingerprint = experiment.fingerprint(),
        seed = experiment.seed,
    );
    page.push_str(&summary_html(rows));
    let published = table::published_tables(experiment, rows);
    if !published.is_empty() {
        let _ = write!(page, "<h2>Beside printed figures</h2>\n<pre>{}</pre>\n", escaped(&published));
    }
    let _ =
        write!(page, "<h2>Resolved experiment</h2>\n<pre>{}</pre>\n</body></html>\n", escaped(&experiment.to_toml()));
    page
}

fn summary_html(rows: &[SummaryRow]) -> String {
    let varying = table::varying_parameters(rows);
    let parameters: String = varying.iter().map(|name| format!("<th>{}</th>", escaped(name))).collect();
    let mut text = format!(
        "<table><tr><th>scenario</th>{parameters}<th>method</th><th>trials</th><th>success</th><th>95 % interval</th>\
         <th></th><th>median e</th><th>median rotation, deg</th><th>median translation</th><th>wrong but good</th>\
         <th>median ms</th></tr>\n"
    );
    for row in rows {
        let mut cells = vec![escaped(&row.scenario)];
        cells.extend(varying.iter().map(|name| escaped(&show(row.parameters.get(name)))));
        let fixed = |value: Option<f64>, digits| value.map_or_else(|| "-".to_string(), |v| format!("{v:.digits$}"));
        let percent = |fraction: f64| format!("{:.1}", 100.0 * fraction);
        cells.extend([
            escaped(&row.method),
            row.trials.to_string(),
            row.success_rate.map_or_else(|| "-".to_string(), |rate| format!("{} %", percent(rate))),
            format!("{} .. {}", percent(row.wilson95[0]), percent(row.wilson95[1])),
            bar(row),
            fixed(row.median_error, 5),
            fixed(row.median_rotation_deg, 4),
            fixed(row.median_translation, 5),
            row.wrong_but_good.to_string(),
            fixed(row.median_seconds.map(|s| 1e3 * s), 1),
        ]);
        let cells: String = cells.iter().map(|cell| format!("<td>{cell}</td>")).collect();
        let _ = writeln!(text, "<tr>{cells}</tr>");
    }
    text + "</table>\n"
}

/// Draw a rate and its interval.
fn bar(row: &SummaryRow) -> String {
    let Some(rate) = row.success_rate else { return String::new() };
    let [low, high] = row.wilson95.map(|x| 160.0 * x);
    format!(
        "<svg width=\"162\" height=\"14\"><rect width=\"160\" height=\"14\" fill=\"#eee\"/>\
         <rect width=\"{:.1}\" height=\"14\" fill=\"#8ab6d6\"/>\
         <path d=\"M{low:.1} 7H{high:.1}M{low:.1} 3v8M{high:.1} 3v8\" stroke=\"#123\" fill=\"none\"/></svg>",
        160.0 * rate
    )
}
