//! Sums of author-written functions over points, with derivatives, on SIMD lanes.
//!
//! A map takes points into a feature space, a family gives functions there, and [`means`] adds the functions and their
//! derivatives along theta over all points. Both are written once over [`Scalar`]; derivatives come from automatic
//! differentiation. The crate knows no pose, no solver and no table of names.
//!
//! * [`author`]: what an author of a map writes ([`Map`], [`PointMap`]); [`family`]: what an author of feature functions writes.
//! * [`scalar`], [`lane`], [`jet`], [`isa`]: the numbers they compute with.
//! * [`points`]: weighted point sets; [`map`]: maps, erased per block of points.
//! * [`means`]: the hot loop; [`moments`]: polynomial features of an affine map, for which the points are read once.

pub mod author;
pub mod family;
pub mod isa;
pub mod jet;
pub mod lane;
pub mod map;
pub mod means;
pub mod moments;
pub mod points;
pub mod scalar;

pub use author::{Map, PointMap};
pub use family::{Family, SeparableFamily};
pub use isa::Isa;
pub use jet::Jet;
pub use lane::Lane;
pub use means::Execution;
pub use points::{Attribute, Points, PointsError};
pub use scalar::Scalar;
