//! The paper's simulation (section IV.C): one planar curve in two images.

use std::path::{Path, PathBuf};

use cfpose::entry::{EntryError, ParameterSpec, Parameters};
use cfpose::theta::{Layout, RotationForm, rotation_of_euler};
use cfpose::{Points, Pose, Side};
use rand::RngExt;
use rand_chacha::ChaCha12Rng;
use rand_distr::StandardNormal;

use crate::curves;
use crate::sampling::{add_uniform, shuffle};
use crate::scenario::{Scenario, ScenarioEntry, ScenarioError, Success, Trial};
use crate::shapes::{find_file, no_file};

mod theta;

use theta::Theta;

/// A pose is a success when e <= 0.1.
const THRESHOLD: f64 = 0.1;

/// A planar curve P on the plane z = 1 and its perspective image Q under R P + T_bar.
///
/// Random draws of a trial, in this order:
/// 0. with `theta = random` or `anywhere`: the true pose, see [`Theta`];
/// 1. six normals (also with `start = none`): theta_0 = theta + b_i randn(6), in (Euler angles, T_bar);
/// 2. with `b_m`: one normal for every point of the curve, in curve order; the point is kept when |randn| <= b_m;
/// 3. two normals (x, then y) for every point that is kept, in order: noise b_p randn on the image coordinates;
/// 4. two uniforms (x, then y) for every one of `outliers`, at (-0.6 + 0.05 rand, -0.4 + 0.05 rand);
/// 5. two uniforms (x, then y) for every one of `uniform_outliers`, in the bounding box of the points so far, enlarged by
///    a fifth about its centre;
/// 6. with `second_curve`: the points of another curve, see [`PlanarCurve::add_second`];
/// 7. with `order = shuffled`: the permutation of the target (Fisher-Yates from the end), then that of the source;
/// 8. with `source_noise`: two normals for every source point.
///
/// With `hidden` and `hidden_source` an arc of that share is missing, before anything is drawn for its points: it begins at a uniform place
/// of the curve, drawn after 1 (the target's first).
struct PlanarCurve {
    /// The curve; of a file empty until [`Scenario::load`] has read it.
    source: Vec<[f64; 2]>,
    /// The file of an outline, as it is named, then where it was found.
    file: Option<PathBuf>,
    found: Option<PathBuf>,
    scale: f64,
    theta: Theta,
    has_start: bool,
    is_shuffled: bool,
    b_i: f64,
    b_p: f64,
    b_m: Option<f64>,
    outliers: usize,
    uniform_outliers: usize,
    /// Shares of the curve that the target and the source lack.
    hidden: [f64; 2],
    /// Points of another curve in the image, as a share of the curve's points.
    second_curve: f64,
    source_noise: f64,
}

impl PlanarCurve {
    fn new(parameters: &Parameters) -> Result<Self, EntryError> {
        let not_negative = |key| parameters.number(key, "a number >= 0", |v| v >= 0.0 && v.is_finite());
        let share = |key| parameters.number(key, "a share from 0 to below 1", |v| (0.0..1.0).contains(&v));
        let scale = parameters.number("scale", "a number above 0", |v| v > 0.0 && v.is_finite())?;
        let b_m = match parameters.text("b_m") {
            "none" => None,
            _ => Some(parameters.number("b_m", "`none` or a number above 0", |v| v > 0.0)?),
        };
        let file = curves::file_of(parameters.text("curve"))?;
        Ok(Self {
            source: match &file {
                Some(_) => Vec::new(),
                None => curves::points(parameters.text("curve"), scale)?,
            },
            file,
            found: None,
            scale,
            theta: Theta::of(parameters)?,
            has_start: parameters.choice("start", &[("guess", true), ("none", false)])?,
            is_shuffled: parameters.choice("order", &[("curve", false), ("shuffled", true)])?,
            b_i: not_negative("b_i")?,
            b_p: not_negative("b_p")?,
            b_m,
            outliers: parameters.count("outliers", 0, 1_000_000)?,
            uniform_outliers: parameters.count("uniform_outliers", 0, 1_000_000)?,
            hidden: [share("hidden")?, share("hidden_source")?],
            second_curve: parameters.number("second_curve", "a share from 0 to 10", |v| (0.0..=10.0).contains(&v))?,
            source_noise: not_negative("source_noise")?,
        })
    }

    /// Return the points of the curve but for an arc of a share, which begins at a uniform place.
    fn seen(&self, hidden: f64, rng: &mut ChaCha12Rng) -> Vec<[f64; 2]> {
        if hidden <= 0.0 {
            return self.source.clone();
        }
        let len = self.source.len();
        let (begin, missing) = (rng.random_range(0..len), (hidden * len as f64).round() as usize);
        (missing..len).map(|k| self.source[(begin + k) % len]).collect()
    }

    /// Add the points of another curve: a seed of a random outline, half to all of the image's size, its middle within .8 of that size.
    fn add_second(&self, image: &mut Vec<[f64; 2]>, rng: &mut ChaCha12Rng) -> Result<(), ScenarioError> {
        let count = (self.second_curve * self.source.len() as f64).round() as usize;
        if count == 0 {
            return Ok(());
        }
        let seed: u32 = rng.random_range(100_000..200_000);
        let other = curves::points(&format!("fourier[seed={seed}]"), 1.0)
            .map_err(|problem| ScenarioError::Impossible(problem.to_string()))?;
        let middle: [f64; 2] = std::array::from_fn(|d| image.iter().map(|q| q[d]).sum::<f64>() / image.len() as f64);
        let reach = |q: &[f64; 2]| (q[0] - middle[0]).abs().max((q[1] - middle[1]).abs());
        let size = image.iter().map(reach).fold(0.0, f64::max);
        let scale = size * rng.random_range(0.5..1.0);
        let shift: [f64; 2] = std::array::from_fn(|_| 0.8 * size * (2.0 * rng.random::<f64>() - 1.0));
        for k in 0..count {
            let p = other[k * other.len() / count];
            image.push(std::array::from_fn(|d| middle[d] + shift[d] + scale * p[d]));
        }
        Ok(())
    }

    /// Draw the target points of what is seen of the curve, steps 2 to 6.
    fn image(
        &self,
        seen: &[[f64; 2]],
        theta: &[f64; 6],
        rng: &mut ChaCha12Rng,
    ) -> Result<Vec<[f64; 2]>, ScenarioError> {
        let pose = Pose { rotation: rotation_of_euler(&theta[..3]), translation: [theta[3], theta[4], theta[5]] };
        let mut image = Vec::with_capacity(self.source.len() + self.outliers + self.uniform_outliers);
        for p in seen {
            let keep = match self.b_m {
                None => true,
                Some(bound) => rng.sample::<f64, _>(StandardNormal).abs() <= bound,
            };
            if keep {
                let [x, y, z] = pose.apply([p[0], p[1], 1.0]);
                if z <= 0.0 {
                    return Err(ScenarioError::Impossible(
                        "theta puts part of the curve behind the camera (depth <= 0); choose another theta or scale"
                            .to_string(),
                    ));
                }
                image.push([x / z, y / z]);
            }
        }
        for q in &mut image {
            for x in q {
                *x += self.b_p * rng.sample::<f64, _>(StandardNormal);
            }
        }
        for _ in 0..self.outliers {
            image.push([-0.6 + 0.05 * rng.random::<f64>(), -0.4 + 0.05 * rng.random::<f64>()]);
        }
        add_uniform(&mut image, self.uniform_outliers, rng);
        self.add_second(&mut image, rng)?;
        Ok(image)
    }
}

impl Scenario for PlanarCurve {
    fn model(&self) -> &str {
        "plane-bearing"
    }

    fn load(&mut self, folder: &Path) -> Result<(), ScenarioError> {
        let Some(name) = self.file.as_ref().filter(|_| self.source.is_empty()) else { return Ok(()) };
        let path = find_file(folder, name).ok_or_else(|| no_file("curve", name))?;
        self.source = curves::of_picture(&path, self.scale).map_err(ScenarioError::File)?;
        self.found = Some(path);
        Ok(())
    }

    fn files(&self) -> Vec<PathBuf> {
        self.found.iter().cloned().collect()
    }

    fn trial(&self, rng: &mut ChaCha12Rng) -> Result<Trial, ScenarioError> {
        if self.source.is_empty() {
            return Err(ScenarioError::File("curve: its file was not loaded".to_string()));
        }
        let theta = self.theta.draw(&self.source, rng)?;
        let start = theta.map(|v| v + self.b_i * rng.sample::<f64, _>(StandardNormal));
        let seen = self.seen(self.hidden[0], rng);
        let mut source = self.seen(self.hidden[1], rng);
        let mut image = self.image(&seen, &theta, rng)?;
        let points = |side, rows: &[[f64; 2]]| {
            Points::from_rows(rows).map_err(|problem| ScenarioError::Points { side, problem })
        };
        let ambient = |theta: &[f64]| {
            Layout::pose3()
                .from_list(theta, RotationForm::Euler)
                .map_err(|problem| ScenarioError::Impossible(problem.to_string()))
        };
        if self.is_shuffled {
            shuffle(&mut image, rng);
            shuffle(&mut source, rng);
        }
        if self.source_noise > 0.0 {
            let noise = |rng: &mut ChaCha12Rng| self.source_noise * rng.sample::<f64, _>(StandardNormal);
            source.iter_mut().flatten().for_each(|x| *x += noise(rng));
        }
        let source = points(Side::Source, &source)?;
        let source = if self.is_shuffled { source } else { source.in_curve_order() };
        let trial = Trial::new(source, points(Side::Target, &image)?, ambient(&theta)?, Success::Error(THRESHOLD));
        Ok(if self.has_start { trial.with_start(ambient(&start)?) } else { trial })
    }
}

pub(super) const ENTRY: ScenarioEntry = ScenarioEntry {
    name: "planar-curve",
    summary: "the paper's simulation: a planar curve of 3142 points in two images, noise, mismatches, outliers",
    parameters: &[
        ParameterSpec {
            name: "curve",
            default: "heart",
            meaning: "heart, flower, butterfly, blob, fish, fourier[seed=K], letter[of=F] or outline[file=..] (a silhouette)",
        },
        ParameterSpec { name: "scale", default: "0.45", meaning: "largest absolute coordinate of the curve, > 0" },
        ParameterSpec {
            name: "theta",
            default: "B",
            meaning: "true pose: A, B or six numbers (Euler angles about x, y, z in rad with R = Rz Ry Rx, then T_bar), or drawn anew each trial: random (angles within 0.5, depth 0.9 to 1.5), anywhere (full turn, tilt below 46 deg, depth 0.9 to 1.8)",
        },
        ParameterSpec { name: "b_i", default: "0.1", meaning: "standard deviation of the start about the truth, >= 0" },
        ParameterSpec { name: "b_p", default: "0", meaning: "standard deviation of the image noise, >= 0" },
        ParameterSpec {
            name: "b_m",
            default: "none",
            meaning: "mismatches: a point is kept if |randn| <= b_m; or none",
        },
        ParameterSpec { name: "outliers", default: "0", meaning: "outliers in a blob at (-0.6, -0.4) of width 0.05" },
        ParameterSpec {
            name: "uniform_outliers",
            default: "0",
            meaning: "outliers uniform in the image's bounding box enlarged by a fifth",
        },
        ParameterSpec { name: "hidden", default: "0", meaning: "share of the curve that the target lacks: one arc" },
        ParameterSpec {
            name: "hidden_source",
            default: "0",
            meaning: "share of the curve that the source lacks: one arc",
        },
        ParameterSpec {
            name: "second_curve",
            default: "0",
            meaning: "points of another curve in the image, as a share of the curve's points",
        },
        ParameterSpec {
            name: "source_noise",
            default: "0",
            meaning: "standard deviation of the noise of the source, in its units, >= 0",
        },
        ParameterSpec {
            name: "start",
            default: "guess",
            meaning: "guess (the truth disturbed by b_i) or none: the method finds its own",
        },
        ParameterSpec {
            name: "order",
            default: "curve",
            meaning: "curve (source and image in curve order) or shuffled (both permuted, the source not marked as a curve)",
        },
    ],
    source: "section IV.C, Table I (a), (b) and the paragraph on outliers",
    build: |parameters| Ok(Box::new(PlanarCurve::new(parameters)?)),
};
