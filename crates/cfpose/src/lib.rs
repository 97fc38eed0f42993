//! Correspondence-free pose estimation by matching means of feature functions.
//!
//! Given two point sets and no matches between them, find theta with h(p_k, theta) = q_c(k) for an unknown c by matching
//! means of feature functions: sums do not care about order (Quan and Dai, arXiv 2503.00051).
//!
//! * [`model`]: what an author of a transformation writes; [`models`]: the table.
//! * [`family`]: what an author of feature functions writes; [`families`]: the table.
//! * [`means`]: the hot loop; [`problem`]: residual and Jacobian; [`estimator`]: from names to an estimate.
//! * [`statistics`], [`distances`]: how sure an estimate is, and what is done about outliers.
//! * [`registry`]: add your own entries and use every tool with them.
//!
//! The library opens no file, reads no clock, starts no thread and has no global state.

pub mod check;
pub mod coverage;
pub mod criteria;
pub mod distances;
pub mod entry;
pub mod error;
pub mod estimator;
pub mod families;
pub mod geometry;
pub mod model;
pub mod models;
pub mod problem;
pub mod registry;
pub mod start;
pub mod statistics;
pub mod streams;

pub use cfpose_kernel::{isa, jet, lane, map as block, means, moments, points, scalar};
pub use distances::correspondence as readout;
pub use geometry::{free, homography, pose, theta};
pub use problem::normalise;
pub use statistics::{conditioning, gram, weighting};

/// Feature families: what their authors write, and the line that each has in the table.
pub mod family {
    pub use cfpose_kernel::family::*;

    pub use crate::entry::{BuildFamily, FamilyEntry};
}

/// Distances between points under their earlier name.
pub mod robust {
    pub use crate::distances::{closest_point, mixture};

    /// Support of a fit by nearest neighbours, and how the two sets were sampled.
    pub mod support {
        pub use crate::distances::sampling::Sampling;
        pub use crate::distances::support::Support;
    }
}

pub use cfpose_kernel::{
    Attribute, Execution, Family, Isa, Jet, Lane, Map, PointMap, Points, PointsError, Scalar, SeparableFamily,
};
pub use criteria::Criteria;
pub use entry::{BuildContext, BuildError, FamilyEntry};
pub use error::Error;
pub use estimator::{Estimate, Estimator, Settings, Start, Supervision, Verdict, estimate};
pub use geometry::pose::{Pose, PoseError};
pub use model::{Findings, Model, ModelEntry, Scene};
pub use problem::MomentProblem;
pub use registry::Registry;

/// The walk-throughs of the documentation, compiled and run as tests.
#[cfg(doctest)]
mod walk_throughs {
    #[doc = include_str!("../../../docs/adding/model.md")]
    struct Model;
    #[doc = include_str!("../../../README.md")]
    struct Readme;
    #[doc = include_str!("../../../docs/adding/family.md")]
    struct Family;
    #[doc = include_str!("../../../docs/adding/weighting.md")]
    struct Weighting;
}
