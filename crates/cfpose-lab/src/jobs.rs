//! Job files: one experiment in shards on an engine that already runs on the machines. A new engine is one file here and one line in [`ALL`].
//!
//! Every engine runs the same command, `run EXPERIMENT --out DIR --shard I/N --resume`, as often as it takes, and then `merge DIR`. Shards
//! are independent, a shard that is killed and started again goes on where it was, and the merged bytes depend on neither.

use std::path::{Path, PathBuf};

mod dask;
mod parallel;
mod slurm;
mod snakemake;

/// What is to be run, in names that hold on every machine.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Jobs {
    /// The program.
    pub program: PathBuf,
    /// The experiment file.
    pub experiment: PathBuf,
    /// The folder of the results, which all machines see.
    pub out: PathBuf,
    /// Number of shards.
    pub shards: usize,
    /// Trials of every cell instead of the file's.
    pub trials: Option<u32>,
    /// Threads of a shard.
    pub threads: u16,
    /// Instruction set of all shards; `None` leaves it to the machine, which is right where all are alike.
    pub isa: Option<String>,
}

/// A file to write.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct JobFile {
    /// Name.
    pub name: String,
    /// Content.
    pub text: String,
}

/// What an engine makes of it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Emitted {
    /// Files, for one folder.
    pub files: Vec<JobFile>,
    /// The command that starts them, in that folder.
    pub command: String,
}

/// One line of the table of engines.
pub struct EngineEntry {
    /// Name, kebab-case.
    pub name: &'static str,
    /// One line for lists.
    pub summary: &'static str,
    /// Write the files.
    pub emit: fn(&Jobs) -> Emitted,
}

/// All engines.
///
/// ```
/// use cfpose_lab::jobs::{ALL, Jobs};
/// let jobs = Jobs {
///     program: "/opt/cfpose".into(),
///     experiment: "/home/me/my experiment.toml".into(),
///     out: "/home/me/out".into(),
///     shards: 7,
///     trials: None,
///     threads: 1,
///     isa: None,
/// };
/// let slurm = ALL.iter().find(|engine| engine.name == "slurm").unwrap();
/// let emitted = (slurm.emit)(&jobs);
/// assert!(emitted.files[0].text.contains("#SBATCH --array=0-6"));
/// assert!(emitted.files[0].text.contains("'/home/me/my experiment.toml'"));
/// ```
pub const ALL: &[EngineEntry] = &[slurm::ENTRY, parallel::ENTRY, dask::ENTRY, snakemake::ENTRY];

impl Jobs {
    /// Return the arguments of shard `index`, which an engine may write as a variable.
    fn shard(&self, index: &str) -> Vec<String> {
        let mut all = vec![text(&self.program), "run".into(), text(&self.experiment), "--out".into(), text(&self.out)];
        all.extend(["--shard".into(), format!("{index}/{}", self.shards), "--resume".into()]);
        all.extend(["--threads".into(), self.threads.to_string()]);
        if let Some(trials) = self.trials {
            all.extend(["--trials".into(), trials.to_string()]);
        }
        if let Some(isa) = &self.isa {
            all.extend(["--isa".into(), isa.clone()]);
        }
        all
    }

    /// Return the arguments of the merge.
    fn merge(&self) -> Vec<String> {
        vec![text(&self.program), "merge".into(), text(&self.out)]
    }

    /// Return a short name for queues.
    fn name(&self) -> String {
        let stem = self.experiment.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let plain = |c: char| if c.is_ascii_alphanumeric() || c == '-' || c == '_' { c } else { '-' };
        format!("cfpose-{}", stem.chars().map(plain).collect::<String>())
    }
}

fn text(path: &Path) -> String {
    path.to_string_lossy().into_owned()
}

/// Quote an argument for a POSIX shell.
fn quoted(argument: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./=,:+@%".contains(c);
    match !argument.is_empty() && argument.chars().all(plain) {
        true => argument.to_string(),
        false => format!("'{}'", argument.replace('\'', "'\\''")),
    }
}

/// Write a command for a POSIX shell.
fn shell(arguments: &[String]) -> String {
    arguments.iter().map(|argument| quoted(argument)).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shell_reads_arguments_back_as_they_are() {
        for argument in ["plain", "with blank", "it's", "$HOME `x` \"y\"", "", "a\nb", "*?"] {
            let printed =
                std::process::Command::new("sh").args(["-c", &format!("printf %s {}", quoted(argument))]).output();
            assert_eq!(String::from_utf8(printed.unwrap().stdout).unwrap(), argument);
        }
    }
}
