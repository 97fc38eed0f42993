//! How sure an estimate is: covariance and J, weightings, conditioning, what a family sees of given points.

pub mod conditioning;
mod covariance;
pub mod gram;
pub mod weighting;

pub use covariance::{Randomness, Statistics, chi_square_tail, feature_covariance};
pub(crate) use covariance::{deviation, deviation_of, of_whitened};
