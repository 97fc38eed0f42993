//! `cfpose run`: compute an experiment or a shard of it.

use std::io::IsTerminal;
use std::path::{Path, PathBuf};

use cfpose_lab::{Experiment, Lab, Plan, Progress, RunOptions, RunReport, Shard};
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::json;

use crate::args::RunArgs;
use crate::failure::Failure;
use crate::{inputs, output};

/// Variables that job arrays set: index, count, and the variable that holds the first index if that is not 0.
const ARRAYS: [(&str, &str, Option<&str>); 5] = [
    ("SLURM_ARRAY_TASK_ID", "SLURM_ARRAY_TASK_COUNT", Some("SLURM_ARRAY_TASK_MIN")),
    ("SLURM_PROCID", "SLURM_NTASKS", None),
    ("OMPI_COMM_WORLD_RANK", "OMPI_COMM_WORLD_SIZE", None),
    ("PMI_RANK", "PMI_SIZE", None),
    ("CFPOSE_SHARD", "CFPOSE_SHARDS", None),
];

/// Run the command.
///
/// # Errors
/// [`Failure`] of the experiment file, the shard or the folder.
pub fn run(args: &RunArgs, lab: &Lab) -> Result<(), Failure> {
    let shard = shard(args.shard.as_deref(), |name| std::env::var(name).ok())?;
    let isa = inputs::isa(&args.isa)?;
    let mut experiment = Experiment::load(lab, &args.experiment)?;
    if let Some(trials) = args.trials {
        experiment = experiment.with_trials(trials as usize);
    }
    if args.dry {
        return dry(args, lab, &experiment, shard);
    }
    let out = args.out.clone().unwrap_or_else(|| default_folder(&args.experiment));
    let bar = bar();
    let show = |progress: Progress| {
        bar.set_length(progress.total as u64);
        bar.set_position(progress.done as u64);
        bar.set_message(format!("{} of {} successes", progress.successes, progress.computed));
    };
    let options = RunOptions {
        shard,
        resume: args.resume,
        threads: inputs::num_threads(args.threads),
        isa,
        progress: Some(&show),
        ..RunOptions::new(&out)
    };
    let report = cfpose_lab::run(lab, &experiment, &options)?;
    bar.finish_and_clear();
    tell(args, &out, shard, &report)
}

/// Make a progress bar that is drawn on a terminal only.
fn bar() -> ProgressBar {
    if !std::io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::new(0);
    if let Ok(style) = ProgressStyle::with_template("{bar:40} {pos}/{len} trials, {msg} [{elapsed}, left {eta}]") {
        bar.set_style(style);
    }
    bar
}

/// Return out/NAME for NAME.toml.
fn default_folder(experiment: &Path) -> PathBuf {
    Path::new("out").join(experiment.file_stem().unwrap_or(experiment.as_os_str()))
}

/// Read `I/N`, or look for a job array in the environment.
fn shard(text: Option<&str>, variable: impl Fn(&str) -> Option<String>) -> Result<Shard, Failure> {
    let Some(text) = text else { return Ok(Shard::WHOLE) };
    if text != "auto" {
        return Ok(text.parse()?);
    }
    let number = |name: &str| variable(name).and_then(|value| value.trim().parse::<usize>().ok());
    for (index, count, first) in ARRAYS {
        if let (Some(index), Some(count)) = (number(index), number(count)) {
            let first = first.and_then(number).unwrap_or(0);
            return Ok(format!("{}/{count}", index.saturating_sub(first)).parse()?);
        }
    }
    let names: Vec<&str> = ARRAYS.iter().map(|(index, _, _)| *index).collect();
    Err(Failure::usage(format!("--shard auto: none of {} is set; give --shard I/N", names.join(", "))))
}

/// Print what would be computed.
fn dry(args: &RunArgs, lab: &Lab, experiment: &Experiment, shard: Shard) -> Result<(), Failure> {
    let plan = Plan::new(lab, experiment)?;
    let mine = plan.shard(shard).len() * plan.methods.len();
    let cells: Vec<_> = plan.cells.iter().map(|cell| json!({ "cell": cell.label(), "trials": cell.trials })).collect();
    let value = json!({
        "experiment": experiment.fingerprint(),
        "cells": cells,
        "methods": plan.methods,
        "records": plan.num_records(),
        "shard": shard.to_string(),
        "shard_records": mine,
    });
    let rows: Vec<Vec<String>> = plan.cells.iter().map(|cell| vec![cell.label(), cell.trials.to_string()]).collect();
    let text = format!(
        "{}\nmethods: {}\nrecords: {} ({mine} in shard {shard})",
        output::table(&["cell", "trials"], &rows),
        plan.methods.join(", "),
        plan.num_records(),
    );
    let json = args.json.as_deref();
    output::show(&text, json)?;
    output::write_json(&value, json)
}

/// Print the tables of a complete run, or what is missing.
fn tell(args: &RunArgs, out: &Path, shard: Shard, report: &RunReport) -> Result<(), Failure> {
    let mut text = String::new();
    if let Some(merged) = &report.merged {
        text = cfpose_lab::merge::tables(&merged.experiment, &merged.rows) + "\n";
    }
    text += &format!(
        "{} records computed, {} were there; {} of {} in {}",
        report.computed,
        report.resumed,
        report.records,
        report.expected,
        out.display()
    );
    if report.merged.is_some() {
        text += &format!("; look at {}", out.join("report.html").display());
    }
    let json = args.json.as_deref();
    output::show(&text, json)?;
    let value = json!({
        "out": out,
        "shard": shard.to_string(),
        "computed": report.computed,
        "resumed": report.resumed,
        "records": report.records,
        "expected": report.expected,
        "complete": report.merged.is_some(),
        "summary": report.merged.as_ref().map(|merged| &merged.rows),
    });
    output::write_json(&value, json)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shard_comes_from_the_job_array() {
        let slurm = |name: &str| match name {
            "SLURM_ARRAY_TASK_ID" => Some("3".to_string()),
            "SLURM_ARRAY_TASK_COUNT" => Some("4".to_string()),
            "SLURM_ARRAY_TASK_MIN" => Some("1".to_string()),
            _ => None,
        };
        assert_eq!(shard(Some("auto"), slurm).unwrap(), Shard { index: 2, count: 4 });
        assert_eq!(shard(Some("0/2"), slurm).unwrap(), Shard { index: 0, count: 2 });
        assert_eq!(shard(None, slurm).unwrap(), Shard::WHOLE);
        assert!(shard(Some("auto"), |_| None).unwrap_err().message().contains("SLURM_ARRAY_TASK_ID"));
    }
}
