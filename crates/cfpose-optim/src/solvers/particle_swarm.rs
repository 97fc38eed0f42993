//! Particle swarm by argmin.

use argmin::core::{PopulationState, State};
use argmin::solver::particleswarm::{Particle, ParticleSwarm as Method};
use rand_chacha09::ChaCha12Rng;
use rand_chacha09::rand_core::SeedableRng;

use crate::argmin_drive::{NARROW, Operator, Patience, drive};
use crate::entry::ParameterSpec;
use crate::outcome::Outcome;
use crate::problem::LeastSquares;
use crate::session::run;
use crate::solver::{Control, Needs, SolveError, Solver, SolverEntry};
use crate::tangent::{Frame, Round, rounds};

/// Minimise by a swarm within a box of tangent coordinates around the best point, in rounds whose box shrinks when they bring
/// little: a global search at first, a local one at the end. Needs no derivative; repeats bit for bit for a seed.
///
/// Source: Zambrano-Bigiarini et al., Standard particle swarm optimisation 2011 at CEC-2013 (2013); back-end argmin.
///
/// ```
/// use cfpose_optim::{Control, solvers, testproblems::Rosenbrock};
/// let solver = solvers::build("particle-swarm[particles=20]").unwrap();
/// let mut control = Control { seed: 1, ..Control::default() };
/// (control.stopping.max_evaluations, control.stopping.max_iterations) = (40_000, 40_000);
/// let outcome = solver.solve(&Rosenbrock, &[-1.2, 1.0], &mut control).unwrap();
/// assert!((outcome.theta[0] - 1.0).abs() < 1e-4, "{outcome:?}");
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ParticleSwarm {
    /// Number of particles.
    pub particles: usize,
    /// Iterations of a round.
    pub iterations: usize,
    /// Half width of the first box: radians, or multiples of the size of theta.
    pub width: f64,
}

impl Solver for ParticleSwarm {
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

impl ParticleSwarm {
    fn round(&self, frame: &Frame<'_, '_, '_>, index: usize, width: &mut f64) -> Round {
        let half: Vec<f64> = frame.extent().iter().map(|e| e.max(1.0) * *width).collect();
        let bounds = (half.iter().map(|h| -h).collect::<Vec<f64>>(), half);
        let mut generator = ChaCha12Rng::seed_from_u64(frame.seed());
        generator.set_stream(index as u64);
        let before = frame.base_cost();
        let mut method = Method::new(bounds, self.particles).with_rng_generator(generator);
        let state = PopulationState::<Particle<Vec<f64>, f64>, f64>::new();
        let patience = Patience { iterations: self.iterations, without_gain: self.iterations, own_end: false };
        let operator = Operator { frame, lenient: true, joint: false, moves: None };
        drive(operator, &mut method, state, patience, |state| state.get_param().map(|p| p.position.clone()));
        let gain = (before - frame.best_cost()) / before;
        // A large gain may mean that the box holds the minimum at its rim: keep the width for one more round.
        *width *= if gain > 0.5 { 0.9 } else { 0.5 };
        if *width > NARROW { Round::Wide } else { Round::Decisive }
    }
}

/// The line of the solver table.
pub const ENTRY: SolverEntry = SolverEntry {
    name: "particle-swarm",
    summary: "particle swarm in a shrinking box, no derivatives (argmin)",
    parameters: &[
        ParameterSpec { name: "particles", default: "30", meaning: "number of particles, 2 to 10000" },
        ParameterSpec { name: "iterations", default: "25", meaning: "iterations of a round, 1 to 100000" },
        ParameterSpec {
            name: "width",
            default: "1",
            meaning: "half width of the first box in radians or multiples of the size of theta, > 0",
        },
    ],
    source: "Zambrano-Bigiarini et al. 2013; argmin 0.11",
    build: |parameters| {
        Ok(Box::new(ParticleSwarm {
            particles: parameters.count("particles", 2, 10_000)?,
            iterations: parameters.count("iterations", 1, 100_000)?,
            width: parameters.number("width", "a number above 0", |v| v.is_finite() && v > 0.0)?,
        }))
    },
};
