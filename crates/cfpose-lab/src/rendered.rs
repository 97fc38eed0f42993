//! Pairs of rendered images with a known pose: what `cfpose cells` measures the registration on.
//!
//! A cell is a condition (tilt, noise, blur, what is hidden); a trial draws a shape, a pose and the images from the cell's name, the seed
//! and its number alone.

mod cells;
mod measure;
mod scene;
mod sequence;
mod shapes;

pub use cells::{CELLS, RenderedCell};
pub use measure::{RenderedRow, RenderedSummary, measure, measure_one, summarise};
pub use scene::{Hidden, RenderedTrial, draw, draw_from};
pub use sequence::{
    DrawnSequence, RenderedSequence, SEQUENCES, SequenceSummary, draw_sequence, measure_sequence, prepare_sequence,
};
