//! A training as data: what is trained, on what, for what.

use std::path::{Path, PathBuf};

use cfpose::entry::{EntryError, find};
use cfpose_lab::{Lab, LabError};
use serde::Deserialize;
use toml::Value;

use crate::error::LearnError;
use crate::objective::DynObjective;
use crate::objectives;
use crate::vary::Varied;

/// What is trained.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// A matrix over a family.
    Linear,
    /// Frequencies and amplitudes of waves.
    Frequencies,
    /// A perceptron with one hidden layer.
    Perceptron,
}

impl Kind {
    /// Return the name.
    pub fn name(self) -> &'static str {
        match self {
            Kind::Linear => "linear",
            Kind::Frequencies => "frequencies",
            Kind::Perceptron => "perceptron",
        }
    }
}

/// How parameters are moved.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Optimiser {
    /// Adam on random batches.
    Adam,
    /// L-BFGS on all states.
    LBfgs,
}

/// The file, as it is written.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
struct File {
    kind: Kind,
    #[serde(default)]
    basis: Option<String>,
    features: usize,
    #[serde(default)]
    hidden: Option<usize>,
    #[serde(default)]
    ridge: Option<f64>,
    seed: u64,
    #[serde(default)]
    sampling: Sampling,
    #[serde(default)]
    training: Schedule,
    data: Vec<toml::Table>,
    objective: Vec<Weighted>,
}

/// How many states are drawn, and how far from the truth.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields, default)]
pub struct Sampling {
    /// Trials before the first round.
    pub trials: usize,
    /// States of each of them.
    pub states: usize,
    /// Trials of validation.
    pub validation_trials: usize,
    /// Rounds with states along the paths of the present family.
    pub rounds: usize,
    /// Trials of each of these rounds.
    pub round_trials: usize,
    /// Paths of each of these trials.
    pub paths: usize,
    /// Iterations of the solver after which the states of a path are taken.
    pub iterations: Vec<usize>,
}

impl Default for Sampling {
    fn default() -> Self {
        Self {
            trials: 250,
            states: 20,
            validation_trials: 80,
            rounds: 4,
            round_trials: 84,
            paths: 6,
            iterations: vec![2, 5],
        }
    }
}

/// Steps of a round.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields, default)]
pub struct Schedule {
    /// Optimiser.
    pub optimiser: Optimiser,
    /// Steps of each round at most.
    pub steps: usize,
    /// States of a step of Adam.
    pub batch: usize,
    /// Length of Adam's first steps, relative to the mean size of the parameters.
    pub rate: f64,
    /// Steps between two looks at the validation loss.
    pub look: usize,
    /// Looks without a better validation loss after which a round ends.
    pub patience: usize,
}

impl Default for Schedule {
    fn default() -> Self {
        Self { optimiser: Optimiser::Adam, steps: 450, batch: 512, rate: 0.03, look: 25, patience: 8 }
    }
}

/// An objective with its weight.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
struct Weighted {
    name: String,
    #[serde(default = "one")]
    weight: f64,
}

fn one() -> f64 {
    1.0
}

/// One distribution of trials.
#[derive(Debug, Clone)]
pub struct Data {
    /// Scenario.
    pub scenario: String,
    /// Share of the trials, relative to the others.
    pub share: f64,
    /// Model, if not the scenario's; one with the same theta.
    pub model: Option<String>,
    /// Every how many points of a source in curve order are used; training looks at states, not at accuracy.
    pub stride: usize,
    /// Smallest and largest standard deviation of the states about the truth, each tangent direction; in between its logarithm is
    /// uniform.
    pub spread: [f64; 2],
    /// Parameters of the scenario that are not at their default.
    pub parameters: Vec<(String, Varied)>,
}

/// A training, every name checked.
pub struct Config {
    /// What is trained.
    pub kind: Kind,
    /// Family under a linear kind.
    pub basis: String,
    /// Number of features.
    pub features: usize,
    /// Hidden units of a perceptron.
    pub hidden: usize,
    /// Ridge with which a linear kind is whitened by the target points; none: it is not.
    pub ridge: Option<f64>,
    /// Seed of everything random.
    pub seed: u64,
    /// States.
    pub sampling: Sampling,
    /// Steps.
    pub training: Schedule,
    /// Distributions of trials.
    pub data: Vec<Data>,
    /// Weighted objectives.
    pub objectives: Vec<(f64, Box<dyn DynObjective>)>,
    /// The text of the file: it goes into the weights.
    pub text: String,
    /// Folder of the file: relative names in scenarios.
    pub folder: PathBuf,
}

impl Config {
    /// Read a training from a file.
    ///
    /// # Errors
    /// [`LearnError`] for a file that cannot be read, unknown keys, names and values that cannot be used.
    pub fn load(lab: &Lab, path: &Path) -> Result<Self, LearnError> {
        let text = std::fs::read_to_string(path).map_err(|source| LabError::Io {
            path: path.to_path_buf(),
            action: "read",
            source,
        })?;
        let mut config = Self::parse(lab, &text, &path.display().to_string())?;
        config.folder = path.parent().map(Path::to_path_buf).unwrap_or_default();
        Ok(config)
    }

    /// Read a training from the text of a file; `file` stands in messages.
    ///
    /// # Errors
    /// As [`Config::load`].
    pub fn parse(lab: &Lab, text: &str, file: &str) -> Result<Self, LearnError> {
        let fault = |problem: String| LearnError::Config { file: file.to_string(), problem };
        let read: File = toml::from_str(text).map_err(|error| {
            let line = error.span().map_or(1, |span| text[..span.start].matches('\n').count() + 1);
            fault(format!("line {line}: {}", error.message().replace('\n', " ")))
        })?;
        let data = read.data.iter().enumerate();
        let data: Vec<Data> = data
            .map(|(i, table)| data_of(lab, table, file, &format!("[[data]] {}", i + 1)))
            .collect::<Result<_, _>>()?;
        let mut objectives = Vec::new();
        for (i, weighted) in read.objective.iter().enumerate() {
            let place = format!("[[objective]] {}", i + 1);
            let entry = |problem: EntryError| LearnError::Entry {
                file: file.to_string(),
                place: place.clone(),
                problem: Box::new(problem),
            };
            let (found, parameters) = find("objective", objectives::ALL, &weighted.name).map_err(entry)?;
            if !(weighted.weight > 0.0 && weighted.weight.is_finite()) {
                return Err(fault(format!("{place}: weight = {}: expected a number above 0", weighted.weight)));
            }
            objectives.push((weighted.weight, (found.build)(&parameters).map_err(entry)?));
        }
        let config = Self {
            kind: read.kind,
            basis: read.basis.unwrap_or_else(|| "hermite[degree=6]".to_string()),
            features: read.features,
            hidden: read.hidden.unwrap_or(2 * read.features),
            ridge: read.ridge,
            seed: read.seed,
            sampling: read.sampling,
            training: read.training,
            data,
            objectives,
            text: text.to_string(),
            folder: PathBuf::new(),
        };
        config.check(lab).map_err(fault)?;
        Ok(config)
    }

    /// Return the first thing that cannot be used.
    fn check(&self, lab: &Lab) -> Result<(), String> {
        let (s, t) = (&self.sampling, &self.training);
        let range = |name: &str, value: usize, low: usize, high: usize| match value {
            v if (low..=high).contains(&v) => Ok(()),
            v => Err(format!("{name} = {v}: expected a whole number from {low} to {high}")),
        };
        range("features", self.features, 1, 1024)?;
        range("hidden", self.hidden, 1, 1024)?;
        range("trials", s.trials, 1, 1_000_000)?;
        range("states", s.states, 1, 10_000)?;
        range("validation-trials", s.validation_trials, 1, 1_000_000)?;
        range("rounds", s.rounds, 0, 1000)?;
        range("round-trials", s.round_trials, 1, 1_000_000)?;
        range("paths", s.paths, 1, 10_000)?;
        s.iterations.iter().try_for_each(|i| range("iterations", *i, 1, 1000))?;
        range("steps", t.steps, 1, 1_000_000)?;
        range("batch", t.batch, 1, 1_000_000)?;
        range("look", t.look, 1, 1_000_000)?;
        range("patience", t.patience, 1, 1_000_000)?;
        if !(t.rate > 0.0 && t.rate <= 1.0) {
            return Err(format!("rate = {}: expected a number above 0, at most 1", t.rate));
        }
        if self.kind == Kind::Frequencies && !self.features.is_multiple_of(2) {
            return Err(format!(
                "features = {}: frequencies come as pairs of waves, give an even number",
                self.features
            ));
        }
        if self.ridge.is_some_and(|ridge| !(ridge > 0.0 && ridge <= 1e3))
            || self.ridge.is_some() && self.kind != Kind::Linear
        {
            return Err("`ridge`: expected a number above 0, at most 1000, of a linear kind".to_string());
        }
        if self.objectives.is_empty() || self.data.is_empty() {
            return Err("there has to be a [[data]] and an [[objective]]".to_string());
        }
        if self.basis.contains("learned") {
            return Err(format!(
                "basis = \"{}\": learned functions are no basis; name a family that is not trained",
                self.basis
            ));
        }
        let context = cfpose::BuildContext::default();
        match lab.registry.family(&self.basis, &context) {
            Err(error @ cfpose::Error::Build(cfpose::BuildError::Entry(_))) => Err(format!("basis: {error}")),
            _ => Ok(()),
        }
    }
}

/// Read one `[[data]]`.
fn data_of(lab: &Lab, table: &toml::Table, file: &str, place: &str) -> Result<Data, LearnError> {
    let fault = |problem: String| LearnError::Config { file: file.to_string(), problem: format!("{place}: {problem}") };
    let entry_fault =
        |problem| LearnError::Entry { file: file.to_string(), place: place.to_string(), problem: Box::new(problem) };
    let scenario =
        table.get("scenario").and_then(Value::as_str).ok_or_else(|| fault("`scenario` is missing".into()))?;
    let (entry, _) = find("scenario", &lab.scenarios, scenario).map_err(entry_fault)?;
    let number = |value: &Value| value.as_float().or_else(|| value.as_integer().map(|i| i as f64));
    let mut data = Data {
        scenario: entry.name.to_string(),
        share: 1.0,
        model: None,
        stride: 1,
        spread: [0.03, 1.2],
        parameters: Vec::new(),
    };
    for (key, value) in table.iter().filter(|(key, _)| *key != "scenario") {
        match key.as_str() {
            "share" => {
                let share = number(value).filter(|v| *v > 0.0 && v.is_finite());
                data.share = share.ok_or_else(|| fault("`share`: expected a number above 0".into()))?;
            }
            "model" => {
                let model = value.as_str().ok_or_else(|| fault("`model`: expected a name".into()))?;
                data.model = Some(model.to_string());
            }
            "stride" => {
                let stride = value.as_integer().filter(|v| (1..=1000).contains(v));
                data.stride = stride.ok_or_else(|| fault("`stride`: expected 1 to 1000".into()))? as usize;
            }
            "spread" => {
                let ends: Option<Vec<f64>> = value.as_array().and_then(|list| list.iter().map(number).collect());
                let ends = ends.and_then(|list| <[f64; 2]>::try_from(list).ok());
                let ends = ends.filter(|[low, high]| *low > 0.0 && low <= high && high.is_finite());
                data.spread = ends.ok_or_else(|| fault("`spread`: expected [low, high], 0 < low <= high".into()))?;
            }
            _ => {
                let items: &[Value] = value.as_array().map_or(std::slice::from_ref(value), |list| list.as_slice());
                let texts: Option<Vec<String>> = items.iter().map(text_of).collect();
                let texts = texts.ok_or_else(|| fault(format!("`{key}`: expected texts and numbers")))?;
                let varied = Varied::new(&texts).map_err(|problem| fault(format!("`{key}`: {problem}")))?;
                data.parameters.push((key.clone(), varied));
            }
        }
    }
    let given: Vec<_> = data.parameters.iter().map(|(key, _)| (key.clone(), String::new())).collect();
    cfpose::entry::Parameters::resolve("scenario", entry.name, entry.parameters, &given).map_err(entry_fault)?;
    Ok(data)
}

/// Return a text or number as text.
fn text_of(value: &Value) -> Option<String> {
    match value {
        Value::String(text) => Some(text.clone()),
        Value::Integer(number) => Some(number.to_string()),
        Value::Float(number) => Some(number.to_string()),
        _ => None,
    }
}
