//! The one object-safe solver trait, its stopping rules and its table entry.

use std::sync::atomic::AtomicBool;
use std::time::Duration;

use crate::entry::{EntryError, ParameterSpec, Parameters, parse_spec, require_one, suggest};
use crate::observe::Observer;
use crate::outcome::Outcome;
use crate::problem::LeastSquares;

/// A solver for [`LeastSquares`] problems. Object safe: programs choose one by name.
pub trait Solver: Send + Sync {
    /// Return the table name.
    fn name(&self) -> &'static str;

    /// Say what the solver needs of a problem.
    fn needs(&self) -> Needs;

    /// Minimise `problem` from `start` (ambient coordinates).
    ///
    /// Not converging is a status in the [`Outcome`], never an error; the best point seen is always returned.
    ///
    /// # Errors
    /// [`SolveError`] for misuse only: a start of the wrong length or with non-finite entries.
    fn solve(
        &self,
        problem: &dyn LeastSquares,
        start: &[f64],
        control: &mut Control<'_>,
    ) -> Result<Outcome, SolveError>;
}

/// What a solver needs or can use, as data; an unsupported pair is reported as skipped with the reason.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Needs {
    /// Needs the Jacobian.
    pub jacobian: bool,
    /// Needs exact second derivatives.
    pub curvature: bool,
    /// Respects bounds.
    pub bounds: bool,
    /// Respects general constraints.
    pub constraints: bool,
    /// Uses random numbers from [`Control::seed`].
    pub random: bool,
}

/// Misuse of a solver.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SolveError {
    /// The start has the wrong length.
    #[error("the start has {found} numbers, the manifold needs {expected}")]
    StartLength {
        /// Ambient size of the manifold.
        expected: usize,
        /// Length of the start.
        found: usize,
    },
    /// The start holds NaN or an infinity.
    #[error("entry {index} of the start is {value}, not a finite number")]
    StartNotFinite {
        /// Index of the entry, from 0.
        index: usize,
        /// Its value.
        value: f64,
    },
    /// The solver, or the code of the problem that it calls, does what it must not: it panics, or returns what is no outcome.
    #[error("solver `{solver}`: {problem}")]
    Broken {
        /// Name of the solver.
        solver: String,
        /// What it did.
        problem: String,
    },
}

/// Stopping rules. Every tolerance is an `Option`: `None` switches the rule off.
#[derive(Debug, Clone, PartialEq)]
pub struct Stopping {
    /// Stop when `max_j |(J'r)_j| / (norm(J_j) * norm(r)) <= gradient_tolerance` (MINPACK's cosine test; columns of norm 0 count 0).
    pub gradient_tolerance: Option<f64>,
    /// Stop when both the actual and the predicted relative decrease of the cost are `<= cost_tolerance` in an accepted step
    /// that was not cut short, or when a step that promises no more is rejected for a rise within rounding.
    pub cost_tolerance: Option<f64>,
    /// Stop when `norm(D step) <= step_tolerance * (norm(D theta) + step_tolerance)` with the solver's scaling D and
    /// the size of theta from [`crate::Manifold::extent`], in a step that was not cut short.
    pub step_tolerance: Option<f64>,
    /// Stop when `cost <= zero_cost`.
    pub zero_cost: Option<f64>,
    /// Limit on outer iterations.
    pub max_iterations: usize,
    /// Limit on residual evaluations (an evaluation of residual and Jacobian together counts as one).
    pub max_evaluations: usize,
    /// Limit on wall-clock time.
    pub deadline: Option<Duration>,
}

impl Default for Stopping {
    fn default() -> Self {
        Self {
            gradient_tolerance: Some(1e-10),
            cost_tolerance: Some(1e-14),
            step_tolerance: Some(1e-12),
            zero_cost: Some(1e-32),
            max_iterations: 200,
            max_evaluations: 2000,
            deadline: None,
        }
    }
}

/// Everything around a solve: stopping rules, seed, cancel flag, observer.
#[derive(Default)]
pub struct Control<'a> {
    /// Stopping rules.
    pub stopping: Stopping,
    /// Seed of the solver's own randomness.
    pub seed: u64,
    /// Flag that another thread may raise to stop the solve.
    pub cancel: Option<&'a AtomicBool>,
    /// Observer of iterations.
    pub observer: Option<&'a mut dyn Observer>,
    /// Keep a trace in the outcome.
    pub trace: bool,
}

/// One line of the solver table.
pub struct SolverEntry {
    /// Name, kebab-case.
    pub name: &'static str,
    /// One line for lists.
    pub summary: &'static str,
    /// Parameters with defaults.
    pub parameters: &'static [ParameterSpec],
    /// Reference.
    pub source: &'static str,
    /// Build the solver from its parameters.
    pub build: fn(&Parameters) -> Result<Box<dyn Solver>, EntryError>,
}

/// The solvers that a solver made from other ones may name.
struct Table(Vec<&'static SolverEntry>);

/// Build a solver from `name` or `name[key=value,...]` out of a table. Solvers that the parameters name come from it too.
///
/// # Errors
/// [`EntryError`] for a text that cannot be read, an unknown name (with the nearest ones), an unknown parameter or a value
/// that cannot be used.
pub fn build_from(table: &[&'static SolverEntry], text: &str) -> Result<Box<dyn Solver>, EntryError> {
    let (name, given) = parse_spec(text)?;
    require_one("solver", &name, table.iter().map(|entry| entry.name))?;
    let entry = table.iter().find(|entry| entry.name == name).ok_or_else(|| EntryError::UnknownName {
        kind: "solver",
        suggestions: suggest(&name, table.iter().map(|entry| entry.name)),
        name: name.clone(),
    })?;
    let parameters = Parameters::resolve("solver", &name, entry.parameters, &given)?;
    (entry.build)(&parameters.with_table(Table(table.to_vec())))
}

/// Build the solver that a parameter names, for entries that wrap one: out of the table the outer entry came from.
///
/// # Errors
/// As [`build_from`]; [`EntryError::BadValue`] where the entry was not built through [`build_from`].
pub fn build_inner(parameters: &Parameters, key: &str) -> Result<Box<dyn Solver>, EntryError> {
    match parameters.table::<Table>() {
        Some(Table(table)) => build_from(table, parameters.text(key)),
        None => {
            Err(parameters.bad(key, "there is no table to find it in; build the outer solver through `build_from`"))
        }
    }
}
