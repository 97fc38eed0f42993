//! The error type of the library.

use cfpose_kernel::points::PointsError;

use crate::entry::BuildError;
use crate::geometry::theta::ThetaError;

/// Everything that can go wrong before or around an estimate; not converging is a status, not an error.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Error {
    /// A name, parameter or the data an entry is built from.
    #[error(transparent)]
    Build(#[from] BuildError),
    /// A point set.
    #[error("{side} points: {problem}")]
    Points {
        /// `source` or `target`.
        side: &'static str,
        /// What is wrong.
        problem: PointsError,
    },
    /// The dimension of a point set does not fit the model.
    #[error("{side} points have {found} coordinates, model `{model}` takes {expected}")]
    PointDimension {
        /// `source` or `target`.
        side: &'static str,
        /// Name of the model.
        model: String,
        /// What the model takes, in words.
        expected: String,
        /// Coordinates found.
        found: usize,
    },
    /// A theta.
    #[error("{0}")]
    Theta(#[from] ThetaError),
    /// Fewer features than unknowns.
    #[error(
        "{features} feature function(s) cannot determine {unknowns} unknowns; use a larger family or fix parameters"
    )]
    TooFewFeatures {
        /// Number of features.
        features: usize,
        /// Number of unknowns.
        unknowns: usize,
    },
    /// The feature coordinates cannot be normalised.
    #[error("normaliser `{name}`: {problem}")]
    Normalise {
        /// Name of the normaliser.
        name: &'static str,
        /// What is wrong.
        problem: String,
    },
    /// Misuse of a solver.
    #[error(transparent)]
    Solve(#[from] cfpose_optim::SolveError),
    /// A choice that does not apply to this model.
    #[error("{0}")]
    Unsupported(String),
}
