//! Least-squares problems on manifolds and the solvers for them.
//!
//! This crate never sees a point, a pose or a feature function: a problem is a residual, a Jacobian and a manifold, all as
//! plain slices of `f64`.

pub mod auto;
pub mod check;
pub mod constraint;
pub mod covariance;
pub mod entry;
pub mod linear;
pub mod manifold;
pub mod masked;
pub mod observe;
pub mod outcome;
pub mod problem;
pub mod robust;
pub mod session;
pub mod solver;
pub mod solvers;
pub mod testproblems;

pub use manifold::Manifold;
pub use observe::Observer;
pub use outcome::{Counts, Outcome, Status, TraceRow};
pub use problem::{Capabilities, LeastSquares};
pub use solver::{Control, Needs, SolveError, Solver, SolverEntry, Stopping};

/// The page that tells how to add a solver, compiled and run as a test.
#[cfg(doctest)]
#[doc = include_str!("../../../docs/adding/solver.md")]
mod adding_a_solver {}
