//! All named entries an experiment can choose from.

use cfpose::Registry;

use crate::scenario::ScenarioEntry;

/// The registry of the library and the scenario table; push your own entries and use every tool with them.
///
/// ```
/// let lab = cfpose_lab::Lab::default();
/// assert!(lab.scenarios.iter().any(|entry| entry.name == "planar-curve"));
/// ```
pub struct Lab {
    /// Models, families, normalisers, weightings, starts, solvers.
    pub registry: Registry,
    /// Scenarios.
    pub scenarios: Vec<&'static ScenarioEntry>,
}

impl Default for Lab {
    fn default() -> Self {
        Self { registry: Registry::default(), scenarios: crate::scenarios::ALL.to_vec() }
    }
}
