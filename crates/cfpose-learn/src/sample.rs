//! States: thetas about the truth of trials that scenarios draw, and along the paths of the present family.

use std::sync::{Arc, OnceLock};

use cfpose::entry::{Parameters, find};
use cfpose::{BuildContext, Estimator, Execution, Points, Settings, Supervision};
use cfpose_lab::rand::RngExt;
use cfpose_lab::rand_distr::StandardNormal;
use cfpose_lab::seed::data_stream;
use cfpose_lab::{ChaCha12Rng, Lab, Trial};
use cfpose_optim::Manifold;
use rayon::prelude::*;

use crate::config::{Config, Data};
use crate::error::LearnError;
use crate::vary::Split;

/// Name under which the present weights are handed to the library.
const POLICY: &str = "policy";

/// Largest error of a state (tangent norm) on a path: what has run away teaches nothing.
const FAR: f64 = 3.0;

/// Attempts at a trial whose scenario refuses its draw.
const ATTEMPTS: usize = 20;

/// One trial ready to be looked at.
pub struct Scene {
    /// Estimator over the family under training.
    pub estimator: Estimator,
    /// Truth, ambient.
    pub truth: Vec<f64>,
    source: Points,
    target: Points,
    model: String,
    /// What a learner computes once for a trial: a square matrix, row by row.
    pub once: OnceLock<Arc<Vec<f64>>>,
}

impl Scene {
    /// Return the source points as they were given.
    pub fn source(&self) -> &Points {
        &self.source
    }
}

/// Draws trials of a configuration and states of them; the same for the same seed at any number of threads.
pub struct Sampler<'a> {
    lab: &'a Lab,
    config: &'a Config,
    /// Family of the estimator of a scene.
    features: String,
}

impl<'a> Sampler<'a> {
    /// Sample with an estimator over these features.
    pub fn new(lab: &'a Lab, config: &'a Config, features: &str) -> Self {
        Self { lab, config, features: features.to_string() }
    }

    /// Draw trials and let `observe` make states of thetas about their truths: the scene, theta, the error of theta, the generator.
    ///
    /// # Errors
    /// [`LearnError`] where a scenario never draws a trial that the library takes.
    pub fn about_truth<S: Send>(
        &self,
        split: Split,
        trials: usize,
        states: usize,
        observe: impl Fn(&Scene, &[f64], Vec<f64>, &mut ChaCha12Rng) -> Option<S> + Sync,
    ) -> Result<Vec<S>, LearnError> {
        self.each(split, 0, trials, |scene, data, rng| {
            let thetas = (0..states).map(|_| self.near(scene, data, rng)).collect::<Vec<_>>();
            Ok(thetas.into_iter().filter_map(|theta| self.observed(scene, &theta, rng, &observe)).collect())
        })
    }

    /// Draw trials and take states along the paths of a Levenberg-Marquardt solve with the given weights.
    ///
    /// # Errors
    /// As [`Sampler::about_truth`].
    pub fn along_paths<S: Send>(
        &self,
        round: usize,
        weights: &[u8],
        observe: impl Fn(&Scene, &[f64], Vec<f64>, &mut ChaCha12Rng) -> Option<S> + Sync,
    ) -> Result<Vec<S>, LearnError> {
        let mut registry = self.lab.registry.clone();
        registry.files.insert(POLICY.to_string(), Arc::from(weights));
        let sampling = &self.config.sampling;
        self.each(Split::Training, round, sampling.round_trials, |scene, data, rng| {
            let mut found = Vec::new();
            for _ in 0..sampling.paths {
                let start = self.near(scene, data, rng);
                for iterations in &sampling.iterations {
                    let mut settings = Settings::preset("paper", &scene.model)?
                        .features(format!("learned[file={POLICY}]"))
                        .start_at(start.clone());
                    settings.stopping.max_iterations = *iterations;
                    let execution = Execution::default();
                    let estimator = Estimator::new(&registry, &settings, &scene.source, &scene.target, &execution)?;
                    let Ok(estimate) = estimator.solve(Supervision::default()) else { continue };
                    found.extend(self.observed(scene, &estimate.theta, rng, &observe));
                }
            }
            Ok(found)
        })
    }

    /// Make a state of a theta that is no runaway.
    fn observed<S>(
        &self,
        scene: &Scene,
        theta: &[f64],
        rng: &mut ChaCha12Rng,
        observe: &impl Fn(&Scene, &[f64], Vec<f64>, &mut ChaCha12Rng) -> Option<S>,
    ) -> Option<S> {
        let manifold = scene.estimator.model().layout.manifold();
        let mut delta = vec![0.0; manifold.tangent()];
        manifold.local(theta, &scene.truth, &mut delta);
        delta.iter_mut().for_each(|d| *d = -*d);
        let size = cfpose_optim::manifold::norm(&delta);
        // The spread of the starts decides how far a state may be; a path may lead on to FAR.
        if size.is_finite() && size < FAR.max(8.0 * self.widest()) { observe(scene, theta, delta, rng) } else { None }
    }

    fn widest(&self) -> f64 {
        self.config.data.iter().map(|data| data.spread[1]).fold(0.0, f64::max)
    }

    /// Draw a theta about the truth.
    fn near(&self, scene: &Scene, data: &Data, rng: &mut ChaCha12Rng) -> Vec<f64> {
        let [low, high] = data.spread;
        let width = low * (high / low).powf(rng.random::<f64>());
        let manifold = scene.estimator.model().layout.manifold();
        let step: Vec<f64> = (0..manifold.tangent()).map(|_| width * rng.sample::<f64, _>(StandardNormal)).collect();
        let mut theta = vec![0.0; manifold.ambient()];
        manifold.retract(&scene.truth, &step, &mut theta);
        theta
    }

    /// Run `work` on trials in parallel, each with its own stream; results in order.
    fn each<S: Send>(
        &self,
        split: Split,
        round: usize,
        trials: usize,
        work: impl Fn(&Scene, &Data, &mut ChaCha12Rng) -> Result<Vec<S>, LearnError> + Sync,
    ) -> Result<Vec<S>, LearnError> {
        let part = if split == Split::Training { 0 } else { 1 << 32 };
        let each = |trial: usize| {
            let mut rng = data_stream(self.config.seed, part + ((round as u64) << 40) + trial as u64);
            let (scene, data) = self.scene(split, &mut rng)?;
            work(&scene, data, &mut rng)
        };
        let found: Vec<Vec<S>> = (0..trials).into_par_iter().map(each).collect::<Result<_, LearnError>>()?;
        Ok(found.into_iter().flatten().collect())
    }

    /// Draw a trial.
    pub fn scene(&self, split: Split, rng: &mut ChaCha12Rng) -> Result<(Scene, &Data), LearnError> {
        let data = self.choose(rng);
        let mut problem = String::new();
        for _ in 0..ATTEMPTS {
            match self.attempt(data, split, rng) {
                Ok(scene) => return Ok((scene, data)),
                Err(refused) => problem = refused,
            }
        }
        Err(LearnError::Data(format!("{}: no trial in {ATTEMPTS} draws: {problem}", data.scenario)))
    }

    /// Choose a distribution by its share.
    fn choose(&self, rng: &mut ChaCha12Rng) -> &Data {
        let all = &self.config.data;
        let mut left = rng.random::<f64>() * all.iter().map(|data| data.share).sum::<f64>();
        let chosen = all.iter().find(|data| {
            left -= data.share;
            left < 0.0
        });
        chosen.unwrap_or(&all[all.len() - 1])
    }

    /// Draw parameters and a trial; the words of whoever refuses it.
    fn attempt(&self, data: &Data, split: Split, rng: &mut ChaCha12Rng) -> Result<Scene, String> {
        let given: Vec<(String, String)> =
            data.parameters.iter().map(|(key, varied)| (key.clone(), varied.draw(split, rng))).collect();
        let (entry, _) = find("scenario", &self.lab.scenarios, &data.scenario).map_err(|e| e.to_string())?;
        let parameters = Parameters::resolve("scenario", entry.name, entry.parameters, &given);
        let parameters = parameters.map_err(|e| e.to_string())?;
        let mut scenario = (entry.build)(&parameters).map_err(|e| e.to_string())?;
        scenario.load(&self.config.folder).map_err(|e| e.to_string())?;
        let Trial { source, target, truth, .. } = scenario.trial(rng).map_err(|e| e.to_string())?;
        let source = thinned(source, data.stride).map_err(|e| e.to_string())?;
        let model = data.model.clone().unwrap_or_else(|| scenario.model().to_string());
        let settings = Settings::preset("paper", &model)
            .map_err(|e| e.to_string())?
            .features(self.features.clone())
            .start_at(truth.clone());
        let estimator = Estimator::new(&self.lab.registry, &settings, &source, &target, &Execution::default());
        let estimator = estimator.map_err(|e| e.to_string())?;
        Ok(Scene { estimator, truth, source, target, model, once: OnceLock::new() })
    }

    /// Return the dimension of the feature space and of the tangent space, the same for all data.
    ///
    /// # Errors
    /// [`LearnError::Data`] where scenarios differ.
    pub fn dimensions(&self) -> Result<(usize, usize), LearnError> {
        let mut found: Option<(usize, usize)> = None;
        for data in &self.config.data {
            let text = |problem: String| LearnError::Data(format!("{}: {problem}", data.scenario));
            let (entry, _) = find("scenario", &self.lab.scenarios, &data.scenario).map_err(|e| text(e.to_string()))?;
            let given: Vec<_> = data
                .parameters
                .iter()
                .map(|(key, varied)| (key.clone(), varied.draw(Split::Training, &mut data_stream(0, 0))))
                .collect();
            let parameters = Parameters::resolve("scenario", entry.name, entry.parameters, &given);
            let parameters = parameters.map_err(|e| text(e.to_string()))?;
            let scenario = (entry.build)(&parameters).map_err(|e| text(e.to_string()))?;
            let name = data.model.as_deref().unwrap_or(scenario.model());
            let model = self.lab.registry.model(name, &BuildContext::default())?;
            let here = (model.dim(), model.layout.manifold().tangent());
            if found.is_some_and(|before| before != here) {
                let problem =
                    "its model has another feature space, or another number of unknowns, than those before it";
                return Err(text(format!("{problem}; train one set of weights for each")));
            }
            found = Some(here);
        }
        found.ok_or_else(|| LearnError::Data("there is no [[data]]".to_string()))
    }
}

/// Keep every `stride`-th point of a curve; other sets stay whole, so that the same points stay the same points.
fn thinned(source: Points, stride: usize) -> Result<Points, cfpose::PointsError> {
    if stride == 1 || !source.is_in_curve_order() {
        return Ok(source);
    }
    let kept: Vec<usize> = (0..source.len()).step_by(stride).collect();
    source.select(&kept)
}
