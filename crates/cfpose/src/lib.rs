//! Correspondence-free pose estimation by matching means of feature functions.
//!
//! Given two point sets and no matches between them, find theta with h(p_k, theta) = q_c(k) for an unknown c by matching
//! means of feature functions: sums do not care about order (Quan and Dai, arXiv 2503.00051).
//!
//! * [`model`]: what an author of a transformation writes; [`models`]: the table.
//! * [`family`]: what an author of feature functions writes; [`families`]: the table.
//! * [`means`]: the hot loop; [`problem`]: residual and Jacobian; [`estimator`]: from names to an estimate.
//! * [`statistics`], [`distances`]: how sure an estimate is, and what is done about outliers.
//! * [`from_moments`]: estimates from sums over the points alone, gathered in parts on any machines.
//! * [`Registry`]: add your own entries and use every tool with them.
//!
//! The library opens no file, reads no clock, starts no thread and has no global state.

pub mod check;
pub mod coverage;
mod criteria;
pub mod distances;
pub mod entry;
mod error;
pub mod estimator;
pub mod families;
mod geometry;
pub mod model;
pub mod models;
pub mod problem;
mod registry;
pub mod start;
pub mod statistics;
mod streams;

// For a user: two point sets to an estimate.
pub use cfpose_kernel::{Attribute, Execution, Isa, Points, PointsError};
pub use criteria::Criteria;
pub use error::{Error, Side};
pub use estimator::{
    Estimate, Estimator, Prior, PriorReport, Settings, Start, Supervision, Verdict, estimate, from_moments,
};
pub use geometry::pose::{Pose, PoseError};
pub use geometry::{bounds, free, homography, theta};
pub use registry::Registry;

// For an author of a model.
pub use cfpose_kernel::{Jet, Lane, Map, PointMap, Scalar, map as block};
pub use entry::{BuildContext, BuildError};
pub use model::{Findings, Model, ModelEntry, Scene};

// For an author of a family, and who looks at the sums themselves.
pub use cfpose_kernel::{Family, SeparableFamily, means, moments};
pub use entry::FamilyEntry;
pub use problem::MomentProblem;

// For an author of a weighting, a normaliser.
pub use problem::normalise;
pub use statistics::weighting;

/// Feature families: what their authors write, and the line that each has in the table.
pub mod family {
    pub use cfpose_kernel::family::*;

    pub use crate::entry::{BuildFamily, FamilyEntry};
}

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
