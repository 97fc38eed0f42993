//! A pattern of several greys: its clusters, and the steps between them as one outline.
//!
//! Source: section III.C.2, occlusion by grey values: clusters of both images are paired by their mean grey. Where one threshold does not
//! tell the pattern from what hides it, the greys on both sides of each edge do.

use cfpose::{Points, PointsError};

use super::edges::{self, Levels};
use super::pattern::{Outline, normalised, weighted};
use crate::camera::Camera;
use crate::contours::contours_of;
use crate::raster::Raster;
use crate::segment::labels::{Mask, counts};
use crate::segment::{Segmentation, clusters::clusters};

/// Most clusters of a reference; those of a frame are more by what may hide it.
pub(super) const MOST: usize = 8;
pub(super) const OCCLUDERS: usize = 5;

/// Seed of the clusters' begins.
pub(super) const SEED: u64 = 1;

/// About this many places stand for all steps.
const PLACES: f64 = 540.0;

/// Shortest contour, pixels.
const SHORTEST: f64 = 24.0;

/// Distance to both sides from which greys are read, pixels.
pub(super) const BESIDE: f64 = 4.0;

/// Least step between two greys, and how near a grey is to a cluster that it is taken for.
const LEAST_STEP: f64 = 0.06;
const NEAR: f64 = 0.04;

/// Tolerance of the greys beside an edge: a share of the step, and as it is.
const TOLERANCE: (f32, f32) = (0.35, 0.036);

/// A pattern has several greys if steps other than the most frequent one are this share of all.
const SEVERAL: f64 = 0.1;

/// Smallest region of a cluster, pixels.
const SMALLEST: usize = 200;

/// Side of the blocks that regions are compared with, pixels.
const BLOCK: usize = 4;

/// The greys of a reference as shares of its background's light that are missing: 0 is the background, 1 is black.
#[derive(Debug, Clone)]
pub struct Greys {
    /// Darkness of the reference.
    pub darkness: Raster,
    /// Columns and rows within which the pattern lies: left, top, right, bottom.
    pub bounds: [usize; 4],
    /// Means of its clusters, rising.
    pub clusters: Vec<f32>,
    /// Steps between greys, from the darker side.
    pub outline: Outline,
    /// Mean and blocks of pixels of each cluster that is no background.
    pub regions: Vec<(f32, Points)>,
}

/// Return the missing share of the background's light at each pixel.
pub(super) fn darkness(segmentation: &Segmentation) -> Raster {
    let background = segmentation.background.max(1e-6);
    let r = &segmentation.reflectance;
    Raster::from_values(r.width(), r.height(), r.values().iter().map(|v| 1.0 - v / background).collect())
        .unwrap_or_else(|| Raster::filled(r.width(), r.height(), 0.0))
}

/// Return the noise of the darkness of a pixel.
pub(super) fn noise(segmentation: &Segmentation) -> f32 {
    segmentation.noise * (segmentation.background - segmentation.level).abs() / segmentation.background.max(1e-6)
}

impl Greys {
    /// Find the greys of a reference; `None` where it has only one, or its steps cannot be traced.
    pub(super) fn of(segmentation: &Segmentation, camera: Camera) -> Option<Self> {
        let (darkness, noise) = (darkness(segmentation), noise(segmentation));
        let smooth = darkness.smoothed();
        let means = clusters(&smooth, noise, MOST, SEED);
        if means.len() < 3 {
            return None;
        }
        let (w, h) = (darkness.width(), darkness.height());
        let around = segmentation.components.iter().fold([w, h, 0, 0], |b, c| {
            [b[0].min(c.bounds[0]), b[1].min(c.bounds[1]), b[2].max(c.bounds[2]), b[3].max(c.bounds[3])]
        });
        let bounds = [
            around[0].saturating_sub(8),
            around[1].saturating_sub(8),
            (around[2] + 8).min(w - 1),
            (around[3] + 8).min(h - 1),
        ];
        let outline = outline(&darkness, &smooth, &means, bounds, camera, noise)?;
        let mut kinds: Vec<(Levels, usize)> = Vec::new();
        for levels in &outline.levels {
            match kinds.iter_mut().find(|(known, _)| known == levels) {
                Some((_, count)) => *count += 1,
                None => kinds.push((*levels, 1)),
            }
        }
        let most = kinds.iter().map(|(_, count)| *count).max()?;
        if (outline.levels.len() - most) as f64 <= SEVERAL * outline.levels.len() as f64 {
            return None;
        }
        let inside = |x: usize, y: usize| (bounds[0]..=bounds[2]).contains(&x) && (bounds[1]..=bounds[3]).contains(&y);
        let of_pattern = means.iter().filter(|mean| f64::from(mean.abs()) > LEAST_STEP);
        let regions =
            of_pattern.filter_map(|mean| Some((*mean, region(&smooth, &means, *mean, camera, inside).ok()??)));
        let regions: Vec<(f32, Points)> = regions.collect();
        Some(Self { darkness, bounds, clusters: means, outline, regions })
    }
}

/// Return the pixels of a cluster, those in seams left out.
fn members(smooth: &Raster, means: &[f32], mean: f32, inside: impl Fn(usize, usize) -> bool) -> Mask {
    let (w, h) = (smooth.width(), smooth.height());
    let nearest = |v: f32| means.iter().copied().min_by(|a, b| (a - v).abs().total_cmp(&(b - v).abs()));
    let values = (0..w * h).map(|k| u8::from(inside(k % w, k / w) && nearest(smooth.values()[k]) == Some(mean)));
    let mask = Mask { width: w, height: h, values: values.collect() };
    // An opening by 3 x 3 pixels.
    let core: Vec<u8> = counts(&mask, 1).iter().map(|(count, full)| u8::from(count == full)).collect();
    let core = Mask { values: core, ..mask };
    Mask { values: counts(&core, 1).iter().map(|(count, _)| u8::from(*count > 0)).collect(), ..core }
}

/// Return the pixels of a cluster as blocks; `None` where they are few.
pub(super) fn region(
    smooth: &Raster,
    means: &[f32],
    mean: f32,
    camera: Camera,
    inside: impl Fn(usize, usize) -> bool,
) -> Result<Option<Points>, PointsError> {
    let mask = members(smooth, means, mean, inside);
    if mask.values.iter().filter(|v| **v == 1).count() < SMALLEST {
        return Ok(None);
    }
    let raster = Raster::from_fn(mask.width, mask.height, |x, y| f32::from(mask.values[y * mask.width + x]));
    weighted(&raster, camera, BLOCK).map(Some)
}

/// Trace the steps between the clusters, and move them onto the edges that the search finds on the reference itself.
fn outline(
    darkness: &Raster,
    smooth: &Raster,
    means: &[f32],
    bounds: [usize; 4],
    camera: Camera,
    noise: f32,
) -> Option<Outline> {
    let mut contours = Vec::new();
    let inside = |x: usize, y: usize| (bounds[0]..=bounds[2]).contains(&x) && (bounds[1]..=bounds[3]).contains(&y);
    for mean in means {
        let mask = members(smooth, means, *mean, inside);
        let raster = Raster::from_fn(mask.width, mask.height, |x, y| f32::from(mask.values[y * mask.width + x]));
        contours.extend(contours_of(&raster.gaussian(0.7), 0.5).into_iter().filter(|c| c.length() >= SHORTEST));
    }
    // Each step bounds two clusters.
    let total: f64 = contours.iter().map(|contour| contour.length()).sum::<f64>() / 2.0;
    let spacing = (total / PLACES).clamp(1.0, 12.0);
    let (mut pixels, mut ahead, mut levels, mut errors) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for (place, along) in contours.iter().flat_map(|contour| contour.resampled(spacing)) {
        let normal = [along[1], -along[0]];
        let located = |place: [f64; 2]| {
            let step = step(smooth, means, place, normal)?;
            let edge = edges::nearest(darkness, place, normal, 3.0, step)?;
            Some((step, edge, [0, 1].map(|d| place[d] + edge.distance * normal[d])))
        };
        // A contour of a cluster lies on the darker side of its edges: greys are read again from where those are.
        let Some((step, edge, moved)) = located(place).and_then(|(.., near)| located(near)) else { continue };
        pixels.push(moved);
        ahead.push([0, 1].map(|d| moved[d] + along[d]));
        levels.push(step);
        errors.push((f64::from(noise) / (f64::from(step.inside - step.outside) * edge.slope).max(1e-3)) as f32);
    }
    let deviation = f64::from(crate::segment::median(&mut errors)?);
    let places = normalised(camera, &pixels).ok()?;
    let ahead = normalised(camera, &ahead).ok()?;
    (pixels.len() >= 24).then_some(Outline { places, ahead, levels, spacing, deviation })
}

/// Read the greys on both sides of a place; `None` where the inner one is not clearly the darker one.
fn step(smooth: &Raster, means: &[f32], place: [f64; 2], normal: [f64; 2]) -> Option<Levels> {
    let at = |t: f64| {
        let value = smooth.sample(place[0] + t * normal[0], place[1] + t * normal[1])?;
        let near = means.iter().map(|mean| f64::from(*mean)).find(|mean| (mean - value).abs() < NEAR);
        Some(near.unwrap_or(value) as f32)
    };
    let (inside, outside) = (at(-BESIDE)?, at(BESIDE)?);
    let range = inside - outside;
    let tolerance = Some(TOLERANCE.0 * range + TOLERANCE.1);
    (f64::from(range) > LEAST_STEP).then_some(Levels { inside, outside, tolerance })
}
