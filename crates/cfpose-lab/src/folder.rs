//! The files of a run: where they are, how they are read and written.
//!
//! * `experiment.toml`: the resolved experiment; it says to which experiment the folder belongs.
//! * `trials.jsonl` (whole run) or `trials-I-of-N.jsonl` (shard): one record a line, appended as trials end. Only the run that
//!   holds the file's lock writes it (`folder/lock.rs`).
//! * `earlier.json`: fingerprints of the smaller experiments that the folder held before it grew.
//! * `results.csv`, `timings.csv`, `summary.json`, `statistics.json`, `tables.md`, `report.html`, where there are several record files also
//!   `records.jsonl`, and last `manifest.json`: made from the records.

pub(crate) mod lock;

use std::fs;
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use rayon::prelude::*;

use crate::error::LabError;
use crate::record::Record;
use crate::shard::Shard;

/// Name of the resolved experiment.
pub const EXPERIMENT: &str = "experiment.toml";
/// Name of the records of a whole run.
pub const TRIALS: &str = "trials.jsonl";
/// Name of all records after a merge of several record files.
pub const RECORDS: &str = "records.jsonl";
/// Name of the fingerprints of earlier, smaller experiments.
pub const EARLIER: &str = "earlier.json";
/// End of the names of files that are being written.
const PART: &str = ".part";
/// Longest time for which new records may be in the system's memory only.
const SYNC_EVERY: Duration = Duration::from_secs(5);

/// Return the name of the record file of a shard.
pub fn trials_name(shard: Shard) -> String {
    if shard.count == 1 { TRIALS.to_string() } else { format!("trials-{}-of-{}.jsonl", shard.index, shard.count) }
}

pub(crate) fn io_error(path: &Path, action: &'static str) -> impl FnOnce(std::io::Error) -> LabError {
    let path = path.to_path_buf();
    move |source| LabError::Io { path, action, source }
}

pub(crate) fn read_text(path: &Path) -> Result<String, LabError> {
    fs::read_to_string(path).map_err(io_error(path, "read"))
}

pub(crate) fn make_folder(path: &Path) -> Result<(), LabError> {
    fs::create_dir_all(path).map_err(io_error(path, "make the folder"))
}

/// Write a file so that a reader sees the old or the new text, never half of it, also after a loss of power.
///
/// The caller holds the lock of the folder.
pub(crate) fn write_whole(path: &Path, text: &str) -> Result<(), LabError> {
    let mut name = path.file_name().unwrap_or_default().to_os_string();
    name.push(PART);
    let part = path.with_file_name(name);
    let write = || {
        let mut file = fs::File::create(&part)?;
        file.write_all(text.as_bytes())?;
        // The new name must not reach the disk before the text.
        file.sync_all()
    };
    write().map_err(|source| {
        let _ = fs::remove_file(&part);
        LabError::Io { path: path.to_path_buf(), action: "write", source }
    })?;
    fs::rename(&part, path).map_err(io_error(path, "write"))?;
    sync_folder(path.parent().unwrap_or(Path::new("")));
    Ok(())
}

/// Bring the names in a folder to the disk, where the system can.
fn sync_folder(folder: &Path) {
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    if let Ok(handle) = fs::File::open(folder) {
        let _ = handle.sync_all();
    }
}

/// Remove what a run left that was killed while it wrote a file; the caller holds the lock of the folder.
pub(crate) fn sweep(folder: &Path) -> Result<(), LabError> {
    for entry in fs::read_dir(folder).map_err(io_error(folder, "read"))? {
        let path = entry.map_err(io_error(folder, "read"))?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let ours = [".json", ".jsonl", ".csv", ".toml", ".md", ".html"]
            .iter()
            .any(|end| name.ends_with(&format!("{end}{PART}")));
        if ours {
            fs::remove_file(&path).map_err(io_error(&path, "remove"))?;
        }
    }
    Ok(())
}

/// Read the fingerprints of the experiments from which a folder has grown.
pub(crate) fn earlier(folder: &Path) -> Result<Vec<String>, LabError> {
    let path = folder.join(EARLIER);
    if !path.is_file() {
        return Ok(Vec::new());
    }
    serde_json::from_str(&read_text(&path)?).map_err(|problem| LabError::Record {
        path,
        line: problem.line().max(1),
        problem: format!("this is no list of fingerprints: {problem}"),
    })
}

/// Return the record files of a folder, sorted by name.
pub fn record_files(folder: &Path) -> Result<Vec<PathBuf>, LabError> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).map_err(io_error(folder, "read"))? {
        let entry = entry.map_err(io_error(folder, "read"))?;
        let name = entry.file_name().to_string_lossy().into_owned();
        if name == TRIALS || name.starts_with("trials-") && name.ends_with(".jsonl") {
            files.push(entry.path());
        }
    }
    files.sort();
    Ok(files)
}

/// Return the files that runs and merges write into a folder, and the record files and experiments of its sub-folders, whether they
/// are there or not.
///
/// # Errors
/// [`LabError::Io`] for a folder that is there and cannot be read.
pub fn own_files(folder: &Path) -> Result<Vec<PathBuf>, LabError> {
    let names = [EXPERIMENT, TRIALS, RECORDS, EARLIER, "results.csv", "timings.csv", "summary.json", "tables.md"];
    let names = names.into_iter().chain(["statistics.json", "report.html", "manifest.json"]);
    let mut files: Vec<PathBuf> = names.map(|name| folder.join(name)).collect();
    if folder.is_dir() {
        for inner in result_folders(folder)? {
            files.extend(record_files(&inner)?);
            files.push(inner.join(EXPERIMENT));
        }
    }
    Ok(files)
}

/// Return the folder and its direct sub-folders that hold an experiment, sorted by name.
pub fn result_folders(folder: &Path) -> Result<Vec<PathBuf>, LabError> {
    let mut folders = Vec::new();
    for entry in fs::read_dir(folder).map_err(io_error(folder, "read"))? {
        let path = entry.map_err(io_error(folder, "read"))?.path();
        if path.is_dir() && path.join(EXPERIMENT).is_file() {
            folders.push(path);
        }
    }
    folders.sort();
    if folder.join(EXPERIMENT).is_file() {
        folders.insert(0, folder.to_path_buf());
    }
    Ok(folders)
}

/// Read the records of one file, each with its line from 1.
///
/// A last line without its newline is the trace of a run that was killed while it wrote: it is left out.
///
/// # Errors
/// [`LabError::Record`] for any other line that is no record.
pub fn read_records(path: &Path) -> Result<Vec<(usize, Record)>, LabError> {
    let bytes = fs::read(path).map_err(io_error(path, "read"))?;
    let whole = &bytes[..bytes.iter().rposition(|byte| *byte == b'\n').map_or(0, |end| end + 1)];
    let lines = whole.split(|byte| *byte == b'\n').enumerate().filter(|(_, line)| !line.trim_ascii().is_empty());
    // All threads read; the first bad line in the order of the file is the one that is told.
    let read: Vec<Result<(usize, Record), LabError>> = lines
        .collect::<Vec<_>>()
        .into_par_iter()
        .map(|(index, line)| match serde_json::from_slice(line) {
            Ok(record) => Ok((index + 1, record)),
            Err(problem) => Err(LabError::Record {
                path: path.to_path_buf(),
                line: index + 1,
                problem: format!("this is no record: {problem}"),
            }),
        })
        .collect();
    read.into_iter().collect()
}

/// As [`read_records`]; a file that is not there has none.
pub(crate) fn records_if_there(path: &Path) -> Result<Vec<(usize, Record)>, LabError> {
    match read_records(path) {
        Err(LabError::Io { source, .. }) if source.kind() == ErrorKind::NotFound => Ok(Vec::new()),
        other => other,
    }
}

/// Return the records as lines of JSON.
pub(crate) fn lines_of<'a>(records: impl Iterator<Item = &'a Record>) -> String {
    // A record holds only texts, finite numbers and lists of them, which JSON can always write.
    records.filter_map(|record| serde_json::to_string(record).ok()).map(|line| line + "\n").collect()
}

/// Appends records to a file, whole lines at a time.
pub(crate) struct Appender {
    path: PathBuf,
    file: fs::File,
    /// Bytes of whole lines.
    length: u64,
    synced: Instant,
}

impl Appender {
    /// Open the file after cutting off a half-written last line; the caller holds the lock of the file.
    pub(crate) fn open(path: &Path) -> Result<Self, LabError> {
        let mut options = fs::OpenOptions::new();
        let file = options.create(true).append(true).open(path).map_err(io_error(path, "write"))?;
        let text = fs::read(path).map_err(io_error(path, "read"))?;
        let length = text.iter().rposition(|byte| *byte == b'\n').map_or(0, |end| end + 1) as u64;
        file.set_len(length).map_err(io_error(path, "write"))?;
        Ok(Self { path: path.to_path_buf(), file, length, synced: Instant::now() })
    }

    /// Append records; where that fails (a full disk) the file stays as it was.
    pub(crate) fn append(&mut self, records: &[Record]) -> Result<(), LabError> {
        let lines = lines_of(records.iter());
        let mut write = || {
            self.file.write_all(lines.as_bytes())?;
            if self.synced.elapsed() >= SYNC_EVERY {
                self.file.sync_data()?;
                self.synced = Instant::now();
            }
            Ok(())
        };
        write().map_err(|problem| {
            let _ = self.file.set_len(self.length);
            io_error(&self.path, "write")(problem)
        })?;
        self.length += lines.len() as u64;
        Ok(())
    }

    /// Bring everything to the disk and close the file.
    pub(crate) fn close(self) -> Result<(), LabError> {
        self.file.sync_all().map_err(io_error(&self.path, "write"))
    }
}
