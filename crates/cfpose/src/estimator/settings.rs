//! What an estimate is asked for: names of the parts, and what the preset fills in.

use cfpose_optim::Stopping;

use super::pipeline::{Pipeline, Stage};
use super::preset;
use super::prior::Prior;
use crate::distances::sampling::Sampling;
use crate::entry::{BuildError, EntryError};
use crate::error::Error;
use crate::geometry::bounds::Bound;
use crate::geometry::free::Freedom;
use crate::model::Model;

/// Solver where neither the user nor the model names one.
const SOLVER: &str = "levenberg-marquardt";

/// Where a solve begins.
#[derive(Debug, Clone, PartialEq)]
pub enum Start {
    /// A strategy by name.
    Named(String),
    /// Given thetas in ambient coordinates.
    Given(Vec<Vec<f64>>),
}

/// The names of all parts of an estimate, as the command line and experiment files give them; `None` leaves a choice to the
/// preset and the model.
///
/// ```
/// use cfpose::Settings;
/// let settings = Settings::preset("auto", "rigid3")?.features("hermite[degree=3]").seed(7);
/// assert_eq!(settings.features.as_deref(), Some("hermite[degree=3]"));
/// assert_eq!((settings.solver, settings.seed), (None, 7));
/// assert!(Settings::preset("autom", "rigid3").unwrap_err().to_string().contains("auto"));
/// # Ok::<(), cfpose::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Preset the others come from: `auto` or `paper`.
    pub preset: String,
    /// Transformation model.
    pub model: String,
    /// Feature family; of a pipeline that of the last stage.
    pub features: Option<String>,
    /// Normaliser; `None` leaves it to the model, then to the preset.
    pub normaliser: Option<String>,
    /// Weighting; of a pipeline that of the last stage.
    pub weighting: Option<String>,
    /// Solver; `None` takes the one that the model recommends, else Levenberg-Marquardt.
    pub solver: Option<String>,
    /// Where solves begin; `None` takes the preset's: `identity` of `paper`, the search of the pipeline of `auto`.
    pub start: Option<Start>,
    /// Tangent columns that are free, `None` for all; the others keep the value of the (first) given start.
    pub free: Option<Vec<usize>>,
    /// Bounds on parameters: no start, iterate or answer is outside.
    pub bounds: Vec<Bound>,
    /// What is known of theta beforehand.
    pub prior: Option<Prior>,
    /// Seed of everything random.
    pub seed: u64,
    /// Stopping rules of the solver.
    pub stopping: Stopping,
    /// How the two sets were sampled; `None` finds out by distances between the points, never from the residual.
    pub sampling: Option<Sampling>,
    /// Stages and what surrounds them; `None` leaves them to the preset and the model.
    pub pipeline: Option<Pipeline>,
}

/// Names of the presets.
pub const PRESETS: &[&str] = &["auto", "paper"];

impl Settings {
    /// Choose a preset for a model. `paper` is exactly the printed method: `trig18`, normaliser `paper`, weighting `identity`,
    /// Levenberg-Marquardt, one start. `auto` leaves everything to the model's pipeline.
    ///
    /// # Errors
    /// [`Error::Build`] for an unknown preset, with suggestions.
    pub fn preset(preset: &str, model: &str) -> Result<Self, Error> {
        if !PRESETS.contains(&preset) {
            let suggestions = PRESETS.iter().map(|name| (*name).to_string()).collect();
            let unknown = EntryError::UnknownName { kind: "preset", name: preset.to_string(), suggestions };
            return Err(BuildError::from(unknown).into());
        }
        Ok(Self {
            preset: preset.to_string(),
            model: model.to_string(),
            features: None,
            normaliser: None,
            weighting: None,
            solver: None,
            start: None,
            free: None,
            bounds: Vec::new(),
            prior: None,
            seed: 0,
            stopping: Stopping::default(),
            sampling: None,
            pipeline: None,
        })
    }

    /// Name the feature family.
    #[must_use]
    pub fn features(mut self, spec: impl Into<String>) -> Self {
        self.features = Some(spec.into());
        self
    }

    /// Name the normaliser.
    #[must_use]
    pub fn normaliser(mut self, spec: impl Into<String>) -> Self {
        self.normaliser = Some(spec.into());
        self
    }

    /// Name the weighting.
    #[must_use]
    pub fn weighting(mut self, spec: impl Into<String>) -> Self {
        self.weighting = Some(spec.into());
        self
    }

    /// Name the solver.
    #[must_use]
    pub fn solver(mut self, spec: impl Into<String>) -> Self {
        self.solver = Some(spec.into());
        self
    }

    /// Begin at one theta (ambient).
    #[must_use]
    pub fn start_at(mut self, theta: impl Into<Vec<f64>>) -> Self {
        self.start = Some(Start::Given(vec![theta.into()]));
        self
    }

    /// Begin where a strategy proposes.
    #[must_use]
    pub fn start(mut self, spec: impl Into<String>) -> Self {
        self.start = Some(Start::Named(spec.into()));
        self
    }

    /// Free only these tangent columns (indices from 0).
    #[must_use]
    pub fn free(mut self, columns: impl Into<Vec<usize>>) -> Self {
        self.free = Some(columns.into());
        self
    }

    /// Bound parameters.
    #[must_use]
    pub fn bounds(mut self, bounds: impl Into<Vec<Bound>>) -> Self {
        self.bounds = bounds.into();
        self
    }

    /// State what is known of theta beforehand.
    #[must_use]
    pub fn prior(mut self, prior: Prior) -> Self {
        self.prior = Some(prior);
        self
    }

    /// Set the seed of everything random.
    #[must_use]
    pub fn seed(mut self, seed: u64) -> Self {
        self.seed = seed;
        self
    }

    /// State how the two sets were sampled.
    #[must_use]
    pub fn sampling(mut self, sampling: Sampling) -> Self {
        self.sampling = Some(sampling);
        self
    }

    /// Replace the stages of the preset.
    #[must_use]
    pub fn pipeline(mut self, pipeline: Pipeline) -> Self {
        self.pipeline = Some(pipeline);
        self
    }

    /// Return the thetas that were given.
    pub fn given_starts(&self) -> &[Vec<f64>] {
        match &self.start {
            Some(Start::Given(thetas)) => thetas,
            _ => &[],
        }
    }

    /// Return the solver of a stage: its own, that of the settings, the model's, Levenberg-Marquardt.
    pub(super) fn solver_of<'a>(&'a self, stage: &'a Stage, model: &'a Model) -> &'a str {
        stage.solver.as_deref().or(self.solver.as_deref()).or(model.solver).unwrap_or(SOLVER)
    }

    /// Return the stages to run, every choice filled in: what was given beside the preset is put into the last stage.
    pub(super) fn resolve(&self, model: &Model, freedom: Option<&Freedom>) -> Pipeline {
        let mut pipeline = match &self.pipeline {
            Some(pipeline) => pipeline.clone(),
            None if self.preset == "auto" => preset::pipeline(model, freedom),
            None => Pipeline::new(vec![preset::printed(self.stopping.max_iterations)]),
        };
        if let Some(last) = pipeline.stages.last_mut() {
            for (given, part) in [(&self.features, &mut last.features), (&self.weighting, &mut last.weighting)] {
                if let Some(given) = given {
                    part.clone_from(given);
                }
            }
            if self.normaliser.is_some() {
                last.normaliser.clone_from(&self.normaliser);
            }
        }
        pipeline
    }
}
