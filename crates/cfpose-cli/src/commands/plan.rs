//! `cfpose plan`: job files that run an experiment in shards on an engine.

use std::path::{Path, PathBuf};

use cfpose_lab::jobs::{ALL, Emitted, Jobs};
use cfpose_lab::{Lab, Plan};
use serde_json::json;

use crate::args::PlanArgs;
use crate::failure::Failure;
use crate::{inputs, output};

/// Run the command.
///
/// # Errors
/// [`Failure`] of the experiment file, an unknown engine, more shards than trials, a folder that cannot be written.
pub fn run(args: &PlanArgs, lab: &Lab) -> Result<(), Failure> {
    let engine = ALL.iter().find(|engine| engine.name == args.emit).ok_or_else(|| {
        let known: Vec<&str> = ALL.iter().map(|engine| engine.name).collect();
        Failure::usage(format!("--emit {}: no such engine; known are {}", args.emit, known.join(", ")))
    })?;
    let (lab, mut experiment) = super::run::load(lab, &args.experiment)?;
    let lab = &lab;
    if let Some(trials) = args.trials {
        experiment = experiment.with_trials(trials as usize);
    }
    let plan = Plan::new(lab, &experiment)?;
    if args.shards as usize > plan.trials.len() {
        let trials = plan.trials.len();
        return Err(Failure::usage(format!(
            "--shards {}: the experiment has {trials} trials; give fewer",
            args.shards
        )));
    }
    if let Some(isa) = &args.isa {
        inputs::isa(isa)?;
    }
    let stem = args.experiment.file_stem().unwrap_or(args.experiment.as_os_str()).to_os_string();
    let out = args.out.clone().unwrap_or_else(|| Path::new("out").join(&stem));
    let folder = args.jobs.clone().unwrap_or_else(|| Path::new("jobs").join(&stem).join(engine.name));
    let program = std::env::current_exe().map_err(|error| Failure::input(format!("this program's file: {error}")))?;
    let jobs = Jobs {
        program,
        experiment: absolute(&args.experiment)?,
        out: absolute(&out)?,
        shards: args.shards as usize,
        trials: args.trials,
        threads: args.threads,
        isa: args.isa.clone(),
    };
    let emitted = (engine.emit)(&jobs);
    write(&folder, &emitted)?;
    tell(args, &jobs, &folder, &emitted, plan.num_records())
}

/// Return a path that holds in any working folder.
fn absolute(path: &Path) -> Result<PathBuf, Failure> {
    std::path::absolute(path).map_err(|error| Failure::input(format!("{}: {error}", path.display())))
}

fn write(folder: &Path, emitted: &Emitted) -> Result<(), Failure> {
    std::fs::create_dir_all(folder).map_err(|error| Failure::input(format!("{}: {error}", folder.display())))?;
    emitted.files.iter().try_for_each(|file| output::write_file(&folder.join(&file.name), &file.text))
}

fn tell(args: &PlanArgs, jobs: &Jobs, folder: &Path, emitted: &Emitted, records: usize) -> Result<(), Failure> {
    let files: Vec<PathBuf> = emitted.files.iter().map(|file| folder.join(&file.name)).collect();
    let names: Vec<String> = files.iter().map(|path| path.display().to_string()).collect();
    let text = format!(
        "{records} records in {} shard(s), results in {}\nwritten: {}\nstart with: cd {} && {}",
        jobs.shards,
        jobs.out.display(),
        names.join(", "),
        folder.display(),
        emitted.command
    );
    let value = json!({
        "engine": args.emit,
        "shards": jobs.shards,
        "records": records,
        "out": jobs.out,
        "files": files,
        "folder": folder,
        "command": emitted.command,
    });
    output::show(&text, args.json.as_deref())?;
    output::write_json(&value, args.json.as_deref())
}
