//! The program `cfpose`: the library of this package over the entries that it ships.

use std::process::ExitCode;

fn main() -> ExitCode {
    cfpose_cli::main_with(cfpose_lab::Lab::default())
}
