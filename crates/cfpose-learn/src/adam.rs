//! Adam on random batches.

use cfpose_lab::ChaCha12Rng;
use cfpose_lab::rand::RngExt;

use crate::config::Schedule;
use crate::learner::{Learner, mean};
use crate::rounds::Round;

/// Decay of the mean of gradients and of their squares.
const DECAY: [f64; 2] = [0.9, 0.99];
/// Share of the first rate that is left at the last step.
const LAST_RATE: f64 = 1.0 / 30.0;

/// Minimise the mean loss (Kingma and Ba 2015; the rate falls linearly) and keep the parameters of the best validation loss.
///
/// `stop` is asked before every step.
pub fn adam<L: Learner>(
    learner: &L,
    round: &mut Round<'_, L>,
    schedule: &Schedule,
    rng: &mut ChaCha12Rng,
    stop: &dyn Fn() -> bool,
) {
    let mut parameters = round.best.clone();
    let n = parameters.len();
    let (mut first, mut second, mut gradient) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
    let mut decays = [1.0; 2];
    for step in 0..schedule.steps {
        if stop() {
            return;
        }
        let batch = batch(round.states, schedule.batch, learner.run_length(), rng);
        let loss = mean(learner, &parameters, &batch, Some(&mut gradient));
        let left = 1.0 - step as f64 / schedule.steps as f64;
        let rate = schedule.rate * (left + LAST_RATE) * learner.step_size(&parameters);
        decays = [decays[0] * DECAY[0], decays[1] * DECAY[1]];
        for i in 0..n {
            first[i] = DECAY[0] * first[i] + (1.0 - DECAY[0]) * gradient[i];
            second[i] = DECAY[1] * second[i] + (1.0 - DECAY[1]) * gradient[i] * gradient[i];
            let (m, v) = (first[i] / (1.0 - decays[0]), second[i] / (1.0 - decays[1]));
            parameters[i] -= rate * m / (v.sqrt() + 1e-9);
        }
        if (step + 1).is_multiple_of(schedule.look) && round.look(learner, &parameters, step + 1, loss) {
            return;
        }
    }
}

/// Draw a batch of runs of neighbouring states.
fn batch<'s, S>(states: &'s [S], count: usize, run: usize, rng: &mut ChaCha12Rng) -> Vec<&'s S> {
    let runs = count.div_ceil(run);
    let mut batch = Vec::with_capacity(runs * run);
    for _ in 0..runs {
        let first = rng.random_range(0..states.len());
        batch.extend((0..run).map(|k| &states[(first + k) % states.len()]));
    }
    batch
}
