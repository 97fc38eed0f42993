//! `cfpose run`: compute an experiment or a shard of it.

mod only;
mod shard;

use std::io::IsTerminal;
use std::path::{Path, PathBuf};

use cfpose_lab::folder::{EXPERIMENT, own_files};
use cfpose_lab::{Experiment, Lab, Plan, Progress, Rows, RunOptions, RunReport, Shard};
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::json;

use crate::args::RunArgs;
use crate::failure::{Failure, Kind};
use crate::signals::Signals;
use crate::{inputs, output};

/// Run the command.
///
/// # Errors
/// [`Failure`] of the experiment file, the shard or the folder; records that should be there and are not; a signal.
pub fn run(args: &RunArgs, lab: &Lab) -> Result<(), Failure> {
    let out = args.out.clone().unwrap_or_else(|| default_folder(&args.experiment));
    let shard = shard::parse(args.shard.as_deref(), &out, |name| std::env::var(name).ok())?;
    let isa = inputs::isa(&args.isa)?;
    keep_input(args, &out)?;
    let (lab, mut experiment) = load(lab, &args.experiment)?;
    let lab = &lab;
    if let Some(trials) = args.trials {
        experiment = experiment.with_trials(trials as usize);
    }
    if let Some(key) = &args.only {
        return only::run(args, lab, &experiment, key, isa, &out);
    }
    if args.dry {
        return dry(args, lab, &experiment, shard);
    }
    if let Some(folder) = &args.export_data {
        let exported = cfpose_lab::export(lab, &experiment, folder)?;
        let text = format!(
            "{} trials in {}, {} without points; trials.jsonl lists them",
            exported.trials,
            folder.display(),
            exported.without_points
        );
        output::show(&text, args.json.as_deref())?;
        let value = json!({ "trials": exported.trials, "without_points": exported.without_points, "folder": folder });
        return output::write_json(&value, args.json.as_deref());
    }
    let rows = args.import_rows.as_ref().map(|path| Rows::load(path, &experiment)).transpose()?;
    let signals = Signals::watch();
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
        cancel: Some(signals.flag()),
        rows: rows.as_ref(),
        progress: Some(&show),
        ..RunOptions::new(&out)
    };
    let mut report = cfpose_lab::run(lab, &experiment, &options)?;
    bar.finish_and_clear();
    let stopped = signals.caught().filter(|_| report.missing > 0);
    if stopped.is_some() {
        // Tables of what is there.
        report.merged = Some(cfpose_lab::merge(lab, &out)?);
    }
    tell(args, &out, shard, &report)?;
    let missing = format!("{} record(s) of shard {shard} are missing", report.missing);
    match stopped {
        None if report.missing == 0 => Ok(()),
        None => Err(Failure::unusable(format!(
            "{}: {missing}, something else changed the folder; run again with --resume",
            out.display()
        ))),
        Some((code, name)) => {
            let error = anyhow::anyhow!("stopped by {name}: {missing}; go on with --resume");
            Err(Failure { kind: Kind::Stopped(code), error })
        }
    }
}

/// Read an experiment, and the weight files that its methods name, relative to its folder.
pub(super) fn load(lab: &Lab, path: &Path) -> Result<(Lab, Experiment), Failure> {
    let experiment = Experiment::load(lab, path)?;
    let names = experiment.methods.iter().flat_map(cfpose_lab::Method::files);
    let registry = inputs::with_files(&lab.registry, names, &experiment.folder)?;
    Ok((Lab { registry, scenarios: lab.scenarios.clone() }, experiment))
}

/// Refuse to write over the experiment file, or with the JSON over the results.
fn keep_input(args: &RunArgs, out: &Path) -> Result<(), Failure> {
    let (experiment, own) = (std::slice::from_ref(&args.experiment), out.join(EXPERIMENT));
    // Without other trials the experiment of the folder is not written again.
    let grows = args.trials.is_some() && own.is_file();
    output::keep_apart(experiment, &[args.json.as_deref(), grows.then_some(own.as_path())])?;
    let mut files = own_files(out)?;
    files.retain(|path| !output::same_file(path, &args.experiment));
    output::keep_apart(&files, &[args.json.as_deref()])
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

/// Print the tables, of a complete run or of what is there, and counts.
fn tell(args: &RunArgs, out: &Path, shard: Shard, report: &RunReport) -> Result<(), Failure> {
    let mut text = String::new();
    if let Some(merged) = &report.merged {
        text = cfpose_lab::merge::tables(&merged.experiment, &merged.rows) + &merged.conditions + "\n";
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
        "missing": report.missing,
        "complete": report.records == report.expected,
        "summary": report.merged.as_ref().map(|merged| &merged.rows),
    });
    output::write_json(&value, json)
}
