//! The error type of training.

use std::path::PathBuf;

use cfpose::entry::EntryError;
use cfpose_lab::LabError;

/// Everything that can go wrong around a training.
#[derive(Debug, thiserror::Error)]
pub enum LearnError {
    /// A file or folder cannot be read or written ([`LabError::Io`]).
    #[error(transparent)]
    File(#[from] LabError),
    /// The configuration cannot be used.
    #[error("{file}: {problem}")]
    Config {
        /// Name of the file.
        file: String,
        /// What is wrong and where.
        problem: String,
    },
    /// A name or parameter in the configuration is wrong.
    #[error("{file}: {place}: {problem}")]
    Entry {
        /// Name of the file.
        file: String,
        /// Where: `[[data]] 1`, ...
        place: String,
        /// What is wrong.
        problem: Box<EntryError>,
    },
    /// The library refuses a part.
    #[error(transparent)]
    Library(#[from] cfpose::Error),
    /// Nothing can be learned from what the scenarios draw.
    #[error("{0}")]
    Data(String),
    /// A checkpoint belongs to another training or is damaged.
    #[error("{}: {problem}", path.display())]
    Checkpoint {
        /// File.
        path: PathBuf,
        /// What is wrong.
        problem: String,
    },
    /// The caller asked to stop.
    #[error("stopped after round {rounds}; go on with --resume")]
    Stopped {
        /// Rounds that are in the checkpoint.
        rounds: usize,
    },
}
