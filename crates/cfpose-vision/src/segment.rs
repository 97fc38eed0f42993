//! From an image to the share of every pixel that a pattern covers.
//!
//! The background's light is a robust quadratic surface; the image divided by it is a map of reflectance in which one threshold holds
//! everywhere. Between the levels of pattern and background the share of a pixel is w = (background - value) / (background - pattern).

mod background;
pub(crate) mod clusters;
mod histogram;
pub(crate) mod labels;
pub(crate) mod sparse;

use crate::options::Foreground;
use crate::raster::Raster;

pub use labels::Component;
use labels::{Mask, counts, keep_large};

/// What a segmentation may be told.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SegmentOptions {
    /// Which side the pattern is.
    pub foreground: Foreground,
    /// Reflectance that separates pattern and background, as a share of the background's; found by Otsu's method when not given.
    pub threshold: Option<f32>,
    /// Level of the pattern as a share of the background's, known from the reference: what is neither becomes an occluder.
    pub level: Option<f32>,
    /// Keep pixels apart that are neither pattern nor background.
    pub find_others: bool,
}

/// Why an image has no pattern.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SegmentError {
    /// All pixels are alike.
    #[error("the image shows one colour, and no pattern on a background")]
    OneColour,
    /// No component of a size.
    #[error("no region of {0} pixels or more stands out from the background; give --threshold, or a clearer image")]
    Nothing(usize),
}

/// A segmented image.
#[derive(Debug, Clone)]
pub struct Segmentation {
    /// Share of each pixel that the pattern covers, exactly 0 and 1 away from the boundary.
    pub coverage: Raster,
    /// Share of each pixel that the pattern covers, not cut off at 0 and 1, up to 8 pixels from the boundary: what a noisy or blurred image
    /// is smoothed from.
    pub unbounded: Raster,
    /// The image divided by its background, oriented so that the pattern is darker than the background's 1.
    pub reflectance: Raster,
    /// Whether the pattern is darker than its background.
    pub dark: bool,
    /// Level of the pattern in `reflectance`.
    pub level: f32,
    /// Level of the background in `reflectance`.
    pub background: f32,
    /// Threshold in `reflectance`.
    pub threshold: f32,
    /// Standard deviation of the coverage by noise; of an image without mixed pixels that of a place within a pixel.
    pub noise: f32,
    /// Whether most of the background is over-exposed.
    pub overexposed: bool,
    /// Components, largest first.
    pub components: Vec<Component>,
    /// Pixels that show neither pattern nor background, grown by a margin; none where all are explained.
    pub others: Option<Vec<bool>>,
}

/// Pixels beyond this distance from the boundary are covered wholly or not at all.
const BAND: usize = 3;

/// Light from which a pixel counts as over-exposed.
const CLIPPED: f32 = 0.99;

/// Least difference of pattern and background, as a share of the background, and most noise as a share of that difference: below and above,
/// a threshold splits noise.
const LEAST_CONTRAST: f32 = 0.02;
const MOST_NOISE: f32 = 0.4;

/// Standard deviation of a place within a pixel, 1 / sqrt(12).
const GRID: f32 = 0.289;

/// The same for coverage that is to be smoothed.
const WIDE_BAND: usize = 8;

/// Smallest component, pixels, and as a share of the largest.
const SMALLEST: (usize, f64) = (30, 0.02);

/// Segment an image of light.
///
/// # Errors
/// [`SegmentError`] where there is no pattern.
pub fn segment(light: &Raster, options: &SegmentOptions) -> Result<Segmentation, SegmentError> {
    let smooth = light.smoothed();
    let plain = histogram::otsu(&smooth, 1.0).ok_or(SegmentError::OneColour)?;
    let dark = match options.foreground {
        Foreground::Dark => true,
        Foreground::Bright => false,
        Foreground::Auto => border_is_above(&smooth, plain.threshold),
    };
    let bright: Vec<bool> = smooth.values().iter().map(|value| *value > 0.94 * CLIPPED).collect();
    let (mut reflectance, mut smooth, threshold) = flatten(light, smooth, dark, plain, &bright, options)?;
    let mut mask = Mask::of(&smooth, |value| value <= threshold);
    let first = levels(&reflectance, &mask, &bright).ok_or(SegmentError::OneColour)?;
    // Once more between the two levels that were found.
    let pattern = options.level.map_or(first[0], |known| nearest_level(&smooth, known, first[0]));
    let middle = options.threshold.unwrap_or(0.5 * (first[1] + pattern));
    mask = Mask::of(&smooth, |value| value <= middle);
    let mut others = options.find_others.then(|| labels::neither(&smooth, first[1], pattern)).flatten();
    if let (true, Some(hidden)) = (dark, &others) {
        // Once more without what hides the background: its seams would bend the surface.
        let values = mask.values.iter().zip(hidden).map(|(inside, other)| inside | u8::from(*other)).collect();
        if let Some(correction) = background::refit(&smooth, &bright, &Mask { values, ..mask }) {
            (reflectance, smooth) = (correction.divide(&reflectance), correction.divide(&smooth));
        }
        mask = Mask::of(&smooth, |value| value <= middle);
        others = labels::neither(&smooth, first[1], pattern);
    }
    if let Some(others) = &others {
        mask.values.iter_mut().zip(others).for_each(|(inside, other)| *inside &= u8::from(!*other));
    }
    let components = keep_large(&mut mask, SMALLEST.0, SMALLEST.1);
    if components.is_empty() {
        return Err(SegmentError::Nothing(SMALLEST.0));
    }
    let [inside, mut outside] = levels(&reflectance, &mask, &bright).unwrap_or([pattern, first[1]]);
    // An over-exposed background: its light follows from the pattern's and the reference.
    let overexposed = dark && background_is_clipped(light, &mask);
    if let (true, Some(known)) = (overexposed, options.level) {
        outside = outside.max(inside / known.max(0.05));
    }
    let noise = noise_of(&reflectance, &smooth, &mask) / (outside - inside).abs().max(1e-6);
    let unbounded = coverage(&reflectance, &mask, [inside, outside], WIDE_BAND, [-1.0, 2.0]);
    let mut coverage = coverage(&reflectance, &mask, [inside, outside], BAND, [0.0, 1.0]);
    if dark {
        // What is cut off at the top is no part of a dark pattern.
        let cut_off = coverage.values_mut().iter_mut().zip(light.values()).filter(|(_, light)| **light >= CLIPPED);
        cut_off.for_each(|(share, _)| *share = 0.0);
    }
    if (outside - inside).abs() < LEAST_CONTRAST || noise > MOST_NOISE {
        return Err(SegmentError::OneColour);
    }
    let noise = if has_mixed_pixels(&coverage) { noise } else { noise.max(GRID) };
    Ok(Segmentation {
        overexposed,
        coverage,
        unbounded,
        reflectance,
        dark,
        level: inside,
        background: outside,
        threshold: middle,
        noise,
        components,
        others,
    })
}

/// Divide by the background where that separates better; return reflectance, the same smoothed, and the threshold.
fn flatten(
    light: &Raster,
    smooth: Raster,
    dark: bool,
    plain: histogram::Split,
    bright: &[bool],
    options: &SegmentOptions,
) -> Result<(Raster, Raster, f32), SegmentError> {
    if !dark {
        // A pattern brighter than its background: upside down, so that everything below sees a dark one.
        let top = plain.above.max(1e-6);
        let turn = |raster: &Raster| {
            let values = raster.values().iter().map(|v| 1.0 + plain.below / top - v / top).collect();
            Raster::from_values(raster.width(), raster.height(), values)
        };
        let (turned, smooth) =
            (turn(light).ok_or(SegmentError::OneColour)?, turn(&smooth).ok_or(SegmentError::OneColour)?);
        let threshold = 1.0 + (plain.below - plain.threshold) / top;
        return Ok((turned, smooth, options.threshold.unwrap_or(threshold)));
    }
    let level = plain.above.max(1e-6);
    let surface = background::surface(light, level, CLIPPED).filter(|surface| {
        let values = surface.on_grid();
        values.iter().all(|v| *v > 0.1 * level && *v < 10.0 * level)
    });
    let surface = match surface {
        Some(surface) => surface,
        None => background::Surface::constant(level),
    };
    let mut reflectance = surface.divide(light);
    let mut even = surface.divide(&smooth);
    let mut split = histogram::otsu(&even, 1.5).ok_or(SegmentError::OneColour)?;
    if plain.separability > split.separability + 0.05 {
        let surface = background::Surface::constant(level);
        (reflectance, even) = (surface.divide(light), surface.divide(&smooth));
        split = histogram::otsu(&even, 1.5).ok_or(SegmentError::OneColour)?;
    } else {
        // The surface through the background's pixels alone.
        let threshold = options.threshold.unwrap_or(split.threshold);
        let mask = Mask::of(&even, |value| value <= threshold);
        if let Some(correction) = background::refit(&even, bright, &mask) {
            (reflectance, even) = (correction.divide(&reflectance), correction.divide(&even));
        }
    }
    Ok((reflectance, even, options.threshold.unwrap_or(split.threshold)))
}

/// Say whether most of the border is above a threshold.
fn border_is_above(raster: &Raster, threshold: f32) -> bool {
    let (w, h) = (raster.width(), raster.height());
    let rows = [0, h - 1].into_iter().flat_map(|y| raster.row(y).iter());
    let columns = (0..h).flat_map(|y| [raster.row(y)[0], raster.row(y)[w - 1]]);
    let all: Vec<f32> = rows.copied().chain(columns).collect();
    2 * all.iter().filter(|value| **value > threshold).count() > all.len()
}

/// Distances from the boundary within which pixels may be mixed, the largest first, and the share of the pattern's pixels that must lie
/// beyond: the blur is not known yet, and pixels that it mixes move a median by a share of the noise.
const MIXED: [usize; 3] = [12, 6, 2];
const BEYOND: f64 = 0.15;

/// Return the median of pattern and background away from the boundary; `None` where one of them has no pixel. Of the background, pixels
/// that noise may have cut off at the top count only if nothing else is there.
fn levels(reflectance: &Raster, mask: &Mask, bright: &[bool]) -> Option<[f32; 2]> {
    let needed = (BEYOND * mask.values.iter().filter(|value| **value == 1).count() as f64).max(300.0) as usize;
    let deep = |counts: &[(u16, u16)]| counts.iter().filter(|(count, full)| count == full).count() >= needed;
    let found = MIXED.iter().map(|reach| counts(mask, *reach)).find(|counts| deep(counts));
    let counts = found.unwrap_or_else(|| counts(mask, 2));
    let (mut inside, mut outside) = (Vec::new(), Vec::new());
    let mut cut = Vec::new();
    for ((value, (count, full)), bright) in reflectance.values().iter().zip(counts.iter()).zip(bright).step_by(5) {
        if count == full {
            inside.push(*value);
        } else if *count == 0 {
            if *bright { &mut cut } else { &mut outside }.push(*value);
        }
    }
    if outside.len() < cut.len() / 10 {
        outside.append(&mut cut);
    }
    // The background is 1 by its surface; a large region of another grey is none of it.
    let near: Vec<f32> = outside.iter().copied().filter(|value| (value - 1.0).abs() < 0.15).collect();
    if near.len() * 20 > outside.len() {
        outside = near;
    }
    if inside.is_empty() {
        // A thin pattern: its darkest pixels.
        inside = reflectance.values().iter().zip(&mask.values).filter(|(_, m)| **m == 1).map(|(v, _)| *v).collect();
    }
    Some([median(&mut inside)?, median(&mut outside)?])
}

/// Say whether the boundary has pixels that are covered in part: one in five steps between neighbours or more.
fn has_mixed_pixels(coverage: &Raster) -> bool {
    let (mut steps, mut mixed) = (0usize, 0usize);
    for y in 0..coverage.height() {
        for pair in coverage.row(y).windows(2) {
            steps += usize::from((pair[0] > 0.5) != (pair[1] > 0.5));
            mixed += usize::from((0.1..0.9).contains(&pair[0]));
        }
    }
    5 * mixed > steps
}

/// Say whether most of the background is over-exposed.
fn background_is_clipped(light: &Raster, mask: &Mask) -> bool {
    let outside = light.values().iter().zip(&mask.values).step_by(5).filter(|(_, inside)| **inside == 0);
    let (mut all, mut clipped) = (0usize, 0usize);
    outside.for_each(|(value, _)| (all, clipped) = (all + 1, clipped + usize::from(*value >= CLIPPED)));
    2 * clipped > all
}

/// Prefer the level that the reference has where the image shows pixels of it.
fn nearest_level(smooth: &Raster, known: f32, found: f32) -> f32 {
    let width = 0.12 * (1.0 - known).abs();
    let mut near: Vec<f32> =
        smooth.values().iter().step_by(3).filter(|value| (**value - known).abs() < width).copied().collect();
    if near.len() * 3 < 200 { found } else { median(&mut near).unwrap_or(found) }
}

pub(crate) fn median(values: &mut [f32]) -> Option<f32> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f32::total_cmp).1)
}

/// Estimate the noise of a reflectance by the median distance from its smoothed self, over the background.
fn noise_of(reflectance: &Raster, smooth: &Raster, mask: &Mask) -> f32 {
    let rows = reflectance.values().iter().zip(smooth.values()).zip(&mask.values).step_by(7);
    let mut distances: Vec<f32> = rows.filter(|(_, m)| **m == 0).map(|((v, s), _)| (v - s).abs()).collect();
    // The rest after smoothing by [1, 4, 6, 4, 1] / 16 twice has 0.891 of the deviation.
    median(&mut distances).unwrap_or(0.0) * 1.4826 / 0.891
}

/// Return the share of each pixel between two levels within bounds, exactly 0 and 1 beyond a band.
fn coverage(reflectance: &Raster, mask: &Mask, [inside, outside]: [f32; 2], band: usize, bounds: [f32; 2]) -> Raster {
    let counts = counts(mask, band);
    let scale = 1.0 / (outside - inside);
    let values = reflectance.values().iter().zip(&counts);
    let values = values.map(|(value, (count, full))| match *count {
        0 => 0.0,
        count if count == *full => 1.0,
        _ => ((outside - value) * scale).clamp(bounds[0], bounds[1]),
    });
    Raster::from_values(reflectance.width(), reflectance.height(), values.collect())
        .unwrap_or_else(|| Raster::filled(reflectance.width(), reflectance.height(), 0.0))
}
