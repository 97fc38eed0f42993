//! From the records of one or many shards to tables; counting what is there.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde_json::json;

use crate::conditions::condition_tables;
use crate::config::Experiment;
use crate::data::parts;
use crate::error::LabError;
use crate::folder::lock::FolderLock;
use crate::folder::{
    EXPERIMENT, RECORDS, earlier, lines_of, read_text, record_files, records_if_there, result_folders, write_whole,
};
use crate::lab::Lab;
use crate::plan::Plan;
use crate::record::{DataHashes, Record, VERSION};
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
    /// Tables in Markdown of the conditions that scenarios draw; empty where none does.
    pub conditions: String,
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
    /// By cell, method, repetition; those of earlier, smaller experiments carry the fingerprint of this one.
    pub records: Vec<Record>,
    /// File and line of each record.
    pub origins: Vec<Origin>,
    pub isa: Option<String>,
    pub version: Option<String>,
    pub files: Vec<(PathBuf, usize)>,
}

/// Where a record stands.
#[derive(Debug, Clone)]
pub(crate) struct Origin {
    /// Index of the file in [`Collected::files`].
    pub file: usize,
    /// Line, from 1.
    pub line: usize,
    /// Cell of the record.
    pub cell: usize,
}

/// Read all records of a folder and its direct sub-folders.
///
/// # Errors
/// [`LabError`] for no experiment, several experiments, instruction sets, versions or states of a data file, records that
/// contradict each other or their checksums.
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
    let mut reader = Reader { fingerprint: &fingerprint, places: places(&plan), ..Reader::default() };
    for folder in &folders {
        let earlier = earlier(folder)?;
        for path in record_files(folder)? {
            reader.read(path, &earlier)?;
        }
    }
    if let Some(damage) = reader.damage {
        return Err(damage);
    }
    let (origins, records) = reader.sorted.into_values().unzip();
    let Reader { isa, version, files, .. } = reader;
    let collected =
        Collected { plan, records, origins, isa, version, files, fingerprint: fingerprint.clone(), experiment };
    collected.same_data(&BTreeMap::new(), &BTreeMap::new())?;
    Ok(collected)
}

type Place = (usize, usize, usize);

/// Return cell, method and repetition of every record that the plan holds.
fn places(plan: &Plan) -> BTreeMap<(String, String), Place> {
    let mut places = BTreeMap::new();
    for trial in &plan.trials {
        for (m, method) in plan.methods.iter().enumerate() {
            places.insert((format!("{:016x}", trial.key), method.clone()), (trial.cell, m, trial.repetition));
        }
    }
    places
}

/// Reads record files one after the other.
#[derive(Default)]
struct Reader<'a> {
    fingerprint: &'a str,
    places: BTreeMap<(String, String), Place>,
    sorted: BTreeMap<Place, (Origin, Record)>,
    isa: Option<String>,
    version: Option<String>,
    files: Vec<(PathBuf, usize)>,
    /// The first record that is not as it was written; told when nothing else is wrong, for the other errors say more.
    damage: Option<LabError>,
}

impl Reader<'_> {
    fn read(&mut self, path: PathBuf, earlier: &[String]) -> Result<(), LabError> {
        let records = records_if_there(&path)?;
        let file = self.files.len();
        self.files.push((path.clone(), records.len()));
        for (line, mut record) in records {
            let wrong = |problem: &str| LabError::Record { path: path.clone(), line, problem: problem.to_string() };
            let whole = record.is_whole();
            if earlier.contains(&record.experiment) {
                record.experiment = self.fingerprint.to_string();
                record.seal();
            }
            same_experiment(&path, self.fingerprint, &record.experiment)?;
            same_isa(&path, self.isa.get_or_insert_with(|| record.isa.clone()), &record.isa)?;
            same_version(&path, self.version.get_or_insert_with(|| record.version.clone()), &record.version)?;
            let place =
                *self.places.get(&record.identity()).ok_or_else(|| wrong("the trial is not in the experiment"))?;
            if self.sorted.get(&place).is_some_and(|(_, other)| !other.same_result(&record)) {
                return Err(wrong("contradicts another record of the same trial and method"));
            }
            if !whole && self.damage.is_none() {
                self.damage =
                    Some(wrong("the record does not match its checksum; take the line out and resume the run"));
            }
            self.sorted.entry(place).or_insert((Origin { file, line, cell: place.0 }, record));
        }
        Ok(())
    }
}

impl Collected {
    /// Refuse records that were computed from other data than those given for their cell, or than the first record of the cell; and
    /// the same of the files of their method.
    pub(crate) fn same_data(
        &self,
        cells: &BTreeMap<usize, DataHashes>,
        methods: &BTreeMap<String, DataHashes>,
    ) -> Result<(), LabError> {
        let (mut cells, mut methods) = (cells.clone(), methods.clone());
        // Older programs wrote no hashes.
        for (origin, record) in self.origins.iter().zip(&self.records).filter(|(_, record)| !record.version.is_empty())
        {
            let [of_scenario, of_method] = parts(&record.data);
            let label = || self.plan.cells[origin.cell].label();
            let expected = cells.entry(origin.cell).or_insert_with(|| of_scenario.clone());
            self.same_files(origin, label, expected, &of_scenario)?;
            let expected = methods.entry(record.method.clone()).or_insert_with(|| of_method.clone());
            self.same_files(origin, || format!("method {}", record.method), expected, &of_method)?;
        }
        Ok(())
    }

    fn same_files(
        &self,
        origin: &Origin,
        place: impl Fn() -> String,
        expected: &DataHashes,
        found: &DataHashes,
    ) -> Result<(), LabError> {
        if expected == found {
            return Ok(());
        }
        let list = |data: &DataHashes| data.iter().map(|(name, hash)| format!("{name} {hash}")).collect::<Vec<_>>();
        Err(LabError::MixedData {
            path: self.files[origin.file].0.clone(),
            line: origin.line,
            place: place(),
            expected: list(expected).join(", "),
            found: list(found).join(", "),
        })
    }
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

pub(crate) fn same_version(path: &Path, expected: &str, found: &str) -> Result<(), LabError> {
    if expected == found {
        return Ok(());
    }
    let name = |version: &str| if version.is_empty() { "before 0.1.0" } else { version }.to_string();
    Err(LabError::MixedVersions { path: path.to_path_buf(), expected: name(expected), found: name(found) })
}

/// Merge all records of a folder and its direct sub-folders (one per machine) and write the tables into it.
///
/// Merging again gives the same files, byte for byte. An incomplete run is merged as far as it is there, also while it computes: no
/// record file is written.
///
/// # Errors
/// [`LabError`] for no experiment, mixed experiments, instruction sets, versions or data, contradicting or damaged records, files
/// that cannot be read or written.
pub fn merge(lab: &Lab, folder: &Path) -> Result<Merged, LabError> {
    if result_folders(folder)?.is_empty() {
        return Err(LabError::NoExperiment { path: folder.to_path_buf() });
    }
    let lock = FolderLock::wait(folder)?;
    write_tables(folder, collect(lab, folder)?, &lock)
}

/// Write the tables of records. The lock is held since before the records were read: whoever writes later has read more.
pub(crate) fn write_tables(folder: &Path, collected: Collected, _lock: &FolderLock) -> Result<Merged, LabError> {
    let rows = summarise(&collected.plan, &collected.records);
    let mut files = Vec::new();
    let mut write = |name: &'static str, text: &str| {
        files.push(name);
        write_whole(&folder.join(name), text)
    };
    if collected.files.len() > 1 {
        write(RECORDS, &lines_of(collected.records.iter()))?;
    }
    write("results.csv", &report::results_csv(&collected.records))?;
    write("timings.csv", &report::timings_csv(&collected.records))?;
    write("summary.json", &pretty(&json!(rows)))?;
    let conditions = condition_tables(&collected.records);
    write("tables.md", &format!("{}{conditions}", tables(&collected.experiment, &rows)))?;
    write(
        "report.html",
        &report::html(&collected.experiment, &rows, collected.records.len(), collected.plan.num_records()),
    )?;
    // Last: a manifest says that the other files are there.
    write_whole(&folder.join("manifest.json"), &pretty(&manifest(&collected, &files)))?;
    Ok(Merged {
        experiment: collected.experiment,
        rows,
        conditions,
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
fn manifest(collected: &Collected, files: &[&str]) -> serde_json::Value {
    let Collected { experiment, plan, fingerprint, records, isa, version, .. } = collected;
    let mut data = DataHashes::new();
    records.iter().for_each(|record| data.extend(record.data.clone()));
    json!({
        "schema": "cfpose.run/1",
        "program": "cfpose",
        "version": version.as_deref().filter(|version| !version.is_empty()).unwrap_or(VERSION),
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
        "data": data,
        "files": files,
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
