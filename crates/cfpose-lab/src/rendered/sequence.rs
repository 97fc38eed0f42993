//! Sequences of 60 frames along a smooth path, registered one after the other from the pose before.

use std::sync::Arc;
use std::time::Instant;

use cfpose::Registry;
use cfpose::homography::{apply, in_file_units};
use cfpose_optim::manifold::rotation_exp;
use cfpose_vision::registration::{Pattern, Registrar};
use cfpose_vision::{Camera, Exposure, Patch, Picture, SegmentOptions, Transfer, render, segment};
use serde::Serialize;

use super::cells::{ALL, LEVEL, ON_WHEELS};
use super::scene::{CAMERA, SIZE, homography_of, pixel};
use super::shapes;
use crate::seed::data_stream;

/// Frames of a sequence.
const FRAMES: u32 = 60;

/// A path and what happens on it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RenderedSequence {
    /// Name.
    pub name: &'static str,
    /// Tangent columns that move: those of `--free`.
    pub free: &'static [usize],
    /// A bar of 90 pixels in the background's colour crosses the pattern.
    pub bar: bool,
    /// The light's gradient changes, with more blur and noise.
    pub light: bool,
}

/// All sequences: those of docs/vision.md.
pub const SEQUENCES: &[RenderedSequence] = &[
    RenderedSequence { name: "track-6dof", free: ALL, bar: false, light: false },
    RenderedSequence { name: "track-bar", free: ALL, bar: true, light: false },
    RenderedSequence { name: "track-light", free: ALL, bar: false, light: true },
    RenderedSequence { name: "track-3dof", free: ON_WHEELS, bar: false, light: false },
    RenderedSequence { name: "track-4dof", free: LEVEL, bar: false, light: false },
];

/// A sequence in numbers.
#[derive(Debug, Clone, Serialize)]
pub struct SequenceSummary {
    /// Name.
    pub name: &'static str,
    /// Frames without a theta, or off by more than 3 pixels.
    pub lost: usize,
    /// Mean and largest reprojection error, pixels.
    pub mean_px: f64,
    /// Largest.
    pub max_px: f64,
    /// Frames called good.
    pub good: usize,
    /// Frames that were followed from the last pose without segmentation.
    pub followed: usize,
    /// Time of the first frame, seconds.
    pub first_seconds: f64,
    /// Median time of a frame without drawing it, seconds.
    pub median_seconds: f64,
}

/// Return theta on the path of a frame: rotation row by row, translation over depth.
fn path(sequence: &RenderedSequence, frame: u32) -> Vec<f64> {
    let t = f64::from(frame) / f64::from(FRAMES) * std::f64::consts::TAU;
    let away = 1.0 + 0.25 * (t + 0.5).sin() - 0.25 * 0.5_f64.sin();
    let (turn, centre) = match sequence.free.len() {
        3 => ([0.0, 0.3 * t.sin(), 0.0], [0.1 * (2.0 * t).sin(), 0.0, away]),
        4 => ([0.0, 0.3 * t.sin(), 0.0], [0.1 * (2.0 * t).sin(), 0.05 * (3.0 * t).sin(), away]),
        _ => (
            [0.3 * t.sin(), 0.35 * (2.0 * t).sin(), 0.4 * t.sin()],
            [0.08 * (2.0 * t).sin(), 0.05 * (3.0 * t).sin(), away],
        ),
    };
    let rotation = rotation_exp(&turn);
    let mut theta = rotation.to_vec();
    theta.extend((0..3).map(|i| centre[i] - rotation[3 * i + 2]));
    theta
}

/// A reference and the frames of a sequence.
#[derive(Debug, Clone)]
pub struct DrawnSequence {
    /// The pattern seen from the front.
    pub reference: Picture,
    /// Camera of all.
    pub camera: Camera,
    /// Frames, each with the homography from the reference, pixels.
    pub frames: Vec<(Picture, [f64; 9])>,
    /// Outline of the pattern in the reference, pixels.
    pub outline: Vec<[f64; 2]>,
}

/// Draw a sequence from a seed.
pub fn draw_sequence(sequence: &RenderedSequence, seed: u64) -> Option<DrawnSequence> {
    let mut rng = data_stream(seed, 0x5e9);
    let outline: Vec<[f64; 2]> = shapes::named("flower", 0.25).into_iter().map(pixel).collect();
    let paint = |h: &[f64; 9]| Patch { polygon: outline.iter().map(|p| apply(h, *p)).collect(), grey: 60.0 };
    let frontal = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
    let reference = render(SIZE[0], SIZE[1], &[paint(&frontal)], &Exposure::default(), &mut rng);
    let mut frames = Vec::new();
    for frame in 0..FRAMES {
        let homography = homography_of(&path(sequence, frame));
        let mut patches = vec![paint(&homography)];
        if sequence.bar {
            let x = 40.0 + 9.5 * f64::from(frame);
            let corners = [[x - 45.0, -9.0], [x + 45.0, -9.0], [x + 45.0, 500.0], [x - 45.0, 500.0]];
            patches.push(Patch { polygon: corners.to_vec(), grey: 200.0 });
        }
        let gradient = 0.35 * (f64::from(frame) / 8.0).sin();
        let exposure = match sequence.light {
            true => Exposure { gradient, blur: 1.8, noise: 4.0, ..Exposure::default() },
            false => Exposure::default(),
        };
        frames.push((render(SIZE[0], SIZE[1], &patches, &exposure, &mut rng), homography));
    }
    let camera = Camera::new(CAMERA.fx, CAMERA.fy, CAMERA.cx, CAMERA.cy)?;
    Some(DrawnSequence { reference, camera, frames, outline })
}

/// Make the registrar and the pattern of a sequence.
pub fn prepare_sequence(sequence: &RenderedSequence, drawn: &DrawnSequence) -> Option<(Registrar, Pattern)> {
    let free = (sequence.free.len() < 6).then(|| sequence.free.to_vec());
    let registrar = Registrar::new(&Registry::default(), "plane-bearing", free, None).ok()?;
    let segmented = segment(&drawn.reference.light(Transfer::Linear), &SegmentOptions::default()).ok()?;
    Some((registrar, Pattern::new(&segmented, drawn.camera).ok()?))
}

/// Register a sequence; `None` where the reference cannot be used.
pub fn measure_sequence(sequence: &RenderedSequence, seed: u64) -> Option<SequenceSummary> {
    let drawn = draw_sequence(sequence, seed)?;
    let (registrar, pattern) = prepare_sequence(sequence, &drawn)?;
    let (mut last, mut errors, mut times): (Option<Vec<f64>>, Vec<f64>, Vec<f64>) = (None, Vec::new(), Vec::new());
    let (mut good, mut followed) = (0, 0);
    for (number, (picture, homography)) in (0u64..).zip(&drawn.frames) {
        let begun = Instant::now();
        let light = Arc::new(picture.light(Transfer::Linear));
        let look = SegmentOptions::default();
        let found = registrar.follow(&pattern, light, &look, drawn.camera, last.as_deref(), number).ok();
        times.push(begun.elapsed().as_secs_f64());
        let Some(found) = found else {
            errors.push(f64::INFINITY);
            continue;
        };
        let k = drawn.camera.intrinsics();
        let h = in_file_units(&registrar.homography(&found.theta), Some(&k), Some(&k)).unwrap_or([f64::NAN; 9]);
        let distance = |p: &[f64; 2]| {
            let (a, b) = (apply(&h, *p), apply(homography, *p));
            (a[0] - b[0]).hypot(a[1] - b[1])
        };
        errors.push(drawn.outline.iter().map(distance).sum::<f64>() / drawn.outline.len() as f64);
        good += usize::from(found.verdict.name() == "good");
        followed += usize::from(found.by == "followed");
        last = Some(found.theta);
    }
    let first_seconds = times[0];
    times.sort_by(f64::total_cmp);
    Some(SequenceSummary {
        name: sequence.name,
        lost: errors.iter().filter(|error| error.is_nan() || **error > 3.0).count(),
        mean_px: errors.iter().sum::<f64>() / errors.len() as f64,
        max_px: errors.iter().fold(0.0, |a, b| a.max(*b)),
        good,
        followed,
        first_seconds,
        median_seconds: times[times.len() / 2],
    })
}
