//! What went wrong, sorted by exit code.

use std::fmt::Display;

use cfpose::BuildError;

/// Why the program ends without success; each kind has its exit code.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// The arguments cannot be used: exit code 2.
    Usage,
    /// A file cannot be read, used or written: exit code 3.
    Input,
    /// The program ran and has no usable result: exit code 4.
    Unusable,
    /// A signal stopped the program: exit code 128 and its number.
    Stopped(u8),
}

impl Kind {
    /// Return the exit code.
    pub fn exit_code(self) -> u8 {
        match self {
            Kind::Usage => 2,
            Kind::Input => 3,
            Kind::Unusable => 4,
            Kind::Stopped(code) => code,
        }
    }
}

/// An error with its kind.
#[derive(Debug)]
pub struct Failure {
    /// Kind.
    pub kind: Kind,
    /// What is wrong, where, what to do.
    pub error: anyhow::Error,
}

impl Failure {
    /// Make a failure of wrong arguments.
    pub fn usage(message: impl Display) -> Self {
        Self { kind: Kind::Usage, error: anyhow::anyhow!("{message}") }
    }

    /// Make a failure of a file.
    pub fn input(message: impl Display) -> Self {
        Self { kind: Kind::Input, error: anyhow::anyhow!("{message}") }
    }

    /// Make a failure of a run.
    pub fn unusable(message: impl Display) -> Self {
        Self { kind: Kind::Unusable, error: anyhow::anyhow!("{message}") }
    }

    /// Return the message on one line.
    pub fn message(&self) -> String {
        let text = format!("{:#}", self.error);
        text.split_whitespace().collect::<Vec<_>>().join(" ")
    }

    /// Say whether the reader of our output went away, which is no failure.
    pub fn is_broken_pipe(&self) -> bool {
        self.error.downcast_ref::<std::io::Error>().is_some_and(|e| e.kind() == std::io::ErrorKind::BrokenPipe)
    }
}

impl From<std::io::Error> for Failure {
    /// An error of standard output.
    fn from(error: std::io::Error) -> Self {
        Self { kind: Kind::Input, error: error.into() }
    }
}

impl From<cfpose_vision::FileError> for Failure {
    fn from(error: cfpose_vision::FileError) -> Self {
        Self { kind: Kind::Input, error: error.into() }
    }
}

impl From<cfpose_optim::entry::EntryError> for Failure {
    fn from(error: cfpose_optim::entry::EntryError) -> Self {
        Self { kind: Kind::Usage, error: error.into() }
    }
}

impl From<cfpose::Error> for Failure {
    /// Points and their statistics are input, code that falls over gives no result; everything else the library refuses is a choice
    /// of arguments.
    fn from(error: cfpose::Error) -> Self {
        let kind = match &error {
            cfpose::Error::Points { .. }
            | cfpose::Error::Data { .. }
            | cfpose::Error::PointDimension { .. }
            | cfpose::Error::Normalise { .. } => Kind::Input,
            cfpose::Error::Build(BuildError::Broken { .. })
            | cfpose::Error::Solve(cfpose_optim::SolveError::Broken { .. }) => Kind::Unusable,
            _ => Kind::Usage,
        };
        Self { kind, error: error.into() }
    }
}

impl From<cfpose_lab::LabError> for Failure {
    fn from(error: cfpose_lab::LabError) -> Self {
        let kind = if error.is_usage() { Kind::Usage } else { Kind::Input };
        Self { kind, error: anyhow::anyhow!("{error}") }
    }
}

impl From<cfpose_learn::LearnError> for Failure {
    /// Files and what they ask for are input; names are usage, as everywhere.
    fn from(error: cfpose_learn::LearnError) -> Self {
        match error {
            cfpose_learn::LearnError::Library(error) => error.into(),
            cfpose_learn::LearnError::File(error) => error.into(),
            cfpose_learn::LearnError::Entry { .. } => Self { kind: Kind::Usage, error: error.into() },
            _ => Self { kind: Kind::Input, error: error.into() },
        }
    }
}

/// Say whether a build failed because of its name and parameters, not because of data that were not there yet.
pub fn is_wrong_name(error: &cfpose::Error) -> bool {
    matches!(error, cfpose::Error::Build(BuildError::Entry(_)))
}
