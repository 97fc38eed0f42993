//! A method: a name for preset, or model + features + normaliser + weighting + solver + starts.

use cfpose::entry::files_of;
use cfpose::estimator::Pipeline;
use cfpose::{BuildContext, BuildError, Registry, Settings, Start};
use cfpose_optim::Stopping;
use serde::Serialize;

pub mod known;
pub mod stages;

use known::Known;

/// Start that takes the scenario's own theta_0.
pub const SCENARIO_START: &str = "scenario";

/// What leaves a part to the preset: as a start, its own strategy also where the scenario has a theta_0.
pub const PRESET_START: &str = "auto";

/// Preset of a method that names none.
pub const DEFAULT_PRESET: &str = "auto";

/// Solver of a least-squares problem where the method names none.
pub const DEFAULT_SOLVER: &str = "levenberg-marquardt";

/// One `[[method]]` of an experiment; everything that is not given comes from the preset.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Method {
    /// Name in all results.
    pub name: String,
    /// Preset.
    pub preset: String,
    /// Model, if not the scenario's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub model: Option<String>,
    /// Feature family.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub features: Option<String>,
    /// Normaliser.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub normalise: Option<String>,
    /// Weighting.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub weighting: Option<String>,
    /// Solver.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub solver: Option<String>,
    /// Stages instead of those of the preset, the content of the file that was named: another content is another experiment.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pipeline: Option<Pipeline>,
    /// `scenario` for the scenario's theta_0 (the preset's start where it has none), `auto` for the preset's start, or a start
    /// strategy.
    pub start: String,
    /// What is known of theta beforehand.
    #[serde(flatten)]
    pub known: Known,
    /// Budget of each solve in residual evaluations.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_evaluations: Option<usize>,
    /// Limit on iterations of each solve.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_iterations: Option<usize>,
    /// Whether another program computes it: `run` leaves it out, and its rows are imported ([`crate::rows`]).
    #[serde(skip_serializing_if = "is_false")]
    pub external: bool,
}

fn is_false(value: &bool) -> bool {
    !*value
}

impl Method {
    /// Make the method that is exactly a preset, from the scenario's start.
    pub fn of_preset(preset: &str) -> Self {
        Self {
            name: preset.to_string(),
            preset: preset.to_string(),
            model: None,
            features: None,
            normalise: None,
            weighting: None,
            solver: None,
            pipeline: None,
            start: SCENARIO_START.to_string(),
            known: Known::default(),
            max_evaluations: None,
            max_iterations: None,
            external: false,
        }
    }

    /// Return the settings of the estimator for a scenario's model, theta_0 (ambient) and the seed of the method.
    ///
    /// A method with a start of its own uses that. Otherwise, where the scenario has no theta_0, the preset's start stays. What is
    /// known beforehand needs the model and is put in by [`Method::resolved`].
    ///
    /// # Errors
    /// [`cfpose::Error`] for an unknown preset.
    pub fn settings(&self, model: &str, start: Option<&[f64]>, seed: u64) -> Result<Settings, cfpose::Error> {
        let mut settings = Settings::preset(&self.preset, self.model.as_deref().unwrap_or(model))?;
        settings.features.clone_from(&self.features);
        settings.weighting.clone_from(&self.weighting);
        settings.solver.clone_from(&self.solver);
        settings.normaliser.clone_from(&self.normalise);
        settings.pipeline.clone_from(&self.pipeline);
        match (self.start.as_str(), start) {
            (SCENARIO_START, Some(start)) => settings.start = Some(Start::Given(vec![start.to_vec()])),
            (SCENARIO_START, None) | (PRESET_START, _) => {}
            (name, _) => settings.start = Some(Start::Named(name.to_string())),
        }
        settings.seed = seed;
        self.limit(&mut settings.stopping);
        Ok(settings)
    }

    /// Return the settings of [`Method::settings`] with what is known of theta beforehand.
    ///
    /// # Errors
    /// [`cfpose::Error`] for an unknown preset or model, and for names, intervals and a prior that are not of the model's theta.
    pub fn resolved(
        &self,
        registry: &Registry,
        model: &str,
        start: Option<&[f64]>,
        seed: u64,
    ) -> Result<Settings, cfpose::Error> {
        let mut settings = self.settings(model, start, seed)?;
        if self.known != Known::default() {
            let layout = registry.model(&settings.model, &BuildContext { seed, ..BuildContext::default() })?.layout;
            self.known.fill(&layout, &mut settings)?;
        }
        Ok(settings)
    }

    /// Return the names of the weight files that the method's families ask for.
    pub fn files(&self) -> Vec<String> {
        let stages = self.pipeline.iter().flat_map(|pipeline| &pipeline.stages).map(|stage| stage.features.as_str());
        stages.chain(self.features.as_deref()).flat_map(files_of).collect()
    }

    /// Write the method's budgets into stopping rules.
    pub(crate) fn limit(&self, stopping: &mut Stopping) {
        if let Some(budget) = self.max_evaluations {
            stopping.max_evaluations = budget;
        }
        if let Some(limit) = self.max_iterations {
            stopping.max_iterations = limit;
        }
    }

    /// Return the solver for a least-squares problem.
    pub(crate) fn solver_alone(&self) -> &str {
        self.solver.as_deref().unwrap_or(DEFAULT_SOLVER)
    }

    /// Check what a least-squares problem uses of the method: the preset's name and the solver.
    ///
    /// # Errors
    /// [`cfpose::Error`] for an unknown name or a bad parameter.
    pub fn check_solver(&self, registry: &Registry) -> Result<(), cfpose::Error> {
        Settings::preset(&self.preset, "")?;
        registry.solver(self.solver_alone()).map(|_| ())
    }

    /// Check every name and parameter of the method against the registry, for a scenario's model.
    ///
    /// # Errors
    /// [`cfpose::Error`] for an unknown name, a bad parameter, or a model whose theta is not laid out as the scenario's.
    pub fn check(&self, registry: &Registry, scenario_model: &str) -> Result<Settings, cfpose::Error> {
        let context = BuildContext::default();
        let truth = registry.model(scenario_model, &context)?;
        let settings = self.resolved(registry, scenario_model, Some(&truth.identity), 0)?;
        let model = registry.model(&settings.model, &context)?;
        let blocks = |model: &cfpose::Model| {
            let block = |block: &cfpose::theta::ThetaBlock| (block.name, block.kind.manifold().ambient());
            model.layout.blocks().iter().map(block).collect::<Vec<_>>()
        };
        if blocks(&model) != blocks(&truth) {
            return Err(cfpose::Error::Unsupported(format!(
                "model `{}` has another theta than the scenario's `{scenario_model}`, so its error is not defined",
                settings.model
            )));
        }
        // Families may depend on the data, so only names and parameters are checked here, those of the parts of a sum too.
        if let Some(features) = &settings.features
            && let Err(error @ cfpose::Error::Build(BuildError::Entry(_))) = registry.family(features, &context)
        {
            return Err(error);
        }
        if let Some(pipeline) = &settings.pipeline {
            stages::check(pipeline, registry)
                .map_err(|problem| cfpose::Error::Unsupported(format!("`pipeline`: {problem}")))?;
        }
        if let Some(weighting) = &settings.weighting {
            registry.weighting(weighting)?;
        }
        if let Some(solver) = &settings.solver {
            registry.solver(solver)?;
        }
        if let Some(normaliser) = &settings.normaliser {
            registry.normaliser(normaliser)?;
        }
        if ![SCENARIO_START, PRESET_START].contains(&self.start.as_str()) {
            registry.start(&self.start)?;
        }
        Ok(settings)
    }
}
