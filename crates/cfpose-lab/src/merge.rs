//! From the records of one or many shards to tables; counting what is there.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde_json::json;

use crate::config::Experiment;
use crate::error::LabError;
use crate::folder::{EXPERIMENT, TRIALS, lines_of, read_records, read_text, record_files, result_folders, write_whole};
use crate::lab::Lab;
use crate::plan::Plan;
use crate::record::Record;
use crate::report;
use crate::summary::{SummaryRow, summarise};
use crate::table;

/// What a merge wrote.
#[derive(Debug, Clone, PartialEq)]
pub struct Merged {
    /// The experiment of the folder.
    pub experiment: Experiment,
    /// Rows of `summary.json`.
    pub rows: Vec<SummaryRow>,
    /// Records found.
    pub records: usize,
    /// Records of a complete run.
    pub expected: usize,
}

/// What is there of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct FolderStatus {
    /// Fingerprint of the experiment.
    pub experiment: String,
    /// Instruction set of the records, if there are any.
    pub isa: Option<String>,
    /// Records found.
    pub records: usize,
    /// Records of a complete run.
    pub expected: usize,
    /// Records without a usable estimate.
    pub unusable: usize,
    /// Per cell: label, records found, records of a complete run.
    pub cells: Vec<(String, usize, usize)>,
    /// Record files and the number of records in each.
    pub files: Vec<(PathBuf, usize)>,
}

/// All records of one experiment, checked and without duplicates.
pub(crate) struct Collected {
    pub experiment: Experiment,
    pub plan: Plan,
    pub fingerprint: String,
    /// By cell, method, repetition.
    pub records: Vec<Record>,
    pub isa: Option<String>,
    pub files: Vec<(PathBuf, usize)>,
}

/// Read all records of a folder and its direct sub-folders.
///
/// # Errors
/// [`LabError`] for no experiment, several experiments, several instruction sets, or records that contradict each other.
pub(crate) fn collect(lab: &Lab, folder: &Path) -> Result<Collected, LabError> {
    let folders = result_folders(folder)?;
    let first = folders.first().ok_or_else(|| LabError::NoExperiment { path: folder.to_path_buf() })?;
    let experiment = Experiment::load(lab, &first.join(EXPERIMENT))?;
    let fingerprint = experiment.fingerprint();
    for other in &folders[1..] {
        let path = other.join(EXPERIMENT);
        same_experiment(&path, &fingerprint, &Experiment::load(lab, &path)?.fingerprint())?;
    }
    let plan = Plan::new(lab, &experiment)?;
    let mut places: BTreeMap<(String, String), (usize, usize, usize)> = BTreeMap::new();
    for trial in &plan.trials {
        for (m, method) in plan.methods.iter().enumerate() {
            places.insert((format!("{:016x}", trial.key), method.clone()), (trial.cell, m, trial.repetition));
        }
    }
    let mut sorted: BTreeMap<(usize, usize, usize), Record> = BTreeMap::new();
    let (mut isa, mut files): (Option<String>, _) = (None, Vec::new());
    for path in folders.iter().map(|folder| record_files(folder)).collect::<Result<Vec<_>, _>>()?.concat() {
        let records = read_records(&path)?;
        files.push((path.clone(), records.len()));
        for (line, record) in records {
            same_experiment(&path, &fingerprint, &record.experiment)?;
            same_isa(&path, isa.get_or_insert_with(|| record.isa.clone()), &record.isa)?;
            let wrong = |problem: &str| LabError::Record { path: path.clone(), line, problem: problem.to_string() };
            let place = places.get(&record.identity()).ok_or_else(|| wrong("the trial is not in the experiment"))?;
            if sorted.get(place).is_some_and(|other| !other.same_result(&record)) {
                return Err(wrong("contradicts another record of the same trial and method"));
            }
            sorted.entry(*place).or_insert(record);
        }
    }
    let records = sorted.into_values().collect();
    Ok(Collected { experiment, plan, fingerprint, records, isa, files })
}

pub(crate) fn same_experiment(path: &Path, expected: &str, found: &str) -> Result<(), LabError> {
    if expected == found {
        return Ok(());
    }
    let (expected, found) = (expected.to_string(), found.to_string());
    Err(LabError::MixedExperiments { path: path.to_path_buf(), expected, found })
}

pub(crate) fn same_isa(path: &Path, expected: &str, found: &str) -> Result<(), LabError> {
    if expected == found {
        return Ok(());
    }
    let (expected, found) = (expected.to_string(), found.to_string());
    Err(LabError::MixedIsa { path: path.to_path_buf(), expected, found })
}

/// Merge all records of a folder and its direct sub-folders (one per machine) and write the tables into it.
///
/// Merging again gives the same files, byte for byte. An incomplete run is merged as far as it is there.
///
/// # Errors
/// [`LabError`] for no experiment, mixed experiments or instruction sets, contradicting records, files that cannot be
/// read or written.
pub fn merge(lab: &Lab, folder: &Path) -> Result<Merged, LabError> {
    let collected = collect(lab, folder)?;
    let rows = summarise(&collected.plan, &collected.records);
    let write = |name: &str, text: &str| write_whole(&folder.join(name), text);
    write(EXPERIMENT, &collected.experiment.to_toml())?;
    write(TRIALS, &lines_of(collected.records.iter()))?;
    write("manifest.json", &pretty(&manifest(&collected)))?;
    write("results.csv", &report::results_csv(&collected.records))?;
    write("timings.csv", &report::timings_csv(&collected.records))?;
    write("summary.json", &pretty(&json!(rows)))?;
    write("tables.md", &tables(&collected.experiment, &rows))?;
    write(
        "report.html",
        &report::html(&collected.experiment, &rows, collected.records.len(), collected.plan.num_records()),
    )?;
    Ok(Merged {
        experiment: collected.experiment,
        rows,
        records: collected.records.len(),
        expected: collected.plan.num_records(),
    })
}

/// Render the summary and, where the experiment names printed figures, the comparison with them.
pub fn tables(experiment: &Experiment, rows: &[SummaryRow]) -> String {
    let published = table::published_tables(experiment, rows);
    let gap = if published.is_empty() { "" } else { "\n" };
    format!("### All cells\n\n{}{gap}{published}", table::summary_table(rows))
}

fn pretty(value: &serde_json::Value) -> String {
    format!("{value:#}\n")
}

/// What produced the results; no clock, so that merging again gives the same bytes.
fn manifest(collected: &Collected) -> serde_json::Value {
    let Collected { experiment, plan, fingerprint, records, isa, .. } = collected;
    json!({
        "schema": "cfpose.run/1",
        "program": "cfpose",
        "version": env!("CARGO_PKG_VERSION"),
        "experiment": fingerprint,
        "seed": experiment.seed,
        "isa": isa,
        "os": std::env::consts::OS,
        "arch": std::env::consts::ARCH,
        "cells": plan.cells.len(),
        "methods": plan.methods,
        "records": records.len(),
        "expected": plan.num_records(),
        "complete": records.len() == plan.num_records(),
        "files": ["experiment.toml", "trials.jsonl", "results.csv", "timings.csv", "summary.json", "tables.md", "report.html"],
    })
}

/// Count what is there of a run, without writing anything.
///
/// # Errors
/// As [`merge`].
pub fn status(lab: &Lab, folder: &Path) -> Result<FolderStatus, LabError> {
    let collected = collect(lab, folder)?;
    let plan = &collected.plan;
    let rows = summarise(plan, &collected.records);
    let per_cell = plan.cells.iter().zip(rows.chunks(plan.methods.len().max(1)));
    Ok(FolderStatus {
        records: collected.records.len(),
        expected: plan.num_records(),
        unusable: collected.records.iter().filter(|record| !record.usable).count(),
        cells: per_cell
            .map(|(cell, rows)| {
                (cell.label(), rows.iter().map(|row| row.trials).sum(), cell.trials * plan.methods.len())
            })
            .collect(),
        experiment: collected.fingerprint,
        isa: collected.isa,
        files: collected.files,
    })
}

/// Return the text of `tables.md` of a merged folder.
///
/// # Errors
/// [`LabError::Io`] when it was not written yet.
pub fn read_tables(folder: &Path) -> Result<String, LabError> {
    read_text(&folder.join("tables.md"))
}
