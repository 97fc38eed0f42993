//! The command line as clap sees it: the commands here, their arguments by what they are about.

use std::path::PathBuf;

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand, ValueEnum};

mod about;
mod experiments;
mod images;
mod moments;
mod pose;
mod problem;
mod reading;

pub use about::{CheckArgs, CompletionsArgs, DocsArgs, ListArgs, ListKind, ManArgs};
pub use experiments::{DemoArgs, FolderArgs, LearnArgs, PlanArgs, ReportArgs, RunArgs};
pub use images::{CellsArgs, LookArgs, RegisterArgs, SegmentArgs};
pub use moments::MomentsArgs;
pub use pose::{PoseArgs, PoseCommand, PoseTarget};
pub use problem::{EstimateArgs, EvaluateArgs, FrameName, Matching, ProblemArgs, Reflections};
pub use reading::{InvalidRows, ReadingArgs, Side, Thin, Weights};

/// Estimate a pose or another transformation between two point sets without correspondences.
#[derive(Debug, Parser)]
#[command(name = "cfpose", version, propagate_version = true, arg_required_else_help = true)]
#[command(after_help = "exit codes: 0 usable; 2 wrong arguments; 3 bad input; 4 it ran and has no usable result")]
pub struct Arguments {
    /// Command.
    #[command(subcommand)]
    pub command: Command,
}

/// Name of the program that ships with the library.
const SHIPPED: &str = "cfpose";

/// Return the name by which this process was called, without folders and `.exe`.
pub fn program() -> String {
    let called = std::env::args_os().next().map(PathBuf::from);
    let name = called.as_deref().and_then(|path| path.file_stem()).map(|name| name.to_string_lossy().into_owned());
    name.filter(|name| !name.is_empty()).unwrap_or_else(|| SHIPPED.to_string())
}

/// Return the definitions of all commands, under the name by which this process was called: of help, completions and manual.
pub fn command() -> clap::Command {
    let name = program();
    let command = Arguments::command().name(name.clone()).bin_name(&name).display_name(&name);
    if name == SHIPPED { command } else { command.version(concat!("with cfpose ", env!("CARGO_PKG_VERSION"))) }
}

/// Read the arguments of the process.
///
/// # Errors
/// What clap says, to be printed; help and version are such errors too.
pub fn parse() -> Result<Arguments, clap::Error> {
    Arguments::from_arg_matches(&command().try_get_matches()?)
}

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Simulate, estimate, print a table and draw an overlay: offline, from a seed
    Demo(DemoArgs),
    /// Estimate theta from two point files
    Estimate(EstimateArgs),
    /// Evaluate residual, Jacobian and feature means at one theta, without solving
    Evaluate(EvaluateArgs),
    /// Sum the moments of point files, or merge such sums: registration of any number of points in parts
    Moments(MomentsArgs),
    /// List what can be chosen by name
    List(ListArgs),
    /// Check registered entries: derivatives, conformance, conditioning, speed
    Check(CheckArgs),
    /// Register frames on a reference: images to poses, verdicts and overlays
    Register(RegisterArgs),
    /// Show what of an image is taken for the pattern
    Segment(SegmentArgs),
    /// Measure the registration of images on rendered pairs of known pose
    Cells(CellsArgs),
    /// Compute an experiment or a shard of it
    Run(RunArgs),
    /// Write job files that run an experiment in shards: Slurm, GNU parallel, Dask, Snakemake
    Plan(PlanArgs),
    /// Count what is there of a run
    Status(FolderArgs),
    /// Turn the records of all shards into tables
    Merge(FolderArgs),
    /// Print the tables of a run and write its report.html
    Report(ReportArgs),
    /// Train weights of the family `learned`
    Learn(LearnArgs),
    /// Work with pose files
    Pose(PoseArgs),
    /// Write the pages and lists of docs/reference from the tables
    Docs(DocsArgs),
    /// Write the completions of a shell to standard output
    Completions(CompletionsArgs),
    /// Write the manual page, or with --out one for each command
    Man(ManArgs),
}

/// Return the name of a value as it stands on the command line.
pub fn name_of<V: ValueEnum>(value: V) -> String {
    value.to_possible_value().map(|possible| possible.get_name().to_string()).unwrap_or_default()
}

/// Split a text at commas, semicolons and blanks and read every part as a number; `None` when one is none.
pub fn numbers(text: &str) -> Option<Vec<f64>> {
    let parts = text.split(|c: char| c == ',' || c == ';' || c.is_whitespace()).filter(|part| !part.is_empty());
    let list: Result<Vec<f64>, _> = parts.map(str::parse).collect();
    list.ok().filter(|list| !list.is_empty())
}
