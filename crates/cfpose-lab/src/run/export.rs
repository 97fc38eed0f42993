//! The point files of all trials, for other programs.

use std::fs;
use std::path::Path;

use cfpose::theta::RotationForm;
use cfpose::{BuildContext, Execution, Isa};
use cfpose_vision::write_points;
use serde_json::json;

use super::{Bench, load_scenarios, scenario_error};
use crate::config::Experiment;
use crate::data;
use crate::error::LabError;
use crate::folder::{io_error, make_folder};
use crate::lab::Lab;
use crate::plan::Plan;
use crate::scenario::ScenarioError;
use crate::trial::Drawn;

/// What an export wrote.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Exported {
    /// Trials with point files.
    pub trials: usize,
    /// Trials whose draw left no points, and trials that are least-squares problems.
    pub without_points: usize,
}

/// Write the points of every trial as `KEY/source.csv` and `KEY/target.csv`, and `trials.jsonl` with one JSON object a trial: `key`,
/// `cell`, `repetition`, `model`, `truth` and `start` (lists, rotations as vectors; start may be null), `source`, `target` (names of
/// the files).
///
/// Thetas that other programs find in them come back as [`crate::rows`].
///
/// # Errors
/// [`LabError`] for a scenario that cannot be built or read, and for files that cannot be written.
pub fn export(lab: &Lab, experiment: &Experiment, folder: &Path) -> Result<Exported, LabError> {
    let plan = Plan::new(lab, experiment)?;
    let scenarios = load_scenarios(lab, experiment, &plan)?;
    let bench = Bench {
        lab,
        experiment,
        fingerprint: &experiment.fingerprint(),
        execution: Execution { isa: Isa::detect(), pool: None },
        cancel: None,
        data: &data::hashes(&scenarios)?,
        rows: None,
    };
    make_folder(folder)?;
    let (mut lines, mut exported) = (String::new(), Exported { trials: 0, without_points: 0 });
    for planned in &plan.trials {
        let (cell, scenario) = (&plan.cells[planned.cell], scenarios[planned.cell].as_ref());
        let trial = match bench.draw(scenario, planned) {
            Ok(Drawn::Points(trial)) => trial,
            Ok(Drawn::Problem(_)) | Err(ScenarioError::Points { .. } | ScenarioError::Impossible(_)) => {
                exported.without_points += 1;
                continue;
            }
            Err(problem) => return Err(scenario_error(cell, problem)),
        };
        let key = format!("{:016x}", planned.key);
        make_folder(&folder.join(&key))?;
        let names = ["source", "target"].map(|side| format!("{key}/{side}.csv"));
        for (name, points) in names.iter().zip([&trial.source, &trial.target]) {
            let path = folder.join(name);
            write_points(&path, points)
                .map_err(|problem| io_error(&path, "write")(std::io::Error::other(problem.to_string())))?;
        }
        let built = lab.registry.model(scenario.model(), &BuildContext::default());
        let layout =
            built.map_err(|problem| scenario_error(cell, ScenarioError::Impossible(problem.to_string())))?.layout;
        let list = |theta: &[f64]| layout.to_list(theta, RotationForm::Vector);
        let line = json!({
            "key": key,
            "cell": cell.label(),
            "repetition": planned.repetition,
            "model": scenario.model(),
            "truth": list(&trial.truth),
            "start": trial.start.as_deref().map(list),
            "source": names[0],
            "target": names[1],
        });
        lines += &format!("{line}\n");
        exported.trials += 1;
    }
    let path = folder.join("trials.jsonl");
    fs::write(&path, lines).map_err(io_error(&path, "write"))?;
    Ok(exported)
}
