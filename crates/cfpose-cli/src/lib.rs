//! The command line of `cfpose` as a library: every command over the models, families, solvers and scenarios of a [`Lab`].
//!
//! The program `cfpose` is one call of [`main_with`] with the entries that ship. A program of yours with entries of its own makes
//! the same call with a [`Lab`] that holds them too, and has them in every list, check, estimate and experiment; see
//! `docs/adding/own-program.md`. The contract of commands, JSON fields and exit codes is `docs/program.md`.
//!
//! The crate reads arguments and files, calls the libraries and prints; it holds no mathematics.

mod args;
mod commands;
mod failure;
mod inputs;
mod output;
mod progress;
mod report;
mod signals;
mod starts;

use std::panic::AssertUnwindSafe;
use std::process::ExitCode;

use cfpose_lab::Lab;

use failure::Failure;

/// Run the command that the arguments of the process name, with the entries of `lab`, and return the exit code.
///
/// Results go to standard output, messages to standard error. Help and messages carry the name by which the program was called.
/// Names of models, families, normalisers, weightings, starts and solvers are looked up in `lab.registry`, scenarios in
/// `lab.scenarios`, nowhere else.
///
/// Exit codes: 0 usable; 2 wrong arguments; 3 bad input; 4 it ran and has no usable result; 130 and 143 a run stopped by a signal. It does not panic on any input; a panic in the code of
/// an entry of yours is caught and noted with its place.
///
/// ```
/// // The program `cfpose` whole; push entries of your own to `lab.registry` and `lab.scenarios` first.
/// fn main() -> std::process::ExitCode {
///     let lab = cfpose_lab::Lab::default();
/// #   if true { return std::process::ExitCode::SUCCESS } // a documentation test has no arguments to run with
///     cfpose_cli::main_with(lab)
/// }
/// ```
pub fn main_with(lab: Lab) -> ExitCode {
    let arguments = match args::parse() {
        Ok(arguments) => arguments,
        Err(error) => {
            // Help and version are no error; a closed pipe while they are printed is none either.
            let _ = error.print();
            return ExitCode::from(u8::try_from(error.exit_code()).unwrap_or(2));
        }
    };
    std::panic::set_hook(Box::new(|panic| output::panicked(&panic.to_string())));
    let run = AssertUnwindSafe(|| commands::run(&arguments.command, &lab));
    match std::panic::catch_unwind(run) {
        Ok(Ok(())) => ExitCode::SUCCESS,
        Ok(Err(failure)) => report(&failure),
        Err(_) => report(&Failure::unusable("the code of an entry panicked, see the note above; correct it there")),
    }
}

/// Print the one line of a failure and return its exit code.
fn report(failure: &Failure) -> ExitCode {
    if failure.is_broken_pipe() {
        return ExitCode::SUCCESS;
    }
    // The libraries name commands by the program that ships; here they are those of this one.
    let message = failure.message().replace("`cfpose ", &format!("`{} ", args::program()));
    output::note(&format!("error: {message}"));
    ExitCode::from(failure.kind.exit_code())
}

#[cfg(doctest)]
#[doc = include_str!("../../../docs/adding/own-program.md")]
mod own_program {}
