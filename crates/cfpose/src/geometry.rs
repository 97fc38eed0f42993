//! Poses and what they are made of: layouts of theta, free parameters, homographies, small linear algebra.

pub(crate) mod centred;
pub mod free;
pub mod homography;
pub(crate) mod linalg;
pub mod pose;
pub mod theta;
