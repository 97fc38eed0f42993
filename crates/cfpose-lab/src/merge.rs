//! From the records of one or many shards to tables; counting what is there.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use serde_json::json;

use crate::conditions::condition_tables;
use crate::config::Experiment;
use crate::data::parts;
use crate::error::LabError;
use crate::folder::lock::FolderLock;
use crate::folder::{
    EXPERIMENT, RECORDS, earlier, lines_of, read_text, record_files, records_if_there, result_folders, write_whole,
};
use crate::group::groups;
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
    let mut reader = Reader { fingerprint: &fingerprint, places: Places::of(&plan), ..Reader::default() };
    for folder in &folders {
        let earlier = earlier(folder)?;
        for path in record_files(folder)? {
            reader.read(path, &earlier)?;
        }
    }
    if let Some(damage) = reader.damage {
        return Err(damage);
    }
    let (origins, records) = reader.sorted.into_values().map(|found| *found).unzip();
    let Reader { isa, version, files, .. } = reader;
    let collected =
        Collected { plan, records, origins, isa, version, files, fingerprint: fingerprint.clone(), experiment };
    collected.same_data(&BTreeMap::new(), &BTreeMap::new())?;
    Ok(collected)
}

type Place = (usize, usize, usize);

/// Where every trial and method of a plan stands.
#[derive(Default)]
struct Places {
    /// Cell and repetition by key.
    trials: BTreeMap<u64, (usize, usize)>,
    methods: BTreeMap<String, usize>,
}

impl Places {
    fn of(plan: &Plan) -> Self {
        Self {
            trials: plan.trials.iter().map(|trial| (trial.key, (trial.cell, trial.repetition))).collect(),
            methods: plan.methods.iter().enumerate().map(|(m, method)| (method.clone(), m)).collect(),
        }
    }

    /// Return the place of a record, if the plan holds it.
    fn find(&self, record: &Record) -> Option<Place> {
        let key = u64::from_str_radix(&record.key, 16).ok().filter(|_| record.key.len() == 16)?;
        let (cell, repetition) = *self.trials.get(&key)?;
        Some((cell, *self.methods.get(&record.method)?, repetition))
    }
}

/// Reads record files one after the other.
#[derive(Default)]
struct Reader<'a> {
    fingerprint: &'a str,
    places: Places,
    sorted: BTreeMap<Place, Box<(Origin, Record)>>,
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
        let whole: Vec<bool> = records.par_iter().map(|(_, record)| record.is_whole()).collect();
        for ((line, mut record), whole) in records.into_iter().zip(whole) {
            let wrong = |problem: &str| LabError::Record { path: path.clone(), line, problem: problem.to_string() };
            if earlier.contains(&record.experiment) {
                record.experiment = self.fingerprint.to_string();
                record.seal();
            }
            same_experiment(&path, self.fingerprint, &record.experiment)?;
            same_isa(&path, self.isa.get_or_insert_with(|| record.isa.clone()), &record.isa)?;
            same_version(&path, self.version.get_or_insert_with(|| record.version.clone()), &record.version)?;
            let place = self.places.find(&record).ok_or_else(|| wrong("the trial is not in the experiment"))?;
            if self.sorted.get(&place).is_some_and(|found| !found.1.same_result(&record)) {
                return Err(wrong("contradicts another record of the same trial and method"));
            }
            if !whole && self.damage.is_none() {
                self.damage =
                    Some(wrong("the record does not match its checksum; take the line out and resume the run"));
            }
            self.sorted.entry(place).or_insert_with(|| Box::new((Origin { file, line, cell: place.0 }, record)));
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
    let Collected { experiment, plan, records, .. } = &collected;
    let analyses = report::analyse(experiment, plan, records);
    write("statistics.json", &format!("{}\n", report::statistics_json(&analyses)))?;
    let contents =
        report::Contents { experiment, plan, records, rows: &rows, analyses: &analyses, name: &name_of(folder) };
    write("report.html", &report::html(&contents))?;
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

/// Return the name of a folder of results: that of its experiment where `run` chose it.
fn name_of(folder: &Path) -> String {
    let whole = std::path::absolute(folder).unwrap_or_else(|_| folder.to_path_buf());
    whole.file_name().unwrap_or(folder.as_os_str()).to_string_lossy().into_owned()
}

/// Write figures as SVG, tables of statistics as LaTeX, from the records of a folder; returns the files.
///
/// # Errors
/// As [`merge`].
pub fn export(lab: &Lab, folder: &Path, svg: Option<&Path>, latex: Option<&Path>) -> Result<Vec<PathBuf>, LabError> {
    let collected = collect(lab, folder)?;
    let groups = groups(&collected.experiment, &collected.plan, &collected.records);
    let mut files = Vec::new();
    if let Some(to) = svg {
        files.extend(report::export::write_svg(&groups, to)?);
    }
    if let Some(to) = latex {
        files.extend(report::export::write_latex(&groups, to)?);
    }
    Ok(files)
}

/// Put the results of a folder into a page in Markdown: in the place of the section that has the folder's name, else at its end. The
/// rest of the page stays; the day is that of the newest record file.
///
/// # Errors
/// As [`merge`]; [`LabError::Io`] for a page that cannot be read or written.
pub fn document(lab: &Lab, folder: &Path, page: &Path) -> Result<(), LabError> {
    let collected = collect(lab, folder)?;
    let rows = summarise(&collected.plan, &collected.records);
    let seconds = |path: &PathBuf| {
        let written = std::fs::metadata(path).and_then(|file| file.modified()).ok()?;
        written.duration_since(std::time::UNIX_EPOCH).ok().map(|since| since.as_secs())
    };
    let newest = collected.files.iter().filter_map(|(path, _)| seconds(path)).max().unwrap_or(0);
    let Collected { experiment, plan, records, .. } = &collected;
    let (name, day) = (name_of(folder), report::docs::day_of(newest));
    let section = report::docs::Section { name: &name, day: &day, experiment, plan, records, rows: &rows };
    let current = if page.is_file() { read_text(page)? } else { String::new() };
    write_whole(page, &section.into_page(&current))
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
