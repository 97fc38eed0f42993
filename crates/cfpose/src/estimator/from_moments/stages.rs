//! The stages that serve moments: none that asks for points.

use cfpose_kernel::moments::GatheredMoments;

use crate::error::Error;
use crate::estimator::preset::WEIGHTED;
use crate::estimator::{NoiseModel, Outliers, Pipeline, Settings, Stage};

/// Return the stages to run, what was given beside the preset put into the last one.
///
/// # Errors
/// [`Error::Unsupported`] for what needs points.
pub(super) fn stages(settings: &Settings, sums: [&GatheredMoments; 2]) -> Result<Vec<Stage>, Error> {
    let named = || match sums.map(GatheredMoments::label) {
        [source, target] if source == target => Ok(source.to_string()),
        [source, target] => Err(Error::Unsupported(format!(
            "the moments were made for different features, `{source}` and `{target}`; give --features"
        ))),
    };
    let mut stages = match &settings.pipeline {
        Some(pipeline) => without_points(pipeline)?.stages.clone(),
        None => {
            let features = settings.features.clone().map_or_else(named, Ok)?;
            let weighting = if settings.preset == "paper" { "identity" } else { WEIGHTED };
            let iterations = settings.stopping.max_iterations;
            vec![Stage { weighting: weighting.to_string(), iterations, ..Stage::new("moments", &features) }]
        }
    };
    let Some(last) = stages.last_mut() else {
        return Err(Error::Unsupported("an estimator has at least one stage".to_string()));
    };
    for (given, part) in [(&settings.features, &mut last.features), (&settings.weighting, &mut last.weighting)] {
        if let Some(given) = given {
            part.clone_from(given);
        }
    }
    if settings.normaliser.is_some() {
        last.normaliser.clone_from(&settings.normaliser);
    }
    match stages.iter().find(|stage| stage.model.as_ref().is_some_and(|name| *name != settings.model)) {
        Some(stage) => {
            let problem =
                format!("stage `{}` has a model of its own; moments serve the stages of one model", stage.name);
            Err(Error::Unsupported(problem))
        }
        None => Ok(stages),
    }
}

/// Refuse a pipeline that asks for points.
fn without_points(pipeline: &Pipeline) -> Result<&Pipeline, Error> {
    let asks = [
        (pipeline.points.is_some(), "[points]"),
        (pipeline.support, "support"),
        (pipeline.outliers != Outliers::None, "outliers"),
        (pipeline.stages.iter().any(|stage| stage.coarse_to_fine), "coarse-to-fine"),
        (pipeline.stages.iter().any(|stage| stage.noise != NoiseModel::None), "noise"),
    ];
    match asks.iter().find(|(asked, _)| *asked) {
        Some((_, key)) => Err(Error::Unsupported(format!(
            "the pipeline's `{key}` needs points, which moments do not hold; leave it out"
        ))),
        None => Ok(pipeline),
    }
}
