//! A training from its configuration to weights.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use cfpose::families::learned::Weights;
use cfpose_lab::Lab;
use cfpose_lab::seed::{data_stream, fnv1a};

use crate::adam::adam;
use crate::checkpoint::Checkpoint;
use crate::config::{Config, Kind, Optimiser};
use crate::error::LearnError;
use crate::l_bfgs::l_bfgs;
use crate::learner::{Learner, mean};
use crate::linear::LinearLearner;
use crate::normal::Shape;
use crate::objective::Perturbations;
use crate::ridge::RidgeLearner;
use crate::rounds::{Progress, Round};
use crate::sample::Sampler;
use crate::vary::Split;

/// Streams of the random numbers of optimisers, away from those of trials.
const STREAM: u64 = 1 << 60;

/// What surrounds a training.
pub struct Options<'a> {
    /// File of the checkpoint.
    pub checkpoint: &'a Path,
    /// Go on from what is there.
    pub resume: bool,
    /// Stop in order when raised.
    pub cancel: Option<&'a AtomicBool>,
    /// Is told how it goes.
    pub watch: &'a mut (dyn FnMut(Progress) + Send),
}

/// Train weights: the same bits for the same configuration at any number of threads of the calling pool, and after any number of stops.
///
/// # Errors
/// [`LearnError`]; [`LearnError::Stopped`] when the flag was raised, with the finished rounds in the checkpoint.
pub fn train(lab: &Lab, config: &Config, options: Options<'_>) -> Result<Weights, LearnError> {
    let (dim, unknowns) = Sampler::new(lab, config, &config.basis).dimensions()?;
    let wanted = config.objectives.iter().fold(Perturbations::default(), |all, (_, o)| all.max(o.perturbations()));
    let shape = Shape { unknowns, perturbations: wanted.count() };
    if config.features < unknowns {
        let problem = format!("features = {}, and the model has {unknowns} unknowns; ask for more", config.features);
        return Err(LearnError::Data(problem));
    }
    match config.kind {
        Kind::Linear => run(lab, config, dim, LinearLearner::new(lab, config, dim, shape, wanted)?, options),
        Kind::Frequencies | Kind::Perceptron => run(lab, config, dim, RidgeLearner::new(config, dim, shape)?, options),
    }
}

/// Train one kind.
fn run<L: Learner>(
    lab: &Lab,
    config: &Config,
    dim: usize,
    mut learner: L,
    options: Options<'_>,
) -> Result<Weights, LearnError> {
    let features = learner.features();
    let sampler = Sampler::new(lab, config, &features);
    let s = &config.sampling;
    let mut checkpoint = Checkpoint::new(options.checkpoint, &format!("seed {}\n{}", config.seed, config.text));
    if options.resume {
        checkpoint = checkpoint.resume()?;
    }
    let stop = || options.cancel.is_some_and(|flag| flag.load(Ordering::Relaxed));
    let mut states =
        sampler.about_truth(Split::Training, s.trials, s.states, |a, b, c, d| learner.observe(a, b, c, d))?;
    let validation = sampler
        .about_truth(Split::Validation, s.validation_trials, s.states, |a, b, c, d| learner.observe(a, b, c, d))?;
    if states.is_empty() || validation.is_empty() {
        return Err(LearnError::Data("no state is finite and near enough to learn from".to_string()));
    }
    let mut parameters = learner.start(&states, &mut data_stream(config.seed, STREAM))?;
    for number in 0..=s.rounds {
        if number > 0 {
            let weights = weights_of(config, dim, &learner, &parameters);
            let new = sampler.along_paths(number, &weights.to_bytes(), |a, b, c, d| learner.observe(a, b, c, d))?;
            states.extend(new);
        }
        if let Some(known) = checkpoint.rounds.get(number) {
            if known.len() != parameters.len() {
                let problem = "holds another number of parameters; delete it".to_string();
                return Err(LearnError::Checkpoint { path: options.checkpoint.to_path_buf(), problem });
            }
            parameters.clone_from(known);
            continue;
        }
        let all: Vec<&L::State> = validation.iter().collect();
        let best_loss = mean(&learner, &parameters, &all, None);
        let mut round = Round {
            number: [number, s.rounds],
            states: &states,
            validation: &validation,
            best: parameters,
            best_loss,
            patience: config.training.patience,
            worse: 0,
            watch: &mut *options.watch,
        };
        let t = &config.training;
        let mut rng = data_stream(config.seed, STREAM + 1 + number as u64);
        match t.optimiser {
            Optimiser::Adam => adam(&learner, &mut round, t, &mut rng, &stop),
            Optimiser::LBfgs => l_bfgs(&learner, &mut round, t.steps, t.look, &stop),
        }
        if stop() {
            return Err(LearnError::Stopped { rounds: checkpoint.rounds.len() });
        }
        parameters = round.best;
        checkpoint.push(parameters.clone())?;
    }
    checkpoint.remove();
    Ok(weights_of(config, dim, &learner, &parameters))
}

/// Return the weights that parameters describe, with where they come from.
fn weights_of<L: Learner>(config: &Config, dim: usize, learner: &L, parameters: &[f64]) -> Weights {
    let scenarios: Vec<&str> = config.data.iter().map(|data| data.scenario.as_str()).collect();
    let notes = BTreeMap::from([
        ("seed".to_string(), config.seed.to_string()),
        ("data".to_string(), scenarios.join(", ")),
        ("training".to_string(), config.text.clone()),
        ("training_fnv1a".to_string(), format!("{:016x}", fnv1a(config.text.as_bytes()))),
        ("trained_by".to_string(), concat!("cfpose-learn ", env!("CARGO_PKG_VERSION")).to_string()),
    ]);
    Weights { dim, architecture: learner.architecture(parameters), notes }
}
