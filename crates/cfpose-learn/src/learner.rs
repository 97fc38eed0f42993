//! What can be trained: parameters, states that were sampled once, the mean loss and its gradient.

use cfpose::families::learned::Architecture;
use cfpose_lab::ChaCha12Rng;
use rayon::prelude::*;

use crate::error::LearnError;
use crate::normal::Shape;
use crate::objective::DynObjective;
use crate::sample::Scene;

/// States of one share of a sum; shares are added in order, so that the bits do not depend on threads.
const SHARE: usize = 64;

/// A kind of functions under training.
pub trait Learner: Send + Sync {
    /// What is kept of a theta on a trial: enough to compute means and derivatives for any parameters.
    type State: Send + Sync;

    /// Look at a theta whose error is `delta`; `None` where its means are not finite.
    fn observe(&self, scene: &Scene, theta: &[f64], delta: Vec<f64>, rng: &mut ChaCha12Rng) -> Option<Self::State>;

    /// Choose where to begin, from the states of the first round.
    ///
    /// # Errors
    /// [`LearnError::Data`] where the states leave no choice.
    fn start(&mut self, states: &[Self::State], rng: &mut ChaCha12Rng) -> Result<Vec<f64>, LearnError>;

    /// Return the sum of the losses of states; add its gradient to `gradient` where that is not empty.
    fn sum(&self, parameters: &[f64], states: &[&Self::State], gradient: &mut [f64]) -> f64;

    /// Return the functions that the parameters describe.
    fn architecture(&self, parameters: &[f64]) -> Architecture;

    /// Return the name of the family that scenes are built with.
    fn features(&self) -> String;

    /// Return how many states in a row a batch takes: more than 1 where states of one trial share work.
    fn run_length(&self) -> usize {
        1
    }

    /// Return the size of the parameters, which Adam's rate is relative to.
    fn step_size(&self, parameters: &[f64]) -> f64 {
        parameters.iter().map(|p| p.abs()).sum::<f64>() / parameters.len().max(1) as f64
    }
}

/// Return the mean loss over states, and its gradient where wanted.
pub fn mean<L: Learner>(learner: &L, parameters: &[f64], states: &[&L::State], gradient: Option<&mut [f64]>) -> f64 {
    let wanted = gradient.is_some();
    let shares: Vec<(f64, Vec<f64>)> = states
        .par_chunks(SHARE)
        .map(|share| {
            let mut own = vec![0.0; if wanted { parameters.len() } else { 0 }];
            let sum = learner.sum(parameters, share, &mut own);
            (sum, own)
        })
        .collect();
    let scale = (states.len().max(1) as f64).recip();
    if let Some(gradient) = gradient {
        gradient.fill(0.0);
        for (_, own) in &shares {
            gradient.iter_mut().zip(own).for_each(|(sum, value)| *sum += value * scale);
        }
    }
    shares.iter().map(|(sum, _)| sum).sum::<f64>() * scale
}

/// Compare the gradient of the mean loss with central differences.
#[cfg(test)]
pub fn check_gradient<L: Learner>(learner: &L, at: &[f64], states: &[L::State], case: &str) {
    let states: Vec<&L::State> = states.iter().collect();
    let mut gradient = vec![0.0; at.len()];
    mean(learner, at, &states, Some(&mut gradient));
    let largest = gradient.iter().fold(0.0_f64, |a, b| a.max(b.abs()));
    assert!(largest > 1e-3, "{case}: {largest}");
    for i in 0..at.len() {
        let cost = |step: f64| {
            let mut moved = at.to_vec();
            moved[i] += step;
            mean(learner, &moved, &states, None)
        };
        let difference = (cost(1e-5) - cost(-1e-5)) / 2e-5;
        assert!((difference - gradient[i]).abs() < 1e-6 * largest.max(1.0), "{case} {i}: {difference} {}", gradient[i]);
    }
}

/// Return the loss of one state from its columns Y (features x width, column by column): r, A and the perturbations after C; where
/// `slopes` is not empty, write d loss / dY there.
///
/// Inner products are Y'U with the second set of columns, U = Q Y for a metric Q of the features (Y itself without one). The loss is a
/// function of these products. With S its derivative by their upper triangle, dY = U (S + S').
pub fn loss_of_columns(
    objectives: &[(f64, Box<dyn DynObjective>)],
    shape: Shape,
    [left, right]: [&[f64]; 2],
    delta: &[f64],
    slopes: &mut [f64],
) -> f64 {
    let width = shape.width();
    let rows = left.len() / width;
    let mut products = vec![0.0; shape.products()];
    for a in 0..width {
        for b in a..width {
            let pairs = left[a * rows..(a + 1) * rows].iter().zip(&right[b * rows..(b + 1) * rows]);
            products[shape.place(a, b)] = pairs.map(|(x, y)| x * y).sum();
        }
    }
    if slopes.is_empty() {
        return objectives.iter().map(|(weight, objective)| weight * objective.value(shape, &products, delta)).sum();
    }
    let mut upper = vec![0.0; products.len()];
    let loss = objectives
        .iter()
        .map(|(weight, objective)| weight * objective.slopes(shape, &products, delta, *weight, &mut upper))
        .sum();
    slopes.fill(0.0);
    for a in 0..width {
        for b in a..width {
            let slope = upper[shape.place(a, b)];
            for k in 0..rows {
                slopes[a * rows + k] += slope * right[b * rows + k];
                slopes[b * rows + k] += slope * right[a * rows + k];
            }
        }
    }
    loss
}
