//! Two clouds on one asymmetric shape, a full random rotation apart; a start at a given angle from the truth, or none.

use std::path::{Path, PathBuf};

use cfpose::entry::{EntryError, ParameterSpec, Parameters};
use cfpose::{Points, Pose, Side};
use cfpose_optim::manifold::{multiply3, rotation_exp, rotation_of_quaternion};
use rand::RngExt;
use rand_chacha::ChaCha12Rng;
use rand_distr::StandardNormal;

use crate::sampling::{add_uniform, cut_by_plane, keep_behind, shuffle};
use crate::scenario::{Scenario, ScenarioEntry, ScenarioError, Success, Trial};

use crate::shapes::{Shape, Source, direction};

mod intruder;

use intruder::Intruder;

/// Fewest points that the cut by `overlap` leaves.
const MIN_POINTS: usize = 4;

/// Two clouds P and Q = R P + T, or Q sampled from the shape anew; Q may be cut and hold clutter.
///
/// Random draws of a trial, in this order: the rotation (four normals, a uniform quaternion), the translation (three
/// normals, times `translation`), the source points, with `sampling = independent` the target points (the shape says how),
/// with `overlap` below 1 a direction (three normals), with an `intruder` what [`Intruder::draw`] says, the noise (three normals for every
/// target point that is left), the clutter (three uniforms each), the permutation of the target (Fisher-Yates from the end), with
/// `noise_on = both` the noise of the source (three normals a point), with `start` the axis of the start's error (three normals), with
/// `offset` its direction (three normals).
///
/// The cut keeps the share `overlap` of the target points: those that lie farthest back along the direction. With `cut = both` the target
/// keeps the share 1 / (2 - overlap) farthest back, the source as many farthest in front, so that either shows `overlap` of the other's.
struct Cloud3 {
    source: Source,
    /// Made of `source` by [`Scenario::load`] where that is a file.
    shape: Option<Shape>,
    /// The file, once it is read.
    file: Option<PathBuf>,
    num_points: usize,
    independent: bool,
    noise: f64,
    noisy_source: bool,
    translation: f64,
    /// Clutter points, as a share of the target points.
    clutter: f64,
    overlap: f64,
    cuts_both: bool,
    intruder: Intruder,
    /// Points of the intruder, as a share of the shape's points in the target.
    intruder_share: f64,
    /// Angle between the start and the truth, radians.
    start: Option<f64>,
    /// Distance between the start's translation and the truth.
    start_offset: f64,
}

impl Cloud3 {
    fn new(parameters: &Parameters) -> Result<Self, EntryError> {
        let not_negative = |key| parameters.number(key, "a number >= 0", |v| v >= 0.0 && v.is_finite());
        let source = Source::of(parameters)?;
        let start = match parameters.text("start") {
            "none" => None,
            _ => Some(parameters.number("start", "`none` or degrees from 0 to 180", |v| (0.0..=180.0).contains(&v))?),
        };
        // A surface from a seed needs no file.
        let shape = if matches!(source, Source::Seed(_)) { source.load(Path::new("")).ok() } else { None };
        Ok(Self {
            source,
            shape,
            file: None,
            num_points: parameters.count("points", MIN_POINTS, 10_000_000)?,
            independent: parameters.choice("sampling", &[("permutation", false), ("independent", true)])?,
            noise: not_negative("noise")?,
            translation: not_negative("translation")?,
            clutter: parameters.number("clutter", "a share from 0 to 10", |v| (0.0..=10.0).contains(&v))?,
            overlap: parameters.number("overlap", "a share above 0, at most 1", |v| v > 0.0 && v <= 1.0)?,
            cuts_both: parameters.choice("cut", &[("target", false), ("both", true)])?,
            noisy_source: parameters.choice("noise_on", &[("target", false), ("both", true)])?,
            intruder: Intruder::of(parameters)?,
            intruder_share: parameters
                .number("intruder_share", "a share from 0 to 10", |v| (0.0..=10.0).contains(&v))?,
            start: start.map(f64::to_radians),
            start_offset: not_negative("start_offset")?,
        })
    }

    /// Keep the parts that `overlap` and `cut` say.
    fn cut(&self, source: &mut Vec<[f64; 3]>, target: &mut Vec<[f64; 3]>, rng: &mut ChaCha12Rng) {
        if self.overlap >= 1.0 {
            return;
        }
        let kept = |share: f64, points: &[[f64; 3]]| ((share * points.len() as f64).round() as usize).max(MIN_POINTS);
        if !self.cuts_both {
            cut_by_plane(target, kept(self.overlap, target), rng);
            return;
        }
        let share = (2.0 - self.overlap).recip();
        let axis = direction(rng);
        keep_behind(target, kept(share, target), &axis);
        keep_behind(source, kept(share, source), &axis.map(|x| -x));
    }

    /// Draw what the target holds: the shape, cut, moved, and what stands beside it, with noise and clutter.
    fn target(&self, shape: &Shape, pose: &Pose, source: &mut Vec<[f64; 3]>, rng: &mut ChaCha12Rng) -> Vec<[f64; 3]> {
        let mut target = if self.independent { shape.sample(self.num_points, rng) } else { source.clone() };
        self.cut(source, &mut target, rng);
        let count = (self.intruder_share * target.len() as f64).round() as usize;
        target.extend(self.intruder.draw(count, &target, shape, rng));
        target.iter_mut().for_each(|q| *q = pose.apply(*q));
        disturb(&mut target, self.noise, rng);
        let num_clutter = (self.clutter * target.len() as f64).round() as usize;
        add_uniform(&mut target, num_clutter, rng);
        shuffle(&mut target, rng);
        target
    }
}

/// Add noise to every coordinate.
fn disturb(points: &mut [[f64; 3]], sigma: f64, rng: &mut ChaCha12Rng) {
    points.iter_mut().flatten().for_each(|x| *x += sigma * rng.sample::<f64, _>(StandardNormal));
}

impl Scenario for Cloud3 {
    fn model(&self) -> &str {
        "rigid3"
    }

    fn load(&mut self, folder: &Path) -> Result<(), ScenarioError> {
        if self.shape.is_none() {
            self.shape = Some(self.source.load(folder)?);
            self.file = self.source.path(folder);
        }
        match self.shape.as_ref().and_then(Shape::max_points) {
            Some(most) if most < self.num_points => Err(ScenarioError::File(format!(
                "points = {}, but the shape's file holds {most} and no faces",
                self.num_points
            ))),
            _ => Ok(()),
        }
    }

    fn files(&self) -> Vec<PathBuf> {
        self.file.iter().cloned().collect()
    }

    fn trial(&self, rng: &mut ChaCha12Rng) -> Result<Trial, ScenarioError> {
        let Some(shape) = &self.shape else {
            return Err(ScenarioError::File("shape: its file was not loaded".to_string()));
        };
        let quaternion: [f64; 4] = std::array::from_fn(|_| rng.sample(StandardNormal));
        let translation = std::array::from_fn(|_| self.translation * rng.sample::<f64, _>(StandardNormal));
        let pose = Pose { rotation: rotation_of_quaternion(&quaternion), translation };
        let mut source = shape.sample(self.num_points, rng);
        let target = self.target(shape, &pose, &mut source, rng);
        if self.noisy_source {
            disturb(&mut source, self.noise, rng);
        }
        let points = |side, rows: &[[f64; 3]]| {
            Points::from_rows(rows).map_err(|problem| ScenarioError::Points { side, problem })
        };
        let ambient = |rotation: &[f64; 9], translation: &[f64; 3]| {
            rotation.iter().chain(translation).copied().collect::<Vec<f64>>()
        };
        let success = Success::Parts { angle: 5.0_f64.to_radians(), translation: 0.05 };
        let (source, target) = (points(Side::Source, &source)?, points(Side::Target, &target)?);
        let trial = Trial::new(source, target, ambient(&pose.rotation, &pose.translation), success);
        let Some(angle) = self.start else { return Ok(trial) };
        let turn = rotation_exp(&direction(rng).map(|u| angle * u));
        let mut translation = pose.translation;
        if self.start_offset > 0.0 {
            let u = direction(rng);
            (0..3).for_each(|d| translation[d] += self.start_offset * u[d]);
        }
        Ok(trial.with_start(ambient(&multiply3(&pose.rotation, &turn), &translation)))
    }
}

pub(super) const ENTRY: ScenarioEntry = ScenarioEntry {
    name: "cloud3",
    summary: "3D-3D: clouds on an asymmetric shape of radius 1, full random rotation, no start; success below 5 deg and 0.05",
    parameters: &[
        ParameterSpec {
            name: "shape",
            default: "1",
            meaning: "seed of a surface (a whole number >= 0), bunny, or a mesh or point file (in the experiment's folder or that of real data), scaled to radius 1 about its centroid",
        },
        ParameterSpec { name: "points", default: "1000", meaning: "points of each cloud, 4 to 10000000" },
        ParameterSpec {
            name: "sampling",
            default: "permutation",
            meaning: "permutation (the same points in another order) or independent (sampled anew)",
        },
        ParameterSpec { name: "noise", default: "0", meaning: "standard deviation of the target's noise, >= 0" },
        ParameterSpec { name: "translation", default: "0.3", meaning: "standard deviation of the translation, >= 0" },
        ParameterSpec {
            name: "clutter",
            default: "0",
            meaning: "clutter points added to the target, as a share of its points; uniform in its bounding box enlarged by a fifth",
        },
        ParameterSpec {
            name: "overlap",
            default: "1",
            meaning: "share of the target's points that is left, cut by a plane of random direction; 0 < . <= 1",
        },
        ParameterSpec {
            name: "cut",
            default: "target",
            meaning: "target, or both: opposite ends of either side are cut so that the share `overlap` of what is left is common",
        },
        ParameterSpec { name: "noise_on", default: "target", meaning: "target or both: which sides have the noise" },
        ParameterSpec {
            name: "intruder",
            default: "none",
            meaning: "what else stands in the target: none, blob, object (another surface), ground (a plane below), copy (the shape again)",
        },
        ParameterSpec {
            name: "intruder_share",
            default: "0.3",
            meaning: "its points, as a share of the shape's points in the target",
        },
        ParameterSpec {
            name: "start_offset",
            default: "0",
            meaning: "distance of the start's translation from the truth, >= 0",
        },
        ParameterSpec {
            name: "start",
            default: "none",
            meaning: "none, or the angle in degrees by which the start turns the truth about a random axis through the shape's middle",
        },
    ],
    source: "project; setting of the 3D-3D experiments of Domokos and Hagege; bunny: Stanford 3D Scanning Repository",
    build: |parameters| Ok(Box::new(Cloud3::new(parameters)?)),
};
