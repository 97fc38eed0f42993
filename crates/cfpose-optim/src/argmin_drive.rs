//! What the argmin back-ends share: the operator that argmin calls, and the loop that calls argmin.
//!
//! argmin's `Executor` is not used: its `Ok` does not mean converged, an error in a line search loses the best point, and
//! its trust region never ends. The methods are stepped one iteration at a time inside a [`Frame`].

use std::cell::RefCell;

use argmin::core::{CostFunction, Error, Gradient, Hessian, IterState, Problem, Solver as Method, State};
use argmin::solver::simulatedannealing::Anneal;
use rand_chacha::ChaCha12Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

use crate::tangent::{Frame, guarded};

/// Half width of a box of tangent coordinates below which the gain of a round tells about convergence: the cost is flat to
/// rounding there.
pub(crate) const NARROW: f64 = 1e-7;

/// State of methods without and with a gradient, and with a matrix.
pub(crate) type Plain = IterState<Vec<f64>, (), (), (), (), f64>;
pub(crate) type First = IterState<Vec<f64>, Vec<f64>, (), (), (), f64>;
pub(crate) type Second = IterState<Vec<f64>, Vec<f64>, (), Vec<Vec<f64>>, (), f64>;

/// The cost as argmin sees it.
pub(crate) struct Operator<'o, 'f, 's, 'a> {
    pub(crate) frame: &'o Frame<'f, 's, 'a>,
    /// Give an infinite cost instead of an error when the solve is over: argmin's Nelder-Mead unwraps.
    pub(crate) lenient: bool,
    /// Evaluate cost and gradient together.
    pub(crate) joint: bool,
    /// Widths and generator of random moves.
    pub(crate) moves: Option<Moves>,
}

/// Normal moves of given widths.
pub(crate) struct Moves {
    widths: Vec<f64>,
    generator: RefCell<ChaCha12Rng>,
}

impl Moves {
    pub(crate) fn new(widths: Vec<f64>, seed: u64, stream: u64) -> Self {
        let mut generator = ChaCha12Rng::seed_from_u64(seed);
        generator.set_stream(stream);
        Self { widths, generator: RefCell::new(generator) }
    }
}

fn stopped() -> Error {
    Error::msg("the solve is over, or the point is not finite")
}

impl CostFunction for Operator<'_, '_, '_, '_> {
    type Param = Vec<f64>;
    type Output = f64;

    fn cost(&self, x: &Vec<f64>) -> Result<f64, Error> {
        let cost = if self.joint { self.frame.cost_and_gradient(x).map(|(cost, _)| cost) } else { self.frame.cost(x) };
        match cost {
            Some(cost) => Ok(cost),
            None if self.lenient => Ok(f64::INFINITY),
            None => Err(stopped()),
        }
    }
}

impl Gradient for Operator<'_, '_, '_, '_> {
    type Param = Vec<f64>;
    type Gradient = Vec<f64>;

    fn gradient(&self, x: &Vec<f64>) -> Result<Vec<f64>, Error> {
        self.frame.cost_and_gradient(x).map(|(_, gradient)| gradient).ok_or_else(stopped)
    }
}

impl Hessian for Operator<'_, '_, '_, '_> {
    type Param = Vec<f64>;
    type Hessian = Vec<Vec<f64>>;

    fn hessian(&self, x: &Vec<f64>) -> Result<Vec<Vec<f64>>, Error> {
        self.frame.normal_matrix(x).ok_or_else(stopped)
    }
}

impl Anneal for Operator<'_, '_, '_, '_> {
    type Param = Vec<f64>;
    type Output = Vec<f64>;
    type Float = f64;

    fn anneal(&self, x: &Vec<f64>, _temperature: f64) -> Result<Vec<f64>, Error> {
        let Some(moves) = &self.moves else { return Ok(x.clone()) };
        let generator = &mut *moves.generator.borrow_mut();
        let step = |(x, width): (&f64, &f64)| {
            let normal: f64 = StandardNormal.sample(generator);
            x + width * normal
        };
        Ok(x.iter().zip(&moves.widths).map(step).collect())
    }
}

/// When a round is over.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Patience {
    /// Iterations of a round at most.
    pub(crate) iterations: usize,
    /// Iterations without a relative decrease of the least cost above rounding.
    pub(crate) without_gain: usize,
    /// Whether the method's own end of a round is asked for.
    pub(crate) own_end: bool,
}

/// Step a method until the round is over.
pub(crate) fn drive<'o, 'f, 's, 'a, S, M>(
    operator: Operator<'o, 'f, 's, 'a>,
    method: &mut M,
    state: S,
    patience: Patience,
    position: impl Fn(&S) -> Option<Vec<f64>>,
) where
    S: State<Float = f64>,
    M: Method<Operator<'o, 'f, 's, 'a>, S>,
{
    let frame = operator.frame;
    let mut problem = Problem::new(operator);
    let Some(Ok((mut state, _))) = guarded(|| method.init(&mut problem, state)) else { return };
    state.update();
    let (mut least, mut idle) = (frame.best_cost(), 0);
    let mut at = position(&state).unwrap_or_default();
    for _ in 0..patience.iterations {
        if frame.is_over() || frame.next_iteration().is_none() {
            return;
        }
        let Some(Ok((next, _))) = guarded(|| method.next_iter(&mut problem, state)) else { return };
        state = next;
        state.update();
        state.increment_iter();
        if let Some(now) = position(&state) {
            let step: f64 = now.iter().zip(&at).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt();
            frame.record(&now, state.get_cost(), step, f64::NAN);
            at = now;
        }
        let best = frame.best_cost();
        idle = if best < least * (1.0 - 4.0 * f64::EPSILON) { 0 } else { idle + 1 };
        least = best;
        let own_end = patience.own_end && guarded(|| method.terminate(&state).terminated()) != Some(false);
        if idle >= patience.without_gain || frame.flat().is_some() || own_end {
            return;
        }
    }
}

/// Return the current point of a state with one.
pub(crate) fn current<G, J, H, R>(state: &IterState<Vec<f64>, G, J, H, R, f64>) -> Option<Vec<f64>>
where
    IterState<Vec<f64>, G, J, H, R, f64>: State<Param = Vec<f64>>,
{
    state.get_param().cloned()
}

/// Iterations of a round: a curved manifold needs its base moved now and then.
pub(crate) fn round_length(frame: &Frame<'_, '_, '_>) -> usize {
    if frame.is_flat_space() { 2000 } else { 40 }
}
