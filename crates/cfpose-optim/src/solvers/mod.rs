//! The table of solvers: one file and one line each.

pub use crate::constrained::Loss;
pub use crate::descent;
use crate::entry::EntryError;
pub use crate::solver::build_from;
use crate::solver::{Solver, SolverEntry};

mod argmin_trust_region;
mod augmented_lagrangian;
mod basin;
mod bfgs;
mod clarabel;
mod gauss_newton;
mod global;
mod l_bfgs;
mod levenberg_marquardt;
mod minpack;
mod nelder_mead;
mod newton_trust_region;
mod nonlinear_cg;
mod null_space;
mod particle_swarm;
mod simulated_annealing;
mod trust_region;

pub use argmin_trust_region::ArgminTrustRegion;
pub use augmented_lagrangian::Penalised;
pub use basin::{Basin, BasinMethod};
pub use bfgs::{Bfgs, LineSearch};
pub use clarabel::{Clarabel, ConeProblem, ConeStep};
pub use gauss_newton::GaussNewton;
pub use global::{BasinHopping, Inner, MultiStart, Scatter, StartGenerator};
pub use l_bfgs::LBfgs;
pub use levenberg_marquardt::{Damping, LevenbergMarquardt};
pub use minpack::Minpack;
pub use nelder_mead::NelderMead;
pub use newton_trust_region::NewtonTrustRegion;
pub use nonlinear_cg::NonlinearCg;
pub use null_space::NullSpaceGaussNewton;
pub use particle_swarm::ParticleSwarm;
pub use simulated_annealing::SimulatedAnnealing;
pub use trust_region::{RegionStep, TrustRegion};

/// All solvers, in the order of lists.
pub const ALL: &[&SolverEntry] = &[
    &gauss_newton::ENTRY,
    &levenberg_marquardt::ENTRY,
    &trust_region::ENTRY,
    &newton_trust_region::ENTRY,
    &null_space::ENTRY,
    &clarabel::ENTRY,
    &augmented_lagrangian::AUGMENTED,
    &augmented_lagrangian::PENALTY,
    &minpack::ENTRY,
    &bfgs::ENTRY,
    &l_bfgs::ENTRY,
    &nonlinear_cg::ENTRY,
    &argmin_trust_region::ENTRY,
    &nelder_mead::ENTRY,
    &particle_swarm::ENTRY,
    &simulated_annealing::ENTRY,
    &basin::ENTRY,
    &global::MULTI_START,
    &global::BASIN_HOPPING,
];

/// Build a solver from `name` or `name[key=value,...]` out of [`ALL`].
///
/// # Errors
/// [`EntryError`] for a text that cannot be read, an unknown name (with the nearest ones), an unknown parameter or a value
/// that cannot be used.
///
/// ```
/// use cfpose_optim::solvers;
/// assert_eq!(solvers::build("levenberg-marquardt[damping=nielsen]").unwrap().name(), "levenberg-marquardt");
/// let error = solvers::build("levenberg-marquard").err().unwrap();
/// assert!(error.to_string().contains("did you mean levenberg-marquardt?"), "{error}");
/// ```
pub fn build(text: &str) -> Result<Box<dyn Solver>, EntryError> {
    build_from(ALL, text)
}
