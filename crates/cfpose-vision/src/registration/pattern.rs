//! A reference made ready: weighted points of its region, and its outline.

use cfpose::{Points, PointsError};

use super::edges::{self, Levels};
use super::greys::Greys;
use super::periods::periods;
use crate::camera::Camera;
use crate::contours::contours_of;
use crate::options::Foreground;
use crate::raster::Raster;
use crate::segment::{SegmentOptions, Segmentation};

/// About this many points stand for the outline.
const OUTLINE: f64 = 360.0;

/// Contours shorter than this are left out, pixels.
const SHORTEST: f64 = 16.0;

/// Places of a contour in the image plane of the reference, with what lies on both sides.
#[derive(Debug, Clone)]
pub struct Outline {
    /// Places, x and y on the plane z = 1 of the reference.
    pub places: Vec<[f64; 2]>,
    /// Places one pixel further along the contour.
    pub ahead: Vec<[f64; 2]>,
    /// Values of the field inside and outside.
    pub levels: Vec<Levels>,
    /// Distance between neighbours, pixels of the reference.
    pub spacing: f64,
    /// Standard deviation of a place across the contour by the reference's own noise, pixels.
    pub deviation: f64,
}

/// A reference made ready, once for many frames.
#[derive(Debug, Clone)]
pub struct Pattern {
    /// Coverage of the reference.
    pub coverage: Raster,
    /// Its camera.
    pub camera: Camera,
    /// Outline of the region.
    pub outline: Outline,
    /// Level of the pattern as a share of its background; `None` for a design, whose print is not known.
    pub level: Option<f32>,
    /// Whether it is darker than its background.
    pub dark: bool,
    /// Sum of the coverage, pixels.
    pub area: f64,
    /// Its greys where it has several; `None` for one of one grey, and for a design.
    pub greys: Option<Greys>,
    /// Shifts on the plane z = 1 under which most of its outline falls on itself.
    pub periods: Vec<[f64; 2]>,
    /// Places in the middle of blocks of pixels and their coverage, coarse and fine.
    pub points: [Points; 2],
}

impl Pattern {
    /// Make a segmented reference ready.
    ///
    /// # Errors
    /// [`PointsError`] where the camera shows nothing at a pixel of the pattern, or no contour is long enough.
    pub fn new(segmentation: &Segmentation, camera: Camera) -> Result<Self, PointsError> {
        let of_image = Self::drawn(segmentation.coverage.clone(), segmentation.noise, camera)?;
        let greys = Greys::of(segmentation, camera);
        Ok(Self { level: Some(segmentation.level), dark: segmentation.dark, greys, ..of_image })
    }

    /// Return how a frame is segmented: beside what the user says, the pattern has the level and the side of the background that it has on
    /// the reference. Of a design neither is known.
    pub fn look(&self, given: &SegmentOptions) -> SegmentOptions {
        let Some(level) = self.level else { return *given };
        let side = if self.dark { Foreground::Dark } else { Foreground::Bright };
        let foreground = if given.foreground == Foreground::Auto { side } else { given.foreground };
        SegmentOptions { level: Some(level), find_others: true, foreground, ..*given }
    }

    /// Make a drawn reference ready: the share of a dark pattern in each pixel, and the standard deviation of its noise.
    ///
    /// # Errors
    /// As [`Pattern::new`].
    pub fn drawn(coverage: Raster, noise: f32, camera: Camera) -> Result<Self, PointsError> {
        let area: f64 = coverage.values().iter().map(|v| f64::from(*v)).sum();
        let outline = outline(&coverage, camera, noise)?;
        let steps = steps(area);
        let points = [weighted(&coverage, camera, steps[0])?, weighted(&coverage, camera, steps[1])?];
        let periods = periods(&outline, camera.focal());
        Ok(Self { periods, coverage, camera, outline, level: None, dark: true, area, greys: None, points })
    }
}

/// Sides of the blocks, coarse and fine, of a region of an area in pixels: about 1500 and 6000 of them.
pub(super) fn steps(area: f64) -> [usize; 2] {
    let side = |count: f64| ((area / count).sqrt().floor() as usize).clamp(1, 64);
    [side(1400.0), side(5600.0)]
}

/// Trace the outline, and move it onto the edges that the search finds on the reference itself: a bias of the search is then the same
/// on both sides.
fn outline(coverage: &Raster, camera: Camera, noise: f32) -> Result<Outline, PointsError> {
    let contours: Vec<_> = contours_of(coverage, 0.5).into_iter().filter(|c| c.length() >= SHORTEST).collect();
    let total: f64 = contours.iter().map(|contour| contour.length()).sum();
    let spacing = (total / OUTLINE).clamp(1.0, 12.0);
    let (mut pixels, mut ahead, mut slopes) = (Vec::new(), Vec::new(), Vec::new());
    for (place, along) in contours.iter().flat_map(|contour| contour.resampled(spacing)) {
        let normal = [along[1], -along[0]];
        let Some(edge) = edges::nearest(coverage, place, normal, 3.0, Levels::COVERAGE) else { continue };
        let moved = [place[0] + edge.distance * normal[0], place[1] + edge.distance * normal[1]];
        pixels.push(moved);
        ahead.push([moved[0] + along[0], moved[1] + along[1]]);
        slopes.push(edge.slope);
    }
    if pixels.len() < 12 {
        return Err(PointsError::TooFew { needed: 12, found: pixels.len() });
    }
    let on_plane = |places: &[[f64; 2]]| normalised(camera, places);
    let slope = crate::segment::median(&mut slopes.iter().map(|s| *s as f32).collect::<Vec<_>>()).unwrap_or(1.0);
    Ok(Outline {
        places: on_plane(&pixels)?,
        ahead: on_plane(&ahead)?,
        levels: vec![Levels::COVERAGE; pixels.len()],
        spacing,
        deviation: f64::from(noise) / f64::from(slope).max(1e-3),
    })
}

/// Return places of the plane z = 1.
pub(super) fn normalised(camera: Camera, pixels: &[[f64; 2]]) -> Result<Vec<[f64; 2]>, PointsError> {
    let points = camera.normalise(&Points::from_rows(pixels)?)?;
    Ok((0..points.len()).map(|k| [points.column(0)[k], points.column(1)[k]]).collect())
}

/// Return blocks of pixels as points of the plane z = 1: the centroid of what is covered, weighted by it and by the area that a pixel has
/// on that plane (which a lens changes from place to place).
pub(super) fn weighted(coverage: &Raster, camera: Camera, step: usize) -> Result<Points, PointsError> {
    let (mut places, mut weights) = (Vec::new(), Vec::new());
    for top in (0..coverage.height()).step_by(step) {
        for left in (0..coverage.width()).step_by(step) {
            let mut sums = [0.0f64; 3];
            for y in top..(top + step).min(coverage.height()) {
                let row = &coverage.row(y)[left..(left + step).min(coverage.width())];
                for (x, value) in row.iter().enumerate().filter(|(_, value)| **value > 0.0) {
                    let value = f64::from(*value);
                    sums[0] += value;
                    sums[1] += value * (left + x) as f64;
                    sums[2] += value * y as f64;
                }
            }
            if sums[0] > 0.02 {
                places.push([sums[1] / sums[0], sums[2] / sums[0]]);
                weights.push(sums[0]);
            }
        }
    }
    if places.is_empty() {
        return Err(PointsError::Empty);
    }
    let plane = normalised(camera, &places)?;
    if camera.lens() != crate::camera::Lens::None {
        let shifted = |dx: f64, dy: f64| -> Result<Vec<[f64; 2]>, PointsError> {
            normalised(camera, &places.iter().map(|p| [p[0] + dx, p[1] + dy]).collect::<Vec<_>>())
        };
        let (right, down) = (shifted(1.0, 0.0)?, shifted(0.0, 1.0)?);
        for (k, weight) in weights.iter_mut().enumerate() {
            let (a, b, c) = (plane[k], right[k], down[k]);
            let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
            *weight *= area.abs() * camera.focal().powi(2);
        }
    }
    let columns = (0..2).map(|d| plane.iter().map(|p| p[d]).collect()).collect();
    Points::weighted(columns, weights)
}
