//! Global strategies around any solver: many starts, and basin hopping.

use std::fmt::Debug;

use rand::RngExt;
use rand_chacha::ChaCha12Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

use crate::entry::{EntryError, ParameterSpec, Parameters};
use crate::outcome::{Outcome, Status};
use crate::problem::LeastSquares;
use crate::session::{End, Session, run};
use crate::solver::{Control, Needs, SolveError, Solver, SolverEntry, build_inner};

/// A source of starts; the caller of a library may hand in its own.
pub trait StartGenerator: Send + Sync + Debug {
    /// Write a start (ambient coordinates): the `index`-th of a run, from 1, with the caller's start and a generator whose
    /// stream belongs to that index alone.
    fn generate(
        &self,
        problem: &dyn LeastSquares,
        start: &[f64],
        index: usize,
        generator: &mut ChaCha12Rng,
        out: &mut [f64],
    );
}

/// Draw within finite bounds uniformly; elsewhere move the start by normal steps of `spread` radians or multiples of the
/// size of theta (at least 1) along each tangent coordinate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scatter {
    /// Standard deviation of the moves.
    pub spread: f64,
}

impl StartGenerator for Scatter {
    fn generate(
        &self,
        problem: &dyn LeastSquares,
        start: &[f64],
        _index: usize,
        generator: &mut ChaCha12Rng,
        out: &mut [f64],
    ) {
        let manifold = problem.manifold();
        let mut step = vec![0.0; manifold.tangent()];
        manifold.extent(start, &mut step);
        for size in &mut step {
            let normal: f64 = StandardNormal.sample(generator);
            *size = self.spread * size.max(1.0) * normal;
        }
        manifold.retract(start, &step, out);
        if let Some(bounds) = problem.bounds() {
            for i in 0..out.len().min(bounds.lower.len()).min(bounds.upper.len()) {
                let (low, high) = (bounds.lower[i], bounds.upper[i]);
                if low.is_finite() && high.is_finite() && low < high {
                    out[i] = generator.random_range(low..=high);
                } else if low <= high {
                    out[i] = out[i].clamp(low, high);
                }
            }
            manifold.project(out);
        }
    }
}

/// Solve from the caller's start and from generated ones, keep the best.
///
/// Budgets, deadline and cancel flag hold for the whole; the status is that of the best run.
///
/// ```
/// use cfpose_optim::{Control, solvers, testproblems::nist};
/// let boxbod = nist::all().into_iter().find(|p| p.name == "BoxBOD").unwrap();
/// let solver = solvers::build("multi-start[solver=gauss-newton,starts=30]").unwrap();
/// let mut control = Control { seed: 3, ..Control::default() };
/// control.stopping.max_iterations = 2000;
/// let outcome = solver.solve(&boxbod.problem(), boxbod.certified.start1, &mut control).unwrap();
/// assert!(boxbod.digits(&outcome.theta) > 6.0, "{outcome:?}");
/// ```
#[derive(Debug)]
pub struct MultiStart<G> {
    /// Number of starts, the caller's included.
    pub starts: usize,
    /// Source of the other starts.
    pub generator: G,
    /// Solver of each run.
    pub inner: Inner,
}

/// Hop from minimum to minimum: perturb the current one, solve, accept a lower cost always and a higher one with probability
/// `exp(-increase / (temperature * least cost))`.
///
/// Source: Wales and Doye, Global optimization by basin-hopping, J. Phys. Chem. A 101 (1997).
///
/// ```
/// use cfpose_optim::{Control, solvers, testproblems::more_garbow_hillstrom};
/// let roth = &more_garbow_hillstrom::all()[1]; // local minimum 48.98, global minimum 0
/// let solver = solvers::build("basin-hopping[hops=20,spread=3]").unwrap();
/// let mut control = Control { seed: 1, ..Control::default() };
/// control.stopping.max_iterations = 2000;
/// let outcome = solver.solve(roth.problem.as_ref(), &roth.start, &mut control).unwrap();
/// assert!(outcome.cost < 1e-20, "{outcome:?}");
/// ```
#[derive(Debug)]
pub struct BasinHopping<G> {
    /// Number of hops.
    pub hops: usize,
    /// Temperature relative to the least cost; 0 accepts only improvements.
    pub temperature: f64,
    /// Source of the perturbations.
    pub generator: G,
    /// Solver of each basin.
    pub inner: Inner,
}

/// A boxed solver that can be shown.
pub struct Inner(pub Box<dyn Solver>);

impl Debug for Inner {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.0.name())
    }
}

/// Needs of a wrapper: those of the inner solver, and random numbers.
fn wrapped_needs(inner: &Inner) -> Needs {
    Needs { random: true, ..inner.0.needs() }
}

/// Generator of one index: streams of one seed never overlap.
fn generator_of(seed: u64, index: usize) -> ChaCha12Rng {
    let mut generator = ChaCha12Rng::seed_from_u64(seed);
    generator.set_stream(index as u64);
    generator
}

/// Run the inner solver and take its best point over.
fn descend(session: &mut Session<'_, '_>, inner: &Inner, start: &[f64], index: usize) -> Result<Outcome, End> {
    let seed = session.seed().wrapping_add(index as u64);
    let (outcome, end) = session.delegate(inner.0.as_ref(), session.problem(), start, seed, |_| {})?;
    session.adopt(&outcome.theta, outcome.cost);
    match end {
        Some(end) => Err(end),
        None => Ok(outcome),
    }
}

impl<G: StartGenerator> Solver for MultiStart<G> {
    fn name(&self) -> &'static str {
        MULTI_START.name
    }

    fn needs(&self) -> Needs {
        wrapped_needs(&self.inner)
    }

    fn solve(
        &self,
        problem: &dyn LeastSquares,
        start: &[f64],
        control: &mut Control<'_>,
    ) -> Result<Outcome, SolveError> {
        run(self.name(), self.needs(), problem, start, control, |session, start| {
            let mut best: Option<(f64, End)> = None;
            let mut from = start.to_vec();
            for index in 0..self.starts {
                if index > 0 {
                    let mut generator = generator_of(session.seed(), index);
                    self.generator.generate(problem, start, index, &mut generator, &mut from);
                }
                let outcome = descend(session, &self.inner, &from, index)?;
                if best.as_ref().is_none_or(|(cost, _)| outcome.cost < *cost) {
                    let message = format!("start {} of {} is best: {}", index + 1, self.starts, outcome.message);
                    best = Some((outcome.cost, End::new(outcome.status, message)));
                }
                if best.as_ref().is_some_and(|(_, end)| end.status == Status::ZeroResidual) {
                    break;
                }
            }
            Ok(best.map_or_else(|| End::new(Status::Stalled, "no start was asked for"), |(_, end)| end))
        })
    }
}

impl<G: StartGenerator> Solver for BasinHopping<G> {
    fn name(&self) -> &'static str {
        BASIN_HOPPING.name
    }

    fn needs(&self) -> Needs {
        wrapped_needs(&self.inner)
    }

    fn solve(
        &self,
        problem: &dyn LeastSquares,
        start: &[f64],
        control: &mut Control<'_>,
    ) -> Result<Outcome, SolveError> {
        run(self.name(), self.needs(), problem, start, control, |session, start| {
            let mut current = descend(session, &self.inner, start, 0)?;
            let mut best = (current.cost, End::new(current.status, current.message.clone()));
            let mut from = start.to_vec();
            for hop in 1..=self.hops {
                if best.1.status == Status::ZeroResidual {
                    break;
                }
                let mut generator = generator_of(session.seed(), hop);
                self.generator.generate(problem, &current.theta, hop, &mut generator, &mut from);
                let next = descend(session, &self.inner, &from, hop)?;
                if next.cost < best.0 {
                    let message = format!("hop {hop} of {} is best: {}", self.hops, next.message);
                    best = (next.cost, End::new(next.status, message));
                }
                let chance = (-(next.cost - current.cost) / (self.temperature * best.0)).exp();
                if next.cost < current.cost || generator.random::<f64>() < chance {
                    current = next;
                }
            }
            Ok(best.1)
        })
    }
}

const SOLVER: ParameterSpec = ParameterSpec {
    name: "solver",
    default: "levenberg-marquardt",
    meaning: "solver of each run, with its own parameters in brackets",
};
const SPREAD: ParameterSpec = ParameterSpec {
    name: "spread",
    default: "1",
    meaning: "spread of the starts in radians or multiples of the size of theta, > 0",
};

/// The line of the solver table for many starts.
pub const MULTI_START: SolverEntry = SolverEntry {
    name: "multi-start",
    summary: "any solver from many seeded starts, the best kept",
    parameters: &[
        SOLVER,
        ParameterSpec {
            name: "starts",
            default: "10",
            meaning: "number of starts, the given one included, 1 to 1000000",
        },
        SPREAD,
    ],
    source: "Rinnooy Kan and Timmer 1987",
    build: |parameters| {
        let (inner, generator) = (inner_of(parameters)?, scatter_of(parameters)?);
        Ok(Box::new(MultiStart { starts: parameters.count("starts", 1, 1_000_000)?, generator, inner }))
    },
};

/// The line of the solver table for basin hopping.
pub const BASIN_HOPPING: SolverEntry = SolverEntry {
    name: "basin-hopping",
    summary: "hops between the minima that any solver finds",
    parameters: &[
        SOLVER,
        ParameterSpec { name: "hops", default: "10", meaning: "number of hops, 0 to 1000000" },
        ParameterSpec {
            name: "temperature",
            default: "1",
            meaning: "temperature relative to the least cost; 0 accepts only improvements",
        },
        SPREAD,
    ],
    source: "Wales and Doye 1997",
    build: |parameters| {
        let (inner, generator) = (inner_of(parameters)?, scatter_of(parameters)?);
        let temperature = parameters.number("temperature", "a number from 0 up", |v| v.is_finite() && v >= 0.0)?;
        Ok(Box::new(BasinHopping { hops: parameters.count("hops", 0, 1_000_000)?, temperature, generator, inner }))
    },
};

fn inner_of(parameters: &Parameters) -> Result<Inner, EntryError> {
    build_inner(parameters, "solver").map(Inner)
}

fn scatter_of(parameters: &Parameters) -> Result<Scatter, EntryError> {
    Ok(Scatter { spread: parameters.number("spread", "a number above 0", |v| v.is_finite() && v > 0.0)? })
}
