//! L-BFGS on all states, through argmin.

use std::cell::RefCell;

use argmin::core::{CostFunction, Error, Executor, Gradient, State};
use argmin::solver::linesearch::MoreThuenteLineSearch;
use argmin::solver::quasinewton::LBFGS;

use crate::learner::{Learner, mean};
use crate::rounds::Round;

/// Pairs of steps and gradient changes that are remembered.
const MEMORY: usize = 10;

/// The mean loss as argmin sees it.
struct Loss<'a, L: Learner> {
    learner: &'a L,
    states: Vec<&'a L::State>,
    stop: &'a dyn Fn() -> bool,
    /// Parameters of the least loss: an error in a line search must not lose them.
    best: RefCell<(f64, Vec<f64>)>,
}

impl<L: Learner> CostFunction for &Loss<'_, L> {
    type Param = Vec<f64>;
    type Output = f64;

    fn cost(&self, parameters: &Vec<f64>) -> Result<f64, Error> {
        if (self.stop)() {
            return Err(Error::msg("stopped"));
        }
        let loss = mean(self.learner, parameters, &self.states, None);
        if loss < self.best.borrow().0 {
            *self.best.borrow_mut() = (loss, parameters.clone());
        }
        Ok(loss)
    }
}

impl<L: Learner> Gradient for &Loss<'_, L> {
    type Param = Vec<f64>;
    type Gradient = Vec<f64>;

    fn gradient(&self, parameters: &Vec<f64>) -> Result<Vec<f64>, Error> {
        let mut gradient = vec![0.0; parameters.len()];
        mean(self.learner, parameters, &self.states, Some(&mut gradient));
        Ok(gradient)
    }
}

/// Minimise the mean loss over all states in runs of `look` iterations, and keep the parameters of the best validation loss.
pub fn l_bfgs<L: Learner>(learner: &L, round: &mut Round<'_, L>, steps: usize, look: usize, stop: &dyn Fn() -> bool) {
    let mut parameters = round.best.clone();
    let states: Vec<&L::State> = round.states.iter().collect();
    let mut done = 0;
    while done < steps && !stop() {
        let best = RefCell::new((f64::INFINITY, parameters.clone()));
        let loss = Loss { learner, states: states.clone(), stop, best };
        let iterations = look.min(steps - done) as u64;
        let method = LBFGS::new(MoreThuenteLineSearch::new(), MEMORY);
        let start = parameters.clone();
        let run = Executor::new(&loss, method).configure(|state| state.param(start).max_iters(iterations)).run();
        // A line search that finds nothing better ends the round; what it found before counts.
        let over = run.map_or(true, |result| result.state().get_iter() < iterations);
        let (value, found) = loss.best.into_inner();
        parameters = found;
        done += look;
        if round.look(learner, &parameters, done.min(steps), value) || over {
            return;
        }
    }
}
