//! The error type of the library.

use cfpose_kernel::points::PointsError;

use crate::entry::BuildError;
use crate::geometry::theta::ThetaError;

/// One of the two point sets.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// P, the points that are mapped.
    Source,
    /// Q, the points that they are compared with.
    Target,
}

impl std::fmt::Display for Side {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Side::Source => "source",
            Side::Target => "target",
        })
    }
}

/// Everything that can go wrong before or around an estimate; not converging is a status, not an error.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A name, parameter or the data an entry is built from.
    #[error(transparent)]
    Build(#[from] BuildError),
    /// A point set.
    #[error("{side} points: {problem}")]
    Points {
        /// Which set.
        side: Side,
        /// What is wrong.
        problem: PointsError,
    },
    /// The dimension of a point set does not fit the model.
    #[error(
        "{side} points have {found} coordinates, model `{model}` takes {expected}; give points of {expected}, or a model for {found}"
    )]
    PointDimension {
        /// Which set.
        side: Side,
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
    /// The points of a side do not allow what was asked for.
    #[error("{problem}")]
    Data {
        /// Which set.
        side: Side,
        /// What is missing.
        problem: String,
    },
    /// Misuse of a solver.
    #[error(transparent)]
    Solve(#[from] cfpose_optim::SolveError),
    /// A choice that does not apply to this model.
    #[error("{0}")]
    Unsupported(String),
}
