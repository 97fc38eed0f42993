//! `cfpose run --only KEY`: one trial again, with its point files.

use std::path::Path;

use cfpose::theta::RotationForm;
use cfpose::{BuildContext, Isa};
use cfpose_lab::{Experiment, Lab, Record, replay};
use cfpose_vision::write_points;
use serde_json::json;

use crate::args::{RunArgs, program};
use crate::failure::Failure;
use crate::output::{self, number};

/// Compute the trial, write source, target and truth, print what every method found.
pub(super) fn run(
    args: &RunArgs,
    lab: &Lab,
    experiment: &Experiment,
    key: &str,
    isa: Isa,
    out: &Path,
) -> Result<(), Failure> {
    let again = replay(lab, experiment, key, isa)?;
    let folder = out.join(format!("only-{}", key.trim().trim_start_matches("0x").to_lowercase()));
    std::fs::create_dir_all(&folder).map_err(|error| Failure::input(format!("{}: {error}", folder.display())))?;
    let (source, target) = (folder.join("source.csv"), folder.join("target.csv"));
    write_points(&source, &again.trial.source)?;
    write_points(&target, &again.trial.target)?;
    let layout = lab.registry.model(&again.model, &BuildContext::default())?.layout;
    let list = |theta: &[f64]| layout.to_list(theta, RotationForm::Vector);
    let value = json!({
        "key": key,
        "cell": again.cell.label(),
        "repetition": again.repetition,
        "model": again.model,
        "truth": list(&again.trial.truth),
        "start": again.trial.start.as_deref().map(list),
        "source": source,
        "target": target,
        "records": again.records,
    });
    output::write_file(&folder.join("trial.json"), &format!("{value:#}\n"))?;
    let rows: Vec<Vec<String>> = again.records.iter().map(row).collect();
    let header = ["method", "success", "verdict", "status", "rotation off (deg)", "translation off", "cost", "message"];
    let start = again.trial.start.as_deref().map_or_else(String::new, |theta| {
        let numbers: Vec<String> = list(theta).iter().map(f64::to_string).collect();
        format!(" --start={}", numbers.join(","))
    });
    let text = format!(
        "{}, repetition {}\n{}\npoints and truth are in {}\ntry     {} estimate --model {} --source {} --target {}{start}",
        again.cell.label(),
        again.repetition,
        output::table(&header, &rows),
        folder.display(),
        program(),
        again.model,
        source.display(),
        target.display(),
    );
    let json = args.json.as_deref();
    output::show(&text, json)?;
    output::write_json(&value, json)
}

fn row(record: &Record) -> Vec<String> {
    let cell = |value: Option<f64>| value.map_or_else(|| "-".to_string(), number);
    vec![
        record.method.clone(),
        record.success.to_string(),
        record.verdict.clone().unwrap_or_else(|| "-".to_string()),
        record.status.clone(),
        cell(record.rotation_deg),
        cell(record.translation),
        cell(record.cost),
        record.message.clone().unwrap_or_default(),
    ]
}
