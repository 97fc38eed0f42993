//! From a reference and a frame to a transformation: the stages of docs/vision.md, one file each.
//!
//! [`Pattern`] is a reference made ready, [`View`] a segmented frame, [`Registrar`] joins a model with both cameras.
//! [`Registrar::register`] runs all stages; each of them can be called alone: [`Registrar::by_moments`], [`Registrar::by_contour`],
//! [`Registrar::quality`].

mod backward;
mod bend;
mod edges;
mod fit;
mod follow;
mod grey_hunt;
mod greys;
mod hunt;
mod joint;
mod mapper;
mod moments;
mod pattern;
mod periods;
mod predicted;
mod problem;
mod quality;
mod registrar;
mod seen;
mod sight;
mod starts;
mod tilts;
mod verdict;
mod view;
mod whitened;

pub use fit::{ContourFit, Schedule};
pub use follow::Missed;
pub use greys::Greys;
pub use pattern::{Outline, Pattern};
pub use quality::Quality;
pub use registrar::{Registered, Registrar, RegistrarError, Rival};
pub use sight::{Shown, Sight};
pub use verdict::FrameVerdict;
pub use view::View;
