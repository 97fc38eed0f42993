//! Simulated annealing by argmin.

use argmin::core::State;
use argmin::solver::simulatedannealing::{SATempFunc, SimulatedAnnealing as Method};
use rand_chacha09::ChaCha12Rng;
use rand_chacha09::rand_core::SeedableRng;

use crate::argmin_drive::{Moves, NARROW, Operator, Patience, Plain, current, drive};
use crate::entry::ParameterSpec;
use crate::outcome::Outcome;
use crate::problem::LeastSquares;
use crate::session::run;
use crate::solver::{Control, Needs, SolveError, Solver, SolverEntry};
use crate::tangent::{Frame, Round, rounds};

/// Minimise by annealed random moves of tangent coordinates, in rounds around the best point whose moves and temperature
/// shrink: a global search at first, a local one at the end. Needs no derivative; repeats bit for bit for a seed.
///
/// Within a round the temperature falls from `temperature * cost * (width / first width)^2` by the factor `cooling` per
/// iteration; a worse point is accepted with probability `1 / (1 + exp(increase / temperature))`.
///
/// Source: Kirkpatrick, Gelatt and Vecchi, Optimization by simulated annealing, Science 220 (1983); back-end argmin.
///
/// ```
/// use cfpose_optim::{Control, solvers, testproblems::Rosenbrock};
/// let solver = solvers::build("simulated-annealing").unwrap();
/// let mut control = Control { seed: 1, ..Control::default() };
/// (control.stopping.max_evaluations, control.stopping.max_iterations) = (60_000, 60_000);
/// let outcome = solver.solve(&Rosenbrock, &[-1.2, 1.0], &mut control).unwrap();
/// assert!((outcome.theta[0] - 1.0).abs() < 1e-2, "{outcome:?}");
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SimulatedAnnealing {
    /// First temperature relative to the cost.
    pub temperature: f64,
    /// Factor of the temperature per iteration.
    pub cooling: f64,
    /// Iterations of a round per tangent coordinate.
    pub iterations: usize,
    /// Standard deviation of the first moves: radians, or multiples of the size of theta.
    pub width: f64,
}

impl Solver for SimulatedAnnealing {
    fn name(&self) -> &'static str {
        ENTRY.name
    }

    fn needs(&self) -> Needs {
        Needs { random: true, ..Needs::default() }
    }

    fn solve(
        &self,
        problem: &dyn LeastSquares,
        start: &[f64],
        control: &mut Control<'_>,
    ) -> Result<Outcome, SolveError> {
        run(self.name(), self.needs(), problem, start, control, |session, start| {
            let mut width = self.width;
            rounds(session, start, false, |frame, index| self.round(frame, index, &mut width))
        })
    }
}

impl SimulatedAnnealing {
    fn round(&self, frame: &Frame<'_, '_, '_>, index: usize, width: &mut f64) -> Round {
        let widths = frame.extent().iter().map(|e| e.max(1.0) * *width / (frame.size as f64).sqrt()).collect();
        let before = frame.base_cost();
        let temperature = self.temperature * before * (*width / self.width).powi(2);
        let mut generator = ChaCha12Rng::seed_from_u64(frame.seed());
        generator.set_stream(2 * index as u64);
        let Ok(method) = Method::new_with_rng(temperature.max(f64::MIN_POSITIVE), generator) else {
            return Round::Decisive;
        };
        let mut method = method.with_temp_func(SATempFunc::Exponential(self.cooling));
        let iterations = self.iterations * frame.size;
        let patience = Patience { iterations, without_gain: iterations, own_end: false };
        let moves = Some(Moves::new(widths, frame.seed(), 2 * index as u64 + 1));
        let state = Plain::new().param(vec![0.0; frame.size]).cost(before);
        drive(Operator { frame, lenient: true, joint: false, moves }, &mut method, state, patience, current);
        let gain = (before - frame.best_cost()) / before;
        *width *= if gain > 0.5 { 0.95 } else { 0.7 };
        if *width > NARROW { Round::Wide } else { Round::Decisive }
    }
}

/// The line of the solver table.
pub const ENTRY: SolverEntry = SolverEntry {
    name: "simulated-annealing",
    summary: "simulated annealing with shrinking moves, no derivatives (argmin)",
    parameters: &[
        ParameterSpec { name: "temperature", default: "0.1", meaning: "first temperature relative to the cost, > 0" },
        ParameterSpec {
            name: "cooling",
            default: "0.95",
            meaning: "factor of the temperature per iteration, 0 < . < 1",
        },
        ParameterSpec {
            name: "iterations",
            default: "40",
            meaning: "iterations of a round per tangent coordinate, 1 to 100000",
        },
        ParameterSpec {
            name: "width",
            default: "0.5",
            meaning: "spread of the first moves in radians or multiples of the size of theta, > 0",
        },
    ],
    source: "Kirkpatrick, Gelatt and Vecchi 1983; argmin 0.11",
    build: |parameters| {
        let positive = |v: f64| v.is_finite() && v > 0.0;
        Ok(Box::new(SimulatedAnnealing {
            temperature: parameters.number("temperature", "a number above 0", positive)?,
            cooling: parameters.number("cooling", "a number between 0 and 1", |v| v > 0.0 && v < 1.0)?,
            iterations: parameters.count("iterations", 1, 100_000)?,
            width: parameters.number("width", "a number above 0", positive)?,
        }))
    },
};
