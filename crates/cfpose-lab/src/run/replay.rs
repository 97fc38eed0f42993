//! One trial again: its data, its truth, and what every method does with it.

use cfpose::{Execution, Isa};

use super::{Bench, load_scenarios, scenario_error};
use crate::config::Experiment;
use crate::data;
use crate::error::LabError;
use crate::lab::Lab;
use crate::method::Method;
use crate::plan::{Cell, Plan};
use crate::record::Record;
use crate::scenario::{ScenarioError, Trial};
use crate::trial::Drawn;

/// One trial and its records.
#[derive(Debug, Clone, PartialEq)]
pub struct Replay {
    /// The cell that the trial belongs to.
    pub cell: Cell,
    /// Repetition, from 0.
    pub repetition: usize,
    /// Model of the scenario, in which truth and start are written.
    pub model: String,
    /// The data.
    pub trial: Trial,
    /// One record a method, as a run writes them.
    pub records: Vec<Record>,
}

/// Compute one trial of an experiment again, without writing anything.
///
/// ```
/// use cfpose::Isa;
/// use cfpose_lab::{Experiment, Lab, Plan, replay};
/// let text = "trials = 2\n[[scenario]]\nname = \"cloud3\"\npoints = 30\n[[method]]\nname = \"paper\"\n";
/// let lab = Lab::default();
/// let experiment = Experiment::parse(&lab, text, "two.toml").unwrap();
/// let key = format!("{:016x}", Plan::new(&lab, &experiment).unwrap().trials[1].key);
/// let again = replay(&lab, &experiment, &key, Isa::detect()).unwrap();
/// assert_eq!((again.repetition, again.trial.source.len(), again.records.len()), (1, 30, 1));
/// ```
///
/// # Errors
/// [`LabError`] for a key that no trial has and for data that cannot be drawn.
pub fn replay(lab: &Lab, experiment: &Experiment, key: &str, isa: Isa) -> Result<Replay, LabError> {
    let plan = Plan::new(lab, experiment)?;
    let number = u64::from_str_radix(key.trim().trim_start_matches("0x"), 16).ok();
    let planned = plan.trials.iter().find(|trial| Some(trial.key) == number);
    let mut planned = *planned.ok_or_else(|| LabError::NoTrial { key: key.to_string() })?;
    let cell = plan.cells[planned.cell].clone();
    let only = Plan { cells: vec![cell.clone()], ..plan };
    let scenarios = load_scenarios(lab, experiment, &only)?;
    let scenario = scenarios[0].as_ref();
    planned.cell = 0;
    let bench = Bench {
        lab,
        experiment,
        fingerprint: &experiment.fingerprint(),
        execution: Execution { isa, pool: None },
        cancel: None,
        data: &data::hashes(&scenarios)?,
        rows: None,
    };
    let trial = match bench.draw(scenario, &planned) {
        Ok(Drawn::Points(trial)) => trial,
        Ok(Drawn::Problem(_)) => {
            let words = "its trials are least-squares problems; there are no points to write".to_string();
            return Err(scenario_error(&cell, ScenarioError::Impossible(words)));
        }
        Err(problem) => return Err(scenario_error(&cell, problem)),
    };
    let methods: Vec<&Method> = experiment.methods.iter().filter(|method| !method.external).collect();
    let records = bench.records(scenario, &cell, &planned, &methods);
    Ok(Replay { repetition: planned.repetition, model: scenario.model().to_string(), trial: *trial, records, cell })
}
