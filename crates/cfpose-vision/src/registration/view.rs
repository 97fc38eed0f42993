//! A frame made ready.

use std::sync::Arc;

use cfpose::{Points, PointsError};

use super::greys;
use super::pattern::{steps, weighted};
use super::seen::Visibility;
use super::sight::{ALIKE, Shown, Sight};
use crate::camera::Camera;
use crate::raster::Raster;
use crate::segment::Segmentation;

/// A segmented frame: as the contour sees it, and weighted points of its region.
#[derive(Debug, Clone)]
pub struct View {
    sight: Sight,
    /// Coverage that is not cut off at 0 and 1.
    unbounded: Raster,
    /// Missing share of the background's light, and its noise.
    darkness: (Raster, f64),
    /// Sum of the coverage, pixels.
    pub area: f64,
    /// Points, coarse and fine, as [`super::Pattern::points`].
    pub points: [Points; 2],
    /// What the frame can show, and the points that count as far as they are seen; none where the region ends within the frame and nothing
    /// hides it.
    pub partly: Option<(Arc<Visibility>, [Points; 2])>,
    /// Whether something hides parts of the frame.
    pub hidden: bool,
}

impl std::ops::Deref for View {
    type Target = Sight;

    fn deref(&self) -> &Sight {
        &self.sight
    }
}

impl View {
    /// Make a segmented frame ready.
    ///
    /// # Errors
    /// [`PointsError`] where the camera shows nothing at a pixel of the region.
    pub fn new(segmentation: &Segmentation, camera: Camera) -> Result<Self, PointsError> {
        let coverage = &segmentation.coverage;
        let (w, h) = (coverage.width(), coverage.height());
        let area: f64 = coverage.values().iter().map(|v| f64::from(*v)).sum();
        let sides = steps(area);
        let points = [weighted(coverage, camera, sides[0])?, weighted(coverage, camera, sides[1])?];
        let hidden = segmentation.others.as_deref();
        let at_border = touches_border(coverage);
        let partly = if hidden.is_some() || at_border {
            let visibility = Visibility::new(hidden, w, h, camera);
            let seen = Raster::from_fn(w, h, |x, y| coverage.at(x, y) * visibility.at_pixel(x as f64, y as f64) as f32);
            let points = [weighted(&seen, camera, sides[0])?, weighted(&seen, camera, sides[1])?];
            Some((Arc::new(visibility), points))
        } else {
            None
        };
        let without_hidden = |mut field: Raster| {
            if let Some(hidden) = hidden {
                field.values_mut().iter_mut().zip(hidden).filter(|(_, h)| **h).for_each(|(v, _)| *v = f32::NAN);
            }
            field
        };
        let field = without_hidden(coverage.clone());
        let unbounded = without_hidden(segmentation.unbounded.clone());
        let shift = if segmentation.overexposed { OVEREXPOSED } else { 0.0 };
        let noise = f64::from(segmentation.noise);
        let sight = Sight { field: Shown::All(field), alike: ALIKE, shift, camera, noise, pixel_noise: noise };
        let darkness = (greys::darkness(segmentation), f64::from(greys::noise(segmentation)));
        Ok(Self { sight, unbounded, darkness, area, points, partly, hidden: hidden.is_some() })
    }
}

impl View {
    /// Return the frame with a smoothed field: for a last fit where noise moves edges more than the smoothing bends them.
    #[must_use]
    pub fn smoothed(&self, deviation: f64) -> Self {
        // White noise under a Gaussian s: 1 / (2 sqrt(pi) s) of its deviation, alike over 2 sqrt(pi) s along a line.
        let kept = 0.282 / deviation;
        let field = self.unbounded.gaussian(deviation);
        let (noise, alike) = (self.noise * kept.min(1.0), (3.54 * deviation).max(self.alike));
        let shown = if self.field.is_greys() { Shown::Greys(field.clone()) } else { Shown::All(field.clone()) };
        let sight = Sight { field: shown, noise, alike, ..self.sight.clone() };
        Self { sight, unbounded: field, ..self.clone() }
    }

    /// Return the frame as the steps between greys see it: nothing is taken for an occluder.
    #[must_use]
    pub(super) fn of_greys(&self) -> Self {
        let (field, noise) = &self.darkness;
        // Noise that would reach the tolerance beside an edge is smoothed.
        let smooth = *noise > NOISY;
        let field = if smooth { field.smoothed() } else { field.clone() };
        let (noise, alike) = if smooth { (0.28 * noise, 3.5) } else { (*noise, ALIKE) };
        let sight = Sight { field: Shown::Greys(field.clone()), noise, alike, ..self.sight.clone() };
        Self { sight, unbounded: field, partly: None, hidden: false, ..self.clone() }
    }

    /// Return the missing share of the background's light, and its noise.
    pub(super) fn darkness(&self) -> &(Raster, f64) {
        &self.darkness
    }

    /// Return the field of profiles across the contour: not cut off at 0 and 1.
    pub(super) fn profiles(&self) -> &Raster {
        &self.unbounded
    }
}

/// Noise of the darkness from which greys are smoothed before their steps are searched.
const NOISY: f64 = 0.02;

/// Shift of the edges of an over-exposed frame, pixels.
const OVEREXPOSED: f64 = 0.05;

/// Say whether a region reaches the frame's border.
fn touches_border(coverage: &Raster) -> bool {
    let (w, h) = (coverage.width(), coverage.height());
    let inside = |v: f32| v > 0.5;
    let rows = [0, 1, h - 2, h - 1].into_iter().any(|y| coverage.row(y).iter().any(|v| inside(*v)));
    rows || (0..h).any(|y| [0, 1, w - 2, w - 1].into_iter().any(|x| inside(coverage.at(x, y))))
}
