//! Training of feature functions for the family `learned`.
//!
//! A training is data ([`Config`]): scenarios of the laboratory that draw trials, objectives, a schedule. States (thetas about the truth
//! and along the paths of the present family) are sampled once; [`train()`] minimises the mean of the objectives over them and
//! returns [`Weights`](cfpose::families::learned::Weights).
//!
//! * [`objective`]: what an author of an objective writes; [`objectives`]: the table.
//! * [`vary`]: parameters of scenarios that vary from trial to trial, and which seeds training, validation and tests take.
//! * docs/adding/learned.md: train your own.
//!
//! The crate never parses arguments.

mod adam;
mod checkpoint;
mod config;
mod error;
mod l_bfgs;
mod learner;
mod linear;
mod normal;
pub mod objective;
pub mod objectives;
mod perturb;
mod ridge;
mod rounds;
mod sample;
mod train;
pub mod vary;

pub use checkpoint::write;
pub use config::{Config, Kind};
pub use error::LearnError;
pub use normal::{Normal, Shape};
/// The numbers that an objective is written over.
pub use num_dual::DualNumCopy;
pub use rounds::Progress;
pub use train::{Options, train};

#[cfg(doctest)]
#[doc = include_str!("../../../docs/adding/learned.md")]
mod adding_learned {}
