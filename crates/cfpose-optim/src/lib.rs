//! Least-squares problems on manifolds and the solvers for them.
//!
//! This crate never sees a point, a pose or a feature function: a problem is a residual, a Jacobian and a manifold, all as
//! plain slices of `f64`.
//!
//! * To solve a problem: [`LeastSquares`], [`Manifold`], [`solvers::build`], [`Control`], [`Outcome`].
//! * To write a solver: [`Solver`], [`SolverEntry`], [`session`] and [`check::conformance`].
//! * To write a new step or a new damping for the usual loop: [`StepRule`], [`Search`], [`descend`], [`descent::region`],
//!   [`Qr`].
//! * To run a minimiser of another crate on a manifold: [`tangent::Frame`], [`tangent::rounds`].

mod argmin_drive;
pub mod auto;
mod basin_drive;
pub mod check;
mod constrained;
pub mod constraint;
pub mod covariance;
pub mod descent;
pub mod entry;
mod interrupt;
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
pub mod tangent;
pub mod testproblems;

pub use descent::{Proposal, Search, StepRule, descend};
pub use interrupt::Interrupt;
pub use linear::Qr;
pub use manifold::Manifold;
pub use observe::Observer;
pub use outcome::{Counts, Outcome, Status, TraceRow};
pub use problem::{Capabilities, LeastSquares};
pub use solver::{Control, Needs, SolveError, Solver, SolverEntry, Stopping};

/// The page that tells how to add a solver, compiled and run as a test.
#[cfg(doctest)]
#[doc = include_str!("../../../docs/adding/solver.md")]
mod adding_a_solver {}
