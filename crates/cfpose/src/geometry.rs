//! Poses and what they are made of: layouts of theta, free parameters and bounds, homographies, small linear algebra.

pub mod bounds;
pub(crate) mod centred;
pub mod free;
pub mod homography;
pub(crate) mod linalg;
pub mod pose;
pub mod theta;
