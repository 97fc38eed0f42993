//! Rerun Table I (a) and (b) of the paper and print our figures beside the paper's.
//!
//! `cargo run --release -p cfpose-lab --example table1 -- TRIALS FOLDER [EXPERIMENT]` with, as defaults, 100 trials a cell,
//! the folder `table1-results` and `experiments/table1.toml`. Interrupt and start again: it goes on where it was.

use std::path::PathBuf;

use cfpose_lab::table::{published_tables, summary_table};
use cfpose_lab::{Experiment, Lab, LabError, RunOptions, run};

fn main() -> Result<(), LabError> {
    let mut arguments = std::env::args().skip(1);
    let trials = arguments.next().and_then(|text| text.parse().ok()).unwrap_or(100);
    let folder = PathBuf::from(arguments.next().unwrap_or_else(|| "table1-results".to_string()));
    let default = concat!(env!("CARGO_MANIFEST_DIR"), "/../../experiments/table1.toml");
    let file = PathBuf::from(arguments.next().unwrap_or_else(|| default.to_string()));
    let lab = Lab::default();
    let experiment = Experiment::load(&lab, &file)?.with_trials(trials);
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let options = RunOptions { resume: true, threads, ..RunOptions::new(folder) };
    let report = run(&lab, &experiment, &options)?;
    if let Some(merged) = report.merged {
        println!("{}", summary_table(&merged.rows));
        println!("{}", published_tables(&experiment, &merged.rows));
    }
    Ok(())
}
