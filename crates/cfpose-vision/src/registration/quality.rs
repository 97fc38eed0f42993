//! How well a theta explains a frame.

use super::backward::Backward;
use super::edges::Levels;
use super::fit::Found;
use super::greys::Greys;
use super::pattern::Pattern;
use super::registrar::{Outlined, Registrar};
use super::sight::Sight;
use super::verdict::FLOOR;
use super::view::View;
use cfpose_optim::manifold::determinant3;

/// Edges within this distance belong to the contour, pixels.
const INLIER: f64 = 1.5;

/// Median distance of edges, as a share of the deviation that is expected and per squared deviation of the blur, from which it is too far.
const SETTLED: f64 = 0.95;
const BLURRED: f64 = 0.003;

/// Ratio of median distances from which one theta is nearer than another.
const CLEARLY: f64 = 0.9;

/// How well a theta explains a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quality {
    /// Share of the visible contour that has an edge of the right polarity within 1.5 pixels.
    pub share: f64,
    /// Share of the whole contour that lies in the frame where nothing is known to hide it.
    pub visible: f64,
    /// Longest piece of the contour without such an edge, as a share of the whole.
    pub gap: f64,
    /// Smallest share of the visible contour with an edge among the steps between one pair of greys; [`Quality::share`] for one grey.
    pub weakest: f64,
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
        weakest: 0.0,
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

    /// Say whether the edges are as near as noise lets expect: of normal distances the median is .67 deviations.
    pub fn is_settled(&self) -> bool {
        self.median < SETTLED * self.expected.hypot(FLOOR) + BLURRED * self.blur.powi(2)
    }

    /// Say whether edges are clearly nearer than those of another theta, on no less of the contour, or as near on clearly more of it.
    pub(super) fn beats(&self, other: &Self) -> bool {
        let (share, before) = (self.share * self.visible, other.share * other.visible);
        let nearer = self.median < CLEARLY * other.median && share > 0.97 * before;
        nearer || (self.median < 1.2 * other.median.max(self.expected) && share > 1.1 * before)
    }

    /// Say whether a theta that has not been fitted to its end may yet beat another.
    pub(super) fn promises(&self, other: &Self) -> bool {
        self.median < 1.5 * other.median.max(self.expected)
            && self.share * self.visible > 0.9 * other.share * other.visible
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
        let off = |i: &usize| found.distances[*i].abs();
        let mut sizes: Vec<f32> = inliers.iter().map(|i| off(i) as f32).collect();
        let mut slopes: Vec<f32> = inliers.iter().map(|i| found.slopes[*i] as f32).collect();
        let square = inliers.iter().map(|i| off(i).powi(2)).sum::<f64>() / inliers.len() as f64;
        let slope = f64::from(crate::segment::median(&mut slopes).unwrap_or(1.0)).max(1e-3);
        let [frame_explained, reference_explained] = match (&pattern.greys, view.field.is_greys()) {
            (Some(greys), true) => self.agreement(greys, pattern, view, theta).map_or([0.0; 2], |share| [share; 2]),
            _ => self.overlap(pattern, view, theta).unwrap_or([0.0; 2]),
        };
        let mut errors: Vec<f32> = inliers.iter().map(|i| error_of(outlined, view, &found, *i) as f32).collect();
        let error = f64::from(crate::segment::median(&mut errors).unwrap_or(0.0));
        Quality {
            share: inliers.len() as f64 / visible.max(1.0),
            visible: visible / count,
            gap: longest_gap(&inliers, found.visible.len()),
            weakest: weakest(&outlined.levels, &found.visible, &inliers),
            median: f64::from(crate::segment::median(&mut sizes).unwrap_or(f32::INFINITY)),
            rms: square.sqrt(),
            expected: error.hypot(0.75 * outlined.deviation),
            // The slope of a blurred step is 1 / (sqrt(2 pi) deviation).
            blur: 0.399 / slope,
            frame_explained,
            reference_explained,
        }
    }

    /// Return the share of the mapped pattern of several greys, as far as it lies in the frame, where the frame has its grey.
    fn agreement(&self, greys: &Greys, pattern: &Pattern, view: &Sight, theta: &[f64]) -> Option<f64> {
        const ALIKE: f64 = 0.08;
        let backward = Backward::new(&(self.homography)(theta), pattern, view)?;
        let bounds = greys.bounds.map(|b| b as f64);
        let (mut all, mut alike) = (0usize, 0usize);
        let stride = view.field.stride();
        for y in (4..view.field.height().saturating_sub(4)).step_by(stride) {
            for x in (4..view.field.width().saturating_sub(4)).step_by(stride) {
                let Some([u, v]) = backward.at([x as f64, y as f64]) else { continue };
                if !((bounds[0]..=bounds[2]).contains(&u) && (bounds[1]..=bounds[3]).contains(&v)) {
                    continue;
                }
                let Some(grey) = greys.darkness.sample(u, v).filter(|grey| grey.abs() > ALIKE) else { continue };
                all += 1;
                alike += usize::from((view.field.at(x, y) - grey).abs() < ALIKE);
            }
        }
        (all > 0).then(|| alike as f64 / all as f64)
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

/// Return the standard deviation of an edge by the frame's noise, pixels.
pub(super) fn error_of(outlined: &Outlined, view: &Sight, found: &Found, i: usize) -> f64 {
    let range = f64::from(outlined.levels[i].inside - outlined.levels[i].outside).abs();
    // A sample between pixels, and two of them, have .75 of the noise of one pixel.
    0.75 * view.noise / (range * found.slopes[i]).max(1e-3)
}

/// Return the smallest share of the visible places with an edge among steps of the same greys; steps that are few do not count.
fn weakest(levels: &[Levels], visible: &[bool], inliers: &[usize]) -> f64 {
    const FEW: usize = 12;
    let mut kinds: Vec<(Levels, usize, usize)> = Vec::new();
    let mut listed = inliers.iter().copied().peekable();
    for (i, level) in levels.iter().enumerate() {
        let found = usize::from(listed.next_if_eq(&i).is_some());
        if !visible[i] {
            continue;
        }
        match kinds.iter_mut().find(|(known, ..)| known == level) {
            Some((_, all, with)) => (*all, *with) = (*all + 1, *with + found),
            None => kinds.push((*level, 1, found)),
        }
    }
    let shares = kinds.iter().filter(|(_, all, _)| *all >= FEW).map(|(_, all, with)| *with as f64 / *all as f64);
    shares.fold(1.0, f64::min)
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
