//! One file for each command.

mod check;
mod conformance;
mod demo;
mod docs;
mod estimate;
mod evaluate;
mod list;
mod pose;
mod results;
mod run;

use crate::args::Command;
use crate::failure::Failure;

/// Run a command.
///
/// # Errors
/// [`Failure`] with the kind that decides the exit code.
pub fn run(command: &Command) -> Result<(), Failure> {
    match command {
        Command::Demo(args) => demo::run(args),
        Command::Estimate(args) => estimate::run(args),
        Command::Evaluate(args) => evaluate::run(args),
        Command::List(args) => list::run(args),
        Command::Check(args) => check::run(args),
        Command::Run(args) => run::run(args),
        Command::Status(args) => results::status(args),
        Command::Merge(args) => results::merge(args),
        Command::Report(args) => results::report(args),
        Command::Docs(args) => docs::run(args),
        Command::Pose(args) => pose::run(args),
    }
}
