//! How well a theta explains a frame.

use super::backward::Backward;
use super::pattern::Pattern;
use super::registrar::{Outlined, Registrar};
use super::sight::Sight;
use super::view::View;
use cfpose_optim::manifold::determinant3;

/// Edges within this distance belong to the contour, pixels.
const INLIER: f64 = 1.5;

/// How well a theta explains a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quality {
    /// Share of the visible contour that has an edge of the right polarity within 1.5 pixels.
    pub share: f64,
    /// Share of the whole contour that lies in the frame where nothing is known to hide it.
    pub visible: f64,
    /// Longest piece of the contour without such an edge, as a share of the whole.
    pub gap: f64,
    /// Median distance of these edges, pixels.
    pub median: f64,
    /// Root mean square of the distances of these edges, pixels.
    pub rms: f64,
    /// Expected standard deviation of one edge by noise, frame and reference, pixels.
    pub expected: f64,
    /// Standard deviation of the blur across the contour, pixels.
    pub blur: f64,
    /// Share of the frame's region that the mapped reference explains.
    pub frame_explained: f64,
    /// Share of the mapped reference, where visible, that the frame's region explains.
    pub reference_explained: f64,
}

impl Quality {
    /// Nothing fits.
    pub const NONE: Self = Self {
        share: 0.0,
        visible: 0.0,
        gap: 1.0,
        median: f64::INFINITY,
        rms: f64::INFINITY,
        expected: 0.0,
        blur: 0.0,
        frame_explained: 0.0,
        reference_explained: 0.0,
    };

    /// Return the number by which candidates are compared: higher is better.
    pub fn score(&self) -> f64 {
        self.share + self.frame_explained.max(self.reference_explained) - 2.0 * self.median.min(1.0)
    }

    /// Return the larger share of a region that the other one explains.
    pub fn one_sided(&self) -> f64 {
        self.frame_explained.max(self.reference_explained)
    }
}

impl Registrar {
    /// Measure how well a theta explains a frame.
    pub fn quality(&self, pattern: &Pattern, view: &View, theta: &[f64]) -> Quality {
        match self.outlined(pattern) {
            Ok(outlined) => self.quality_of(&outlined, pattern, view, theta),
            Err(_) => Quality::NONE,
        }
    }

    pub(super) fn quality_of(&self, outlined: &Outlined, pattern: &Pattern, view: &Sight, theta: &[f64]) -> Quality {
        let Some(found) = self.search(outlined, view, theta, 3.0) else { return Quality::NONE };
        let count = found.visible.len() as f64;
        let visible = found.visible.iter().filter(|v| **v).count() as f64;
        let inliers: Vec<usize> =
            (0..found.visible.len()).filter(|i| found.visible[*i] && found.distances[*i].abs() < INLIER).collect();
        if inliers.is_empty() {
            return Quality { visible: visible / count, ..Quality::NONE };
        }
        let mut sizes: Vec<f32> = inliers.iter().map(|i| found.distances[*i].abs() as f32).collect();
        let mut slopes: Vec<f32> = inliers.iter().map(|i| found.slopes[*i] as f32).collect();
        let square = inliers.iter().map(|i| found.distances[*i].powi(2)).sum::<f64>() / inliers.len() as f64;
        let slope = f64::from(crate::segment::median(&mut slopes).unwrap_or(1.0)).max(1e-3);
        let [frame_explained, reference_explained] = self.overlap(pattern, view, theta).unwrap_or([0.0; 2]);
        Quality {
            share: inliers.len() as f64 / visible.max(1.0),
            visible: visible / count,
            gap: longest_gap(&inliers, found.visible.len()),
            median: f64::from(crate::segment::median(&mut sizes).unwrap_or(f32::INFINITY)),
            rms: square.sqrt(),
            // A sample between pixels, and two of them, have .75 of the noise of one pixel.
            expected: 0.75 * (view.noise / slope).hypot(pattern.outline.deviation),
            // The slope of a blurred step is 1 / (sqrt(2 pi) deviation).
            blur: 0.399 / slope,
            frame_explained,
            reference_explained,
        }
    }

    /// Return the share of the frame's region that the mapped reference explains, and the other way, where the frame shows anything.
    fn overlap(&self, pattern: &Pattern, view: &Sight, theta: &[f64]) -> Option<[f64; 2]> {
        let backward = Backward::new(&(self.homography)(theta), pattern, view)?;
        let (mut both, mut frame, mut reference) = (0.0, 0.0, 0.0);
        let stride = view.field.stride();
        let (w, h) = (view.field.width(), view.field.height());
        for y in (4..h.saturating_sub(4)).step_by(stride) {
            for x in (4..w.saturating_sub(4)).step_by(stride) {
                let seen = view.field.at(x, y);
                if seen.is_nan() {
                    continue;
                }
                let Some(place) = backward.at([x as f64, y as f64]) else { continue };
                let mapped = pattern.coverage.sample(place[0], place[1]).unwrap_or(0.0);
                both += seen.min(mapped);
                frame += seen;
                reference += mapped;
            }
        }
        Some([both / frame.max(1.0), both / reference.max(1.0)])
    }
}

/// Return the longest run of places that are not listed, around the contour, as a share of all.
fn longest_gap(listed: &[usize], count: usize) -> f64 {
    let around = listed.first().map_or(count, |first| first + count - listed[listed.len() - 1] - 1);
    let longest = listed.windows(2).map(|pair| pair[1] - pair[0] - 1).fold(around, usize::max);
    longest as f64 / count.max(1) as f64
}

/// Return the inverse of a matrix up to a factor.
pub(super) fn invert(m: &[f64; 9]) -> Option<[f64; 9]> {
    let determinant = determinant3(m);
    let cofactor = |i: usize, j: usize| {
        let at = |r: usize, c: usize| m[3 * ((r) % 3) + (c) % 3];
        at(i + 1, j + 1) * at(i + 2, j + 2) - at(i + 1, j + 2) * at(i + 2, j + 1)
    };
    let mut out = [0.0; 9];
    for i in 0..3 {
        for j in 0..3 {
            out[3 * j + i] = cofactor(i, j) / determinant;
        }
    }
    out.iter().all(|v| v.is_finite()).then_some(out)
}
