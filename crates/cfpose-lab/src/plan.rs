//! What an experiment will compute: cells, trials, shards.

use std::fmt;
use std::str::FromStr;

use cfpose::entry::{EntryError, Parameters, find};

use crate::config::Experiment;
use crate::error::LabError;
use crate::lab::Lab;
use crate::scenario::Scenario;
use crate::seed::trial_key;
use crate::value::canonical;

/// One cell of a grid: a scenario with all parameters fixed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Cell {
    /// Name of the scenario.
    pub scenario: String,
    /// (parameter, value as canonical text), in the table's order.
    pub parameters: Vec<(String, String)>,
    /// Number of trials.
    pub trials: usize,
}

impl Cell {
    /// Return the cell as `name[key=value,...]`, all parameters included.
    pub fn label(&self) -> String {
        let parts: Vec<String> = self.parameters.iter().map(|(key, value)| format!("{key}={value}")).collect();
        format!("{}[{}]", self.scenario, parts.join(","))
    }

    /// Return the value of a parameter.
    pub fn parameter(&self, key: &str) -> Option<&str> {
        self.parameters.iter().find(|(k, _)| k == key).map(|(_, value)| value.as_str())
    }

    /// Build the scenario.
    ///
    /// # Errors
    /// [`EntryError`] for an unknown name or a bad value.
    pub fn build(&self, lab: &Lab) -> Result<Box<dyn Scenario>, EntryError> {
        let (entry, _) = find("scenario", &lab.scenarios, &self.scenario)?;
        let parameters = Parameters::resolve("scenario", entry.name, entry.parameters, &self.parameters)?;
        (entry.build)(&parameters)
    }

    /// Return the keys of all trials of the cell, by repetition.
    pub fn keys(&self, lab: &Lab) -> Vec<u64> {
        let changed = self.changed(lab);
        (0..self.trials).map(|repetition| trial_key(&self.scenario, &changed, repetition)).collect()
    }

    /// Return the parameters that differ from their default.
    fn changed(&self, lab: &Lab) -> Vec<(String, String)> {
        let entry = lab.scenarios.iter().find(|entry| entry.name == self.scenario);
        let is_default = |key: &str, value: &str| {
            let specs = entry.map_or(&[][..], |entry| entry.parameters);
            specs.iter().any(|spec| spec.name == key && canonical(spec.default) == value)
        };
        self.parameters.iter().filter(|(key, value)| !is_default(key, value)).cloned().collect()
    }
}

/// One part of a run that is split over processes or machines.
///
/// ```
/// use cfpose_lab::Shard;
/// let shard: Shard = "1/4".parse().unwrap();
/// assert_eq!((shard.index, shard.count), (1, 4));
/// assert!("4/4".parse::<Shard>().unwrap_err().to_string().contains("from 0"));
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shard {
    /// Index, from 0.
    pub index: usize,
    /// Number of shards.
    pub count: usize,
}

impl Shard {
    /// The whole run.
    pub const WHOLE: Shard = Shard { index: 0, count: 1 };

    /// Say whether the shard computes trial number `position` of the plan.
    pub fn holds(self, position: usize) -> bool {
        position % self.count == self.index
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.index, self.count)
    }
}

impl FromStr for Shard {
    type Err = LabError;

    fn from_str(text: &str) -> Result<Self, LabError> {
        let error = |problem| LabError::Shard { text: text.to_string(), problem };
        let (index, count) = text.split_once('/').ok_or_else(|| error("there is no `/`"))?;
        let number = |part: &str| part.trim().parse::<usize>().map_err(|_| error("these are not two whole numbers"));
        let (index, count) = (number(index)?, number(count)?);
        if index >= count {
            return Err(error("I counts from 0 and is below N"));
        }
        Ok(Self { index, count })
    }
}

/// One trial of the plan: its data are computed once, for all methods.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PlannedTrial {
    /// Index of the cell.
    pub cell: usize,
    /// Repetition, from 0.
    pub repetition: usize,
    /// Key.
    pub key: u64,
}

/// Most trials of one experiment: their plan is held in memory.
pub const MAX_TRIALS: usize = 10_000_000;

/// All trials of an experiment in order.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// Cells.
    pub cells: Vec<Cell>,
    /// Names of the methods.
    pub methods: Vec<String>,
    /// Trials, cell by cell.
    pub trials: Vec<PlannedTrial>,
}

impl Plan {
    /// Lay out an experiment. This is what `--dry` prints.
    ///
    /// # Errors
    /// [`LabError::TooManyTrials`] above [`MAX_TRIALS`] trials over all cells.
    pub fn new(lab: &Lab, experiment: &Experiment) -> Result<Self, LabError> {
        let cells = experiment.cells();
        let asked = cells.iter().fold(0_usize, |sum, cell| sum.saturating_add(cell.trials));
        if asked > MAX_TRIALS {
            return Err(LabError::TooManyTrials { asked, limit: MAX_TRIALS });
        }
        let mut trials = Vec::new();
        for (index, cell) in cells.iter().enumerate() {
            let keys = cell.keys(lab).into_iter().enumerate();
            trials.extend(keys.map(|(repetition, key)| PlannedTrial { cell: index, repetition, key }));
        }
        Ok(Self { cells, methods: experiment.methods.iter().map(|method| method.name.clone()).collect(), trials })
    }

    /// Return the number of records of a complete run: trials x methods.
    pub fn num_records(&self) -> usize {
        self.trials.len() * self.methods.len()
    }

    /// Return the trials of a shard.
    pub fn shard(&self, shard: Shard) -> Vec<PlannedTrial> {
        let numbered = self.trials.iter().enumerate();
        numbered.filter(|(position, _)| shard.holds(*position)).map(|(_, trial)| *trial).collect()
    }
}
