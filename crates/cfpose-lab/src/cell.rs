//! One cell of an experiment's grid.

use cfpose::entry::{EntryError, Parameters, find};

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

    /// Build the scenario. Its parameters hand down the registry, so that scenarios find models by name.
    ///
    /// # Errors
    /// [`EntryError`] for an unknown name or a bad value.
    pub fn build(&self, lab: &Lab) -> Result<Box<dyn Scenario>, EntryError> {
        let (entry, _) = find("scenario", &lab.scenarios, &self.scenario)?;
        let parameters = Parameters::resolve("scenario", entry.name, entry.parameters, &self.parameters)?;
        (entry.build)(&parameters.with_table(lab.registry.clone()))
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
