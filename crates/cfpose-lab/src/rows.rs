//! Rows of other programs: what they found on the point files that [`crate::export`] wrote.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Deserialize;

use crate::config::Experiment;
use crate::error::LabError;
use crate::folder::read_text;

/// What another program found in one trial. Only theta counts: it is measured here, by the scenario's own rule.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Row {
    /// Key of the trial, 16 hexadecimal digits.
    pub key: String,
    /// Name of the method; `external = true` in the experiment.
    pub method: String,
    /// Theta as a list, rotations as vectors in radians; null without an estimate.
    pub theta: Option<Vec<f64>>,
    /// Whether the program calls its result usable.
    #[serde(default = "yes")]
    pub usable: bool,
    /// `good`, `suspect`, `failed`; null for a program without a verdict.
    #[serde(default)]
    pub verdict: Option<String>,
    /// Words of the program.
    #[serde(default)]
    pub message: Option<String>,
    /// Wall-clock seconds.
    #[serde(default)]
    pub seconds: f64,
    /// Evaluations, 0 where they are not counted.
    #[serde(default)]
    pub evaluations: usize,
}

fn yes() -> bool {
    true
}

/// Rows by trial and method.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Rows {
    rows: BTreeMap<(String, String), Row>,
}

impl Rows {
    /// Read a file of one JSON object a line.
    ///
    /// # Errors
    /// [`LabError`] for a file that cannot be read, a line that is no row, a method that is not external in the experiment, a verdict
    /// that is none, and two rows of one trial and method.
    pub fn load(path: &Path, experiment: &Experiment) -> Result<Self, LabError> {
        let mut rows = BTreeMap::new();
        for (index, line) in read_text(path)?.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()) {
            let wrong = |problem: String| LabError::Record { path: path.to_path_buf(), line: index + 1, problem };
            let row: Row = serde_json::from_str(line).map_err(|problem| wrong(format!("this is no row: {problem}")))?;
            let known = experiment.methods.iter().any(|method| method.external && method.name == row.method);
            if !known {
                let words = format!("`{}` is no method with `external = true` in the experiment", row.method);
                return Err(wrong(words));
            }
            let verdicts = ["good", "ambiguous", "suspect", "failed"];
            if row.verdict.as_ref().is_some_and(|verdict| !verdicts.contains(&verdict.as_str())) {
                return Err(wrong(format!("the verdict is none of {}", verdicts.join(", "))));
            }
            let identity = (row.key.clone(), row.method.clone());
            if rows.insert(identity, row).is_some() {
                return Err(wrong("a second row of the same trial and method".to_string()));
            }
        }
        Ok(Self { rows })
    }

    /// Return the row of a trial and a method.
    pub fn get(&self, key: &str, method: &str) -> Option<&Row> {
        self.rows.get(&(key.to_string(), method.to_string()))
    }

    /// Return the number of rows.
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Say whether there is no row.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }
}
