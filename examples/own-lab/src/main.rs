//! A program of your own: every command of `cfpose`, with one model, one family, one solver and two scenarios more:
//! point sets, and a least-squares problem without any.
//!
//! ```text
//! cargo run -p own-lab -- list models
//! cargo run -p own-lab -- check bumps
//! cargo run -p own-lab -- run examples/own-lab/compare.toml
//! ```

mod beacons;
mod bumps;
mod delayed_gratification;
mod leaf;
mod stretch2;

use std::process::ExitCode;

use cfpose_lab::Lab;

fn main() -> ExitCode {
    let mut lab = Lab::default();
    lab.registry.models.push(&stretch2::ENTRY);
    lab.registry.families.push(&bumps::ENTRY);
    lab.registry.solvers.push(&delayed_gratification::ENTRY);
    lab.scenarios.push(&leaf::ENTRY);
    lab.scenarios.push(&beacons::ENTRY);
    cfpose_cli::main_with(lab)
}
