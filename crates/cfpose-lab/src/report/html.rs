//! `report.html`: one file with everything in it; no server, font, script or picture from elsewhere.

use std::fmt::Write;

use rayon::prelude::*;
use serde::Serialize;
use serde_json::{Value, json};

use super::{Analysis, escaped, summary};
use crate::config::Experiment;
use crate::figure::short;
use crate::plan::Plan;
use crate::plots;
use crate::record::{Record, VERSION};
use crate::statistics::{StatisticEntry, TableCell};
use crate::summary::SummaryRow;
use crate::table;

const PAGE: &str = include_str!("page/page.html");
const STYLE: &str = include_str!("page/style.css");
const SCRIPT: [&str; 5] = [
    include_str!("page/scale.js"),
    include_str!("page/chart.js"),
    include_str!("page/maps.js"),
    include_str!("page/files.js"),
    include_str!("page/report.js"),
];

/// Bytes that figures and tables of groups may take; groups beyond are named and left out.
const GROUP_BYTES: usize = 5_000_000;
/// Bytes that the trials themselves may take; beyond they stand in `results.csv` alone.
const TRIAL_BYTES: usize = 3_700_000;
/// Most rows of the summary in the page; all of them stand in `summary.json`.
const MAX_ROWS: usize = 1000;
/// Points of a curve, at least and at most.
const POINTS: [usize; 2] = [16, 160];
/// What a point of a curve takes in bytes, and how many curves a method has in a group, about.
const POINT_BYTES: usize = 50;
const CURVES: usize = 6;

/// What a page is made of.
pub struct Contents<'a> {
    /// The experiment.
    pub experiment: &'a Experiment,
    /// Its plan.
    pub plan: &'a Plan,
    /// All records that are there.
    pub records: &'a [Record],
    /// Rows of the summary.
    pub rows: &'a [SummaryRow],
    /// Groups of trials with their statistics.
    pub analyses: &'a [Analysis<'a>],
    /// Name of the experiment, for the title.
    pub name: &'a str,
}

/// Return the text of the page.
pub fn html(contents: &Contents<'_>) -> String {
    let Contents { experiment, plan, records, rows, name, .. } = contents;
    let expected = plan.num_records();
    let facts = format!(
        "{} cells, {} methods, {} trials; {} of {expected} records, seed {}",
        plan.cells.len(),
        plan.methods.len(),
        plan.trials.len(),
        records.len(),
        experiment.seed
    );
    let published = table::published_tables(experiment, rows);
    let published = if published.is_empty() {
        String::new()
    } else {
        format!("<h2>Published figures</h2>\n<pre>{}</pre>", escaped(&published))
    };
    let footer = format!(
        "Made by cfpose {VERSION}. Intervals are 95 %. A trial without an estimate counts as a failure with an infinite error. \
         All records stand in <a href=\"results.csv\">results.csv</a> beside this page, all tables of statistics in \
         <a href=\"statistics.json\">statistics.json</a>."
    );
    let parts = [
        ("title", escaped(&format!("Experiment {name}"))),
        ("facts", facts),
        ("style", STYLE.to_string()),
        ("summary", summary::table_html(rows, MAX_ROWS)),
        ("published", published),
        ("machine", machine(contents)),
        ("experiment", escaped(&experiment.to_toml())),
        ("footer", footer),
        ("data", data(contents)),
        ("script", SCRIPT.join("\n")),
    ];
    fill(PAGE, &parts)
}

/// Put texts into the places `{{name}}` of a page.
fn fill(page: &str, parts: &[(&str, String)]) -> String {
    let mut filled = String::new();
    for (number, piece) in page.split("{{").enumerate() {
        match piece.split_once("}}") {
            Some((name, rest)) if number > 0 => {
                filled.extend(parts.iter().filter(|(part, _)| *part == name).map(|(_, text)| text.as_str()));
                filled.push_str(rest);
            }
            _ => filled.push_str(piece),
        }
    }
    filled
}

/// Return what computed the records, as terms and descriptions.
fn machine(contents: &Contents<'_>) -> String {
    let isa = contents.records.first().map_or("-", |record| record.isa.as_str());
    let version = contents.records.first().map_or(VERSION, |record| record.version.as_str());
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let facts = [
        ("Program", format!("cfpose {version}")),
        ("Experiment", format!("{}, seed {}", contents.experiment.fingerprint(), contents.experiment.seed)),
        ("Instruction set of the records", isa.to_string()),
        (
            "Merged on",
            format!("{} {}, {}, {threads} thread(s)", std::env::consts::OS, std::env::consts::ARCH, processor()),
        ),
        ("Solver time of all records", format!("{:.1} s", contents.records.iter().map(|r| r.seconds).sum::<f64>())),
    ];
    facts.iter().map(|(term, text)| format!("<dt>{term}</dt><dd>{}</dd>\n", escaped(text))).collect()
}

/// Return the name of the processor, where the system says it.
fn processor() -> String {
    let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let name = text.lines().find(|line| line.starts_with("model name")).and_then(|line| line.split_once(':'));
    name.map_or_else(|| "unknown processor".to_string(), |(_, name)| name.trim().to_string())
}

/// A script element that holds JSON.
fn element(id: &str, value: &impl Serialize) -> String {
    // Within JSON a `<` stands in texts only, where it may be written so; `</script>` cannot end the element.
    let text = serde_json::to_string(value).unwrap_or_default().replace('<', "\\u003c");
    format!("<script type=\"application/json\" id=\"{id}\">{text}</script>\n")
}

fn data(contents: &Contents<'_>) -> String {
    let groups = contents.analyses;
    let curves = groups.len() * contents.plan.methods.len() * CURVES;
    let points = (GROUP_BYTES / (POINT_BYTES * curves.max(1))).clamp(POINTS[0], POINTS[1]);
    // All cells together first: they are what a reader must have.
    let mut order: Vec<usize> = (0..groups.len()).collect();
    order.sort_by_key(|number| (!groups[*number].group.cell.is_empty(), *number));
    let (mut text, mut kept) = (String::new(), vec![false; groups.len()]);
    // A few at a time, on all threads, until the page is full.
    for batch in order.chunks(32) {
        if text.len() >= GROUP_BYTES {
            break;
        }
        let make = |number: &usize| element(&format!("group-{number}"), &group_data(&groups[*number], points));
        let elements: Vec<String> = batch.par_iter().map(make).collect();
        for (number, next) in batch.iter().zip(elements) {
            if text.len() + next.len() < GROUP_BYTES {
                text.push_str(&next);
                kept[*number] = true;
            }
        }
    }
    let trials = trials(contents);
    if trials.len() <= TRIAL_BYTES {
        text.push_str(&element("trials", &trials));
    }
    element("index", &index(contents, &kept)) + &text
}

/// Return scenarios with their groups, methods, cells and the summary.
fn index(contents: &Contents<'_>, kept: &[bool]) -> Value {
    let mut scenarios: Vec<(&str, Vec<Value>, usize)> = Vec::new();
    for (number, Analysis { group, .. }) in contents.analyses.iter().enumerate() {
        if scenarios.last().is_none_or(|(name, ..)| *name != group.scenario) {
            scenarios.push((group.scenario, Vec::new(), 0));
        }
        let Some((_, list, left_out)) = scenarios.last_mut() else { continue };
        if kept[number] {
            let label = if group.cell.is_empty() { "all cells" } else { &group.cell };
            list.push(json!({ "number": number, "label": label }));
        } else {
            *left_out += 1;
        }
    }
    let scenarios = scenarios
        .into_iter()
        .map(|(name, groups, left_out)| json!({ "name": name, "groups": groups, "left_out": left_out }));
    let few = contents.rows.len() <= MAX_ROWS;
    json!({
        "scenarios": scenarios.collect::<Vec<_>>(),
        "methods": contents.plan.methods,
        "cells": if few { contents.plan.cells.iter().map(crate::plan::Cell::label).collect() } else { Vec::new() },
        "summary": summary::csv_rows(&contents.rows[..contents.rows.len().min(MAX_ROWS)]),
    })
}

fn group_data(Analysis { group, tables }: &Analysis<'_>, points: usize) -> Value {
    let figures: Vec<_> =
        plots::ALL.iter().filter_map(|entry| (entry.draw)(group)).map(|f| f.thinned(points)).collect();
    let tables = tables.iter().map(|(entry, table)| {
        let rows: Vec<Vec<String>> = table.rows.iter().map(|row| row.iter().map(TableCell::text).collect()).collect();
        let StatisticEntry { name, summary, source, .. } = entry;
        json!({ "name": name, "summary": summary, "source": source, "columns": table.columns, "rows": rows })
    });
    json!({ "methods": group.methods, "figures": figures, "tables": tables.collect::<Vec<_>>() })
}

/// Return the trials as lines `cell,method,repetition,success,error,evaluations,seconds`; cell and method by their numbers.
fn trials(contents: &Contents<'_>) -> String {
    let methods = &contents.plan.methods;
    let cells: std::collections::BTreeMap<u64, usize> =
        contents.plan.trials.iter().map(|trial| (trial.key, trial.cell)).collect();
    let mut text = String::new();
    for record in contents.records {
        let cell = u64::from_str_radix(&record.key, 16).ok().and_then(|key| cells.get(&key));
        let method = methods.iter().position(|name| *name == record.method);
        let (Some(cell), Some(method)) = (cell, method) else { continue };
        let error = record.error.map_or_else(String::new, |error| short(error).to_string());
        let (success, evaluations) = (u8::from(record.success), record.evaluations);
        let seconds = short(record.seconds);
        let _ = writeln!(text, "{cell},{method},{},{success},{error},{evaluations},{seconds}", record.repetition);
        if text.len() > TRIAL_BYTES {
            break;
        }
    }
    text
}
