//! Correspondence-free pose estimation by matching means of feature functions.
//!
//! Given two point sets and no matches between them, find theta with h(p_k, theta) = q_c(k) for an unknown c by matching
//! means of feature functions: sums do not care about order (Quan and Dai, arXiv 2503.00051).
//!
//! * [`model`]: what an author of a transformation writes; [`models`]: the table.
//! * [`family`]: what an author of feature functions writes; [`families`]: the table.
//! * [`means`]: the hot loop; [`problem`]: residual and Jacobian; [`estimator`]: from names to an estimate.
//! * [`statistics`], [`weighting`], [`robust`]: how sure an estimate is, and what is done about outliers.
//! * [`entry::Registry`]: add your own entries and use every tool with them.
//!
//! The library opens no file, reads no clock, starts no thread and has no global state.

pub mod check;
pub mod conditioning;
pub mod coverage;
pub mod entry;
pub mod error;
pub mod estimator;
pub mod families;
pub mod family;
pub mod free;
pub mod gram;
pub mod homography;
mod linalg;
pub mod model;
pub mod models;
mod neighbours;
pub mod normalise;
pub mod points;
pub mod pose;
pub mod problem;
pub mod readout;
pub mod robust;
pub mod start;
pub mod statistics;
pub mod theta;
pub mod weighting;

pub use cfpose_kernel::{isa, jet, lane, map as block, means, moments, scalar};

pub use entry::{BuildContext, BuildError, Registry};
pub use error::Error;
pub use estimator::{Estimate, Prepared, Settings, Start, Supervision, Verdict, estimate};
pub use family::{Family, FamilyEntry, SeparableFamily};
pub use isa::Isa;
pub use jet::Jet;
pub use lane::Lane;
pub use means::Execution;
pub use model::{Findings, Map, Model, ModelEntry, PointMap, Scene};
pub use points::{Attribute, Points, PointsError};
pub use pose::{Pose, PoseError};
pub use problem::MomentProblem;
pub use scalar::Scalar;

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
