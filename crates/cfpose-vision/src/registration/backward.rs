//! From pixels of a frame back to pixels of the reference.

use cfpose::homography::{apply, in_file_units};

use super::pattern::Pattern;
use super::quality::invert;
use super::sight::Sight;
use crate::camera::{Camera, Lens};

/// The way back under one theta: one homography between pixels where both cameras are without a lens, else through both lenses.
pub(super) struct Backward {
    direct: Option<[f64; 9]>,
    inverse: [f64; 9],
    reference: Camera,
    frame: Camera,
}

impl Backward {
    /// Invert the homography between the planes z = 1; `None` where it has no inverse.
    pub fn new(matrix: &[f64; 9], pattern: &Pattern, view: &Sight) -> Option<Self> {
        let inverse = invert(matrix)?;
        let (reference, frame) = (pattern.camera, view.camera);
        let plain = [&reference, &frame].iter().all(|camera| camera.lens() == Lens::None);
        let direct =
            plain.then(|| in_file_units(&inverse, Some(&frame.intrinsics()), Some(&reference.intrinsics()))).flatten();
        Some(Self { direct, inverse, reference, frame })
    }

    /// Return the pixel of the reference that is seen at a pixel of the frame; `None` where the frame's lens shows nothing.
    #[inline]
    pub fn at(&self, pixel: [f64; 2]) -> Option<[f64; 2]> {
        match &self.direct {
            Some(matrix) => Some(apply(matrix, pixel)),
            None => Some(self.reference.pixel_of(apply(&self.inverse, self.frame.place_of(pixel)?))),
        }
    }
}
