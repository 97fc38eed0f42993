//! Evaluation without solving: of named parts at one theta, and of what an estimate minimised last.

use std::sync::Arc;

use cfpose_optim::manifold::Manifold;
use cfpose_optim::problem::LeastSquares;

use super::candidate::Minimised;
use super::pipeline::Stage;
use super::settings::Settings;
use super::workbench::Workbench;
use super::{Estimator, Parts};
use crate::error::Error;
use crate::geometry::free::Freedom;
use crate::problem::Evaluation;

impl Estimator {
    /// Evaluate the named parts at one theta (ambient), without solving: exactly the model of the settings, its features
    /// (`trig18` where none are named), its weighting at that theta (the identity where none is named), no noise.
    ///
    /// Returns what was evaluated beside the evaluation.
    ///
    /// # Errors
    /// As [`Estimator::new`].
    pub fn evaluate(&self, theta: &[f64]) -> Result<(Minimised, Evaluation), Error> {
        self.model().layout.check_ambient(theta)?;
        let settings = &self.parts.settings;
        let stage = match &settings.pipeline {
            Some(_) => self.stages.last().stage.clone(),
            None => Stage {
                normaliser: settings.normaliser.clone(),
                weighting: settings.weighting.clone().unwrap_or_else(|| "identity".to_string()),
                ..Stage::new("evaluated", settings.features.as_deref().unwrap_or("trig18"))
            },
        };
        let data = self.stages.data.clone();
        let ready = Workbench::new(&self.parts, &data).stage(&stage)?;
        let at = ready.adopt(theta, &self.parts);
        let weighted_at = ready.weighting_at(&at, &self.parts)?;
        let problem = ready.rebuilt(weighted_at.as_ref(), settings.seed)?;
        let evaluation = problem.evaluate(&at);
        let minimised = Minimised {
            stage: ready.stage,
            theta: at,
            reference: self.parts.reference.clone(),
            weighted_at,
            left_out_source: Vec::new(),
            left_out_target: Vec::new(),
            free: settings.free.clone(),
            seed: settings.seed,
        };
        Ok((minimised, evaluation))
    }

    /// Evaluate what an estimate minimised last, at its theta: gives the cost of that estimate.
    ///
    /// # Errors
    /// As [`Estimator::new`]; [`Error::Unsupported`] when the rows that were left out are not rows of these points.
    pub fn evaluate_minimised(&self, minimised: &Minimised) -> Result<Evaluation, Error> {
        let data = &self.whole;
        for (side, left_out, len) in [
            ("source", &minimised.left_out_source, data.source.len()),
            ("target", &minimised.left_out_target, data.target.len()),
        ] {
            if let Some(row) = left_out.iter().find(|row| !(1..=len).contains(*row)) {
                let problem =
                    format!("the result left row {row} of the {side} out, which has {len}; give the same files");
                return Err(Error::Unsupported(problem));
            }
        }
        let source = Minimised::kept(&minimised.left_out_source, data.source.len());
        let target = Minimised::kept(&minimised.left_out_target, data.target.len());
        let data = data.keep(source.as_deref(), target.as_deref())?;
        let model = self.model();
        if minimised.theta.len() < model.layout.manifold().ambient() {
            let (found, expected) = (minimised.theta.len(), model.layout.manifold().ambient());
            let problem = format!("the result's theta has {found} numbers, the model needs at least {expected}");
            return Err(Error::Unsupported(problem));
        }
        let freedom = minimised.free.as_ref().map(|free| Freedom::new(&model.layout, free, &minimised.theta));
        let parts = Parts {
            registry: self.parts.registry.clone(),
            settings: Settings { seed: minimised.seed, ..self.parts.settings.clone() },
            criteria: self.parts.criteria.clone(),
            manifold: freedom.as_ref().map(|freedom| Arc::new(freedom.manifold().clone()) as Arc<dyn Manifold>),
            freedom,
            bounds: None,
            prior: None,
            centred: None,
            reference: minimised.reference.clone(),
            execution: self.parts.execution.clone(),
        };
        let ready = Workbench::new(&parts, &data).stage(&minimised.stage)?;
        if minimised.theta.len() != ready.problem.manifold().ambient() {
            let (found, expected) = (minimised.theta.len(), ready.problem.manifold().ambient());
            let problem = format!("the result's theta has {found} numbers, its stage needs {expected}");
            return Err(Error::Unsupported(problem));
        }
        Ok(ready.rebuilt(minimised.weighted_at.as_ref(), minimised.seed)?.evaluate(&minimised.theta))
    }
}
