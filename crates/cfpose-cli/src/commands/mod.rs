//! One file for each command.

mod cells;
mod check;
mod conformance;
mod demo;
mod docs;
mod estimate;
mod evaluate;
mod learn;
mod list;
mod moments;
mod plan;
mod pose;
mod register;
mod results;
mod run;
mod segment;
mod shell;

use cfpose_lab::Lab;

use crate::args::Command;
use crate::failure::Failure;

/// Run a command with the entries of a lab.
///
/// # Errors
/// [`Failure`] with the kind that decides the exit code.
pub fn run(command: &Command, lab: &Lab) -> Result<(), Failure> {
    match command {
        Command::Demo(args) => demo::run(args, lab),
        Command::Estimate(args) => estimate::run(args, lab),
        Command::Evaluate(args) => evaluate::run(args, lab),
        Command::Moments(args) => moments::run(args, lab),
        Command::List(args) => list::run(args, lab),
        Command::Register(args) => register::run(args, lab),
        Command::Segment(args) => segment::run(args),
        Command::Cells(args) => cells::run(args),
        Command::Check(args) => check::run(args, lab),
        Command::Run(args) => run::run(args, lab),
        Command::Plan(args) => plan::run(args, lab),
        Command::Status(args) => results::status(args, lab),
        Command::Merge(args) => results::merge(args, lab),
        Command::Report(args) => results::report(args, lab),
        Command::Learn(args) => learn::run(args, lab),
        Command::Docs(args) => docs::run(args, lab),
        Command::Completions(args) => shell::completions(args),
        Command::Man(args) => shell::man(args),
        Command::Pose(args) => pose::run(args),
    }
}
