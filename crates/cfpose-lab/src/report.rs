//! Files made from records: CSV tables, a self-contained page, figures and tables for papers.

pub mod docs;
pub(crate) mod export;
mod html;
pub mod latex;
mod pooled;
mod summary;

use std::borrow::Cow;
use std::collections::BTreeSet;

use rayon::prelude::*;
use serde_json::{Value, json};

use crate::config::Experiment;
use crate::group::{Group, groups};
use crate::plan::Plan;
use crate::record::Record;
use crate::statistics::{self, StatisticEntry, Table};
use crate::table::show;

pub use html::{Contents, html};

/// A group of trials and what the statistics say about it.
pub struct Analysis<'a> {
    /// The trials.
    pub group: Group<'a>,
    /// The statistics that the trials can tell, in the order of their table.
    pub tables: Vec<(&'static StatisticEntry, Table)>,
}

/// Compute all statistics of all groups of trials.
pub fn analyse<'a>(experiment: &Experiment, plan: &'a Plan, records: &'a [Record]) -> Vec<Analysis<'a>> {
    let analyse = |group: Group<'a>| {
        let tables = statistics::ALL.iter().filter_map(|entry| Some((entry, (entry.compute)(&group)?))).collect();
        Analysis { group, tables }
    };
    groups(experiment, plan, records).into_par_iter().map(analyse).collect()
}

/// Return `statistics.json`: for every group of trials and every statistic one object with its table.
pub fn statistics_json(analyses: &[Analysis<'_>]) -> Value {
    let mut all = Vec::new();
    for Analysis { group, tables } in analyses {
        for (entry, table) in tables {
            all.push(json!({
                "scenario": group.scenario,
                "cell": group.cell,
                "parameters": group.parameters,
                "statistic": entry.name,
                "columns": table.columns,
                "rows": table.rows,
            }));
        }
    }
    Value::Array(all)
}

/// Return `results.csv`: one row a record, in the order given, without any time.
pub fn results_csv(records: &[Record]) -> String {
    let mut names: Vec<&String> = Vec::new();
    let mut last = None;
    for record in records {
        // Cells of a scenario have the same parameters, and stand together.
        if last.replace(&record.scenario) == Some(&record.scenario) {
            continue;
        }
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
    for (place, cell) in cells.iter().enumerate() {
        if place > 0 {
            text.push(',');
        }
        text.push_str(&quoted(cell));
    }
    text.push('\n');
}

fn number(value: Option<f64>) -> String {
    value.map_or_else(String::new, |v| Value::from(v).to_string())
}

/// Quote a cell of a CSV file where it needs quoting (RFC 4180).
fn quoted(cell: &str) -> Cow<'_, str> {
    if cell.contains(['"', ',', '\n', '\r']) {
        format!("\"{}\"", cell.replace('"', "\"\"")).into()
    } else {
        cell.into()
    }
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
