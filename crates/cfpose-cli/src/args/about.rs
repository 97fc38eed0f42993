//! Arguments of the commands that tell about the program: lists, checks, documents, completions, manual.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

/// Arguments of `list`.
#[derive(Debug, Args)]
pub struct ListArgs {
    /// What to list
    pub kind: ListKind,
    /// Write JSON to a file, or to standard output for -
    #[arg(long, value_name = "FILE|-")]
    pub json: Option<PathBuf>,
}

/// Arguments of `check`.
#[derive(Debug, Args)]
pub struct CheckArgs {
    /// A model, family or solver; all when not given
    pub name: Option<String>,
    /// Check models and families on these points instead of random ones
    #[arg(long, value_name = "FILE")]
    pub on: Option<PathBuf>,
    /// Seed of the random points and thetas
    #[arg(long, value_name = "K", default_value_t = 0)]
    pub seed: u64,
    /// Instruction set: auto, avx512, avx2 or baseline
    #[arg(long, value_name = "ISA", default_value = "auto")]
    pub isa: String,
    /// Write JSON to a file, or to standard output for -
    #[arg(long, value_name = "FILE|-")]
    pub json: Option<PathBuf>,
}

/// Arguments of `docs`.
#[derive(Debug, Args)]
pub struct DocsArgs {
    /// Write nothing; fail where a file differs from the tables
    #[arg(long)]
    pub check: bool,
    /// Folder of the project
    #[arg(long, value_name = "DIR", default_value = ".")]
    pub root: PathBuf,
}

/// Arguments of `completions`.
#[derive(Debug, Args)]
pub struct CompletionsArgs {
    /// Shell
    pub shell: clap_complete::Shell,
}

/// Arguments of `man`.
#[derive(Debug, Args)]
pub struct ManArgs {
    /// Folder of the pages
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}

/// The tables of `list`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
#[allow(missing_docs)]
pub enum ListKind {
    Models,
    Families,
    Solvers,
    Normalisers,
    Weightings,
    Starts,
    Scenarios,
    Curves,
    Objectives,
    Presets,
    Formats,
}
