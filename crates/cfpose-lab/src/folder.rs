//! The files of a run: where they are, how they are read and written.
//!
//! * `experiment.toml`: the resolved experiment; it says to which experiment the folder belongs.
//! * `trials.jsonl` (whole run) or `trials-I-of-N.jsonl` (shard): one record a line, appended as trials end.
//! * `manifest.json`, `results.csv`, `timings.csv`, `summary.json`, `tables.md`, `report.html`: made from the records.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use crate::error::LabError;
use crate::record::Record;
use crate::shard::Shard;

/// Name of the resolved experiment.
pub const EXPERIMENT: &str = "experiment.toml";
/// Name of the records of a whole run, and of all records after a merge.
pub const TRIALS: &str = "trials.jsonl";

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

/// Write a file so that a reader sees the old or the new text, never half of it.
pub(crate) fn write_whole(path: &Path, text: &str) -> Result<(), LabError> {
    let mut name = path.file_name().unwrap_or_default().to_os_string();
    name.push(format!(".{}.part", std::process::id()));
    let part = path.with_file_name(name);
    fs::write(&part, text).map_err(io_error(&part, "write"))?;
    fs::rename(&part, path).map_err(io_error(path, "write"))
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
    let text = read_text(path)?;
    let whole = &text[..text.rfind('\n').map_or(0, |end| end + 1)];
    let lines = whole.lines().enumerate().filter(|(_, line)| !line.trim().is_empty());
    lines
        .map(|(index, line)| match serde_json::from_str(line) {
            Ok(record) => Ok((index + 1, record)),
            Err(problem) => Err(LabError::Record {
                path: path.to_path_buf(),
                line: index + 1,
                problem: format!("this is no record: {problem}"),
            }),
        })
        .collect()
}

/// Return the records as lines of JSON.
pub(crate) fn lines_of<'a>(records: impl Iterator<Item = &'a Record>) -> String {
    // A record holds only texts, finite numbers and lists of them, which JSON can always write.
    records.filter_map(|record| serde_json::to_string(record).ok()).map(|line| line + "\n").collect()
}

/// Appends records to a file, one whole line at a time.
pub(crate) struct Appender {
    path: PathBuf,
    file: fs::File,
}

impl Appender {
    /// Open the file after cutting off a half-written last line.
    pub(crate) fn open(path: &Path) -> Result<Self, LabError> {
        let mut options = fs::OpenOptions::new();
        let file = options.create(true).append(true).open(path).map_err(io_error(path, "write"))?;
        let text = fs::read(path).map_err(io_error(path, "read"))?;
        let whole = text.iter().rposition(|byte| *byte == b'\n').map_or(0, |end| end + 1);
        file.set_len(whole as u64).map_err(io_error(path, "write"))?;
        Ok(Self { path: path.to_path_buf(), file })
    }

    pub(crate) fn append(&mut self, records: &[Record]) -> Result<(), LabError> {
        self.file.write_all(lines_of(records.iter()).as_bytes()).map_err(io_error(&self.path, "write"))
    }
}
