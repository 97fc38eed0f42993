//! The stages of a method: a pipeline from a file or from the experiment itself, its names looked up before any data.

use cfpose::estimator::Pipeline;
use cfpose::{BuildContext, BuildError, Registry};

use crate::error::LabError;

/// Read a pipeline file; `file` names it in errors.
///
/// ```
/// use cfpose_lab::method::stages;
/// let pipeline = stages::read("[[stage]]\nname = \"coarse\"\nfeatures = \"learned\"\n", "s.toml").unwrap();
/// assert_eq!(pipeline.stages[0].iterations, 30);
/// assert_eq!(stages::read("", "s.toml").unwrap_err().to_string(), "s.toml: line 1: missing field `stage`");
/// ```
///
/// # Errors
/// [`LabError::Toml`] with the line; a pipeline without a stage.
pub fn read(text: &str, file: &str) -> Result<Pipeline, LabError> {
    let pipeline: Pipeline = toml::from_str(text).map_err(|error| LabError::Toml {
        file: file.to_string(),
        line: error.span().map_or(1, |span| text[..span.start.min(text.len())].matches('\n').count() + 1),
        problem: error.message().to_string(),
    })?;
    if pipeline.stages.is_empty() {
        return Err(LabError::NoStage { file: file.to_string() });
    }
    Ok(pipeline)
}

/// Look up every name of a pipeline; what depends on data is left to the estimator.
///
/// # Errors
/// The stage or key, and the lookup's own error.
pub fn check(pipeline: &Pipeline, registry: &Registry) -> Result<(), String> {
    let context = BuildContext::default();
    let wrong = |result: Result<(), cfpose::Error>| {
        result.err().filter(|error| matches!(error, cfpose::Error::Build(BuildError::Entry(_))))
    };
    for stage in &pipeline.stages {
        let named = [
            wrong(registry.family(&stage.features, &context).map(drop)),
            wrong(registry.weighting(&stage.weighting).map(drop)),
            stage.model.as_ref().and_then(|name| wrong(registry.model(name, &context).map(drop))),
            stage.normaliser.as_ref().and_then(|name| wrong(registry.normaliser(name).map(drop))),
            stage.solver.as_ref().and_then(|name| wrong(registry.solver(name).map(drop))),
        ];
        if let Some(error) = named.into_iter().flatten().next() {
            return Err(format!("stage `{}`: {error}", stage.name));
        }
    }
    let points = pipeline.points.as_ref();
    let named = [
        ("global-start", pipeline.global_start.as_ref()),
        ("[points] start", points.and_then(|points| points.start.as_ref())),
        ("[points] parts", points.and_then(|points| points.parts.as_ref())),
    ];
    for (key, name) in named {
        if let Some(error) = name.and_then(|name| wrong(registry.start(name).map(drop))) {
            return Err(format!("{key}: {error}"));
        }
    }
    Ok(())
}
