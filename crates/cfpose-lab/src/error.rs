//! The error type of the laboratory.

use std::path::PathBuf;

use cfpose::entry::EntryError;
use cfpose_vision::Fault;

use crate::scenario::ScenarioError;

/// Everything that can go wrong around an experiment; a solve that does not converge is a record, not an error.
#[derive(Debug, thiserror::Error)]
pub enum LabError {
    /// A file or folder cannot be read or written.
    #[error("{}: cannot {action}: {}", path.display(), said(source))]
    Io {
        /// File or folder.
        path: PathBuf,
        /// `read`, `write`, ...
        action: &'static str,
        /// What the system said.
        source: std::io::Error,
    },
    /// The experiment file is no TOML.
    #[error("{file}: line {line}: {problem}")]
    Toml {
        /// Name of the file.
        file: String,
        /// Line, from 1.
        line: usize,
        /// What is wrong.
        problem: String,
    },
    /// A pipeline file without a stage.
    #[error("{file}: no [[stage]]; an estimator has at least one")]
    NoStage {
        /// Name of the file.
        file: String,
    },
    /// A key that the experiment file does not have.
    #[error("{file}: {place}: unknown key `{key}`{}", did_you_mean(.suggestions))]
    UnknownKey {
        /// Name of the file.
        file: String,
        /// Where: `top level`, `[[scenario]] 2`, ...
        place: String,
        /// Key the user wrote.
        key: String,
        /// Nearest keys, or all of them.
        suggestions: Vec<String>,
    },
    /// A value that cannot be used.
    #[error("{file}: {place}: {problem}")]
    Value {
        /// Name of the file.
        file: String,
        /// Where.
        place: String,
        /// What is wrong and what to write instead.
        problem: String,
    },
    /// A name or parameter is wrong.
    #[error("{file}: {place}: {problem}")]
    Entry {
        /// Name of the file.
        file: String,
        /// Where.
        place: String,
        /// The lookup's own error, with suggestions.
        problem: Box<EntryError>,
    },
    /// The estimator refuses the combination.
    #[error("{file}: {place}: {problem}")]
    Estimator {
        /// Name of the file.
        file: String,
        /// Where.
        place: String,
        /// The estimator's own error.
        problem: Box<cfpose::Error>,
    },
    /// A method cannot be used on a scenario's data.
    #[error("{place}: {problem}; leave the method or the scenario out")]
    Inapplicable {
        /// Which method and cell.
        place: String,
        /// The estimator's own error.
        problem: Box<cfpose::Error>,
    },
    /// A scenario has no data.
    #[error("scenario {place}: {problem}")]
    Scenario {
        /// Which cell.
        place: String,
        /// What is missing or impossible.
        problem: Box<ScenarioError>,
    },
    /// More trials than one experiment may have.
    #[error(
        "the experiment asks for {asked} trials over all cells, more than {limit}; lower `trials` or split the grid"
    )]
    TooManyTrials {
        /// Trials asked for.
        asked: usize,
        /// Most trials possible.
        limit: usize,
    },
    /// A shard that does not exist.
    #[error("shard `{text}`: {problem}; write I/N with I from 0 to N - 1, for example 0/4")]
    Shard {
        /// What the user wrote.
        text: String,
        /// What is wrong.
        problem: &'static str,
    },
    /// The folder holds results and resuming was not asked for.
    #[error("{}: already holds {records} record(s); resume, or choose another folder", path.display())]
    Occupied {
        /// The folder.
        path: PathBuf,
        /// Number of records there.
        records: usize,
    },
    /// The folder belongs to another experiment.
    #[error(
        "{}: belongs to experiment {found}, not {expected}: seed, trials, scenarios and methods must agree; choose another folder",
        path.display()
    )]
    MixedExperiments {
        /// File or folder.
        path: PathBuf,
        /// Fingerprint that is needed.
        expected: String,
        /// Fingerprint that was found.
        found: String,
    },
    /// Records of different instruction sets, whose last digits differ.
    #[error(
        "{}: holds records of instruction set {found} beside {expected}; run all shards with the same --isa",
        path.display()
    )]
    MixedIsa {
        /// File or folder.
        path: PathBuf,
        /// Instruction set of the others.
        expected: String,
        /// Instruction set that was found.
        found: String,
    },
    /// Another run writes the record file.
    #[error(
        "{}: another run is writing here{}; wait for it, or take another --shard or folder",
        path.display(),
        process_number(.process)
    )]
    Busy {
        /// The record file.
        path: PathBuf,
        /// Number of the other process, empty where it is not known.
        process: String,
    },
    /// Records of different versions of the program.
    #[error(
        "{}: holds records of version {found} beside {expected}; compute all with one version, or choose another folder",
        path.display()
    )]
    MixedVersions {
        /// File or folder.
        path: PathBuf,
        /// Version of the others, or of this program.
        expected: String,
        /// Version that was found.
        found: String,
    },
    /// Records that were computed from other data files.
    #[error(
        "{}: line {line}: scenario {place}: computed from other data ({found} instead of {expected}); bring the old file back, \
         or choose another folder",
        path.display()
    )]
    MixedData {
        /// File of records.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// Which cell.
        place: String,
        /// Files and hashes that are there now, or of the other records.
        expected: String,
        /// Files and hashes of the record.
        found: String,
    },
    /// A key that no trial of the experiment has.
    #[error("no trial of this experiment has the key `{key}`; keys stand in results.csv, 16 hexadecimal digits each")]
    NoTrial {
        /// What the user wrote.
        key: String,
    },
    /// A record that cannot be read or contradicts another.
    #[error("{}: line {line}: {problem}", path.display())]
    Record {
        /// File.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// What is wrong.
        problem: String,
    },
    /// The folder holds no results.
    #[error("{}: holds no experiment.toml, here or one level below; give the folder that `run` wrote", path.display())]
    NoExperiment {
        /// The folder.
        path: PathBuf,
    },
    /// A figure cannot be drawn.
    #[error("cannot draw {figure}: {problem}")]
    Plot {
        /// Name of the figure.
        figure: String,
        /// What is wrong.
        problem: String,
    },
    /// The threads cannot be started.
    #[error("cannot start {threads} thread(s): {problem}")]
    Threads {
        /// Number asked for.
        threads: usize,
        /// What the system said.
        problem: String,
    },
}

impl LabError {
    /// Say whether the mistake is in what the user wrote (names, keys, values, a folder's choice), not in data or files.
    ///
    /// Programs give it exit code 2, everything else 3.
    pub fn is_usage(&self) -> bool {
        if let LabError::Scenario { problem, .. } = self {
            return !matches!(**problem, ScenarioError::File(_) | ScenarioError::Panicked(_));
        }
        !matches!(
            self,
            LabError::Io { .. }
                | LabError::Record { .. }
                | LabError::MixedData { .. }
                | LabError::Toml { .. }
                | LabError::NoStage { .. }
                | LabError::NoExperiment { .. }
                | LabError::Plot { .. }
                | LabError::Threads { .. }
        )
    }
}

fn process_number(number: &str) -> String {
    if number.is_empty() { String::new() } else { format!(" (process {number})") }
}

fn did_you_mean(suggestions: &[String]) -> String {
    if suggestions.is_empty() { String::new() } else { format!("; did you mean {}?", suggestions.join(" or ")) }
}

/// Return what the system said; what is not there has the words of point files.
fn said(source: &std::io::Error) -> String {
    match source.kind() {
        std::io::ErrorKind::NotFound => Fault::Missing.to_string(),
        _ => source.to_string(),
    }
}
