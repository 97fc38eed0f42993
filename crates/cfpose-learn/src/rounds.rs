//! One round of training: states, the best parameters so far, and when to stop.

use crate::learner::{Learner, mean};

/// What a watcher of a training sees.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress {
    /// Round, from 0.
    pub round: usize,
    /// Rounds in all.
    pub rounds: usize,
    /// Steps of this round.
    pub step: usize,
    /// States that are trained on.
    pub states: usize,
    /// Mean loss of the last batch.
    pub loss: f64,
    /// Mean loss of the validation states.
    pub validation: f64,
}

/// A round under way.
pub struct Round<'a, L: Learner> {
    /// Number of the round, from 0, and of all rounds.
    pub number: [usize; 2],
    /// States of training.
    pub states: &'a [L::State],
    /// States of validation.
    pub validation: &'a [L::State],
    /// Parameters with the least validation loss.
    pub best: Vec<f64>,
    /// That loss.
    pub best_loss: f64,
    /// Looks without improvement after which the round ends.
    pub patience: usize,
    /// Looks without improvement so far.
    pub worse: usize,
    /// Is told every look.
    pub watch: &'a mut (dyn FnMut(Progress) + Send),
}

impl<L: Learner> Round<'_, L> {
    /// Return the validation loss of parameters.
    pub fn validate(&self, learner: &L, parameters: &[f64]) -> f64 {
        mean(learner, parameters, &self.validation.iter().collect::<Vec<_>>(), None)
    }

    /// Compare parameters with the best; say whether the round is over.
    pub fn look(&mut self, learner: &L, parameters: &[f64], step: usize, loss: f64) -> bool {
        let validation = self.validate(learner, parameters);
        let [round, rounds] = self.number;
        (self.watch)(Progress { round, rounds, step, states: self.states.len(), loss, validation });
        if validation < self.best_loss {
            self.best = parameters.to_vec();
            self.best_loss = validation;
            self.worse = 0;
        } else {
            self.worse += 1;
        }
        self.worse >= self.patience
    }
}
