//! A hunt for wrong answers that are called good: a planar curve in two images, every condition drawn at random.

use std::f64::consts::TAU;

use cfpose::entry::{EntryError, ParameterSpec, Parameters};
use cfpose::theta::{Layout, RotationForm, rotation_of_euler};
use cfpose::{Points, Pose, Side};
use rand::RngExt;
use rand_chacha::ChaCha12Rng;
use rand_distr::StandardNormal;

use crate::sampling::{add_uniform, shuffle};
use crate::scenario::{Determined, Scenario, ScenarioEntry, ScenarioError, Success, Trial};

mod conditions;
mod curve;

use conditions::{Conditions, Occlusion, Outlier, Sampling};
use curve::Curve;

/// Most draws of a pose before the trial is impossible.
const MAX_DRAWS: usize = 1000;
/// Least depth of a curve point.
const MIN_DEPTH: f64 = 0.15;

/// A planar curve of size 1 on the plane z = 1 and its image under R P + T_bar. Which conditions a trial has, in which order
/// they are drawn and how often: [`Conditions`].
///
/// Draws after the conditions: the curve, the pose, parameters of the source points, of the target points, the hidden arcs,
/// the noise (two normals a point), the outliers, the orders of target and source, the start.
struct HuntPlanar {
    points: Option<usize>,
    clean: bool,
    foreign: f64,
}

impl HuntPlanar {
    fn new(parameters: &Parameters) -> Result<Self, EntryError> {
        let points = match parameters.text("points") {
            "any" => None,
            _ => Some(parameters.count("points", 8, 100_000)?),
        };
        Ok(Self {
            points,
            clean: parameters.choice("damage", &[("any", false), ("none", true)])?,
            foreign: parameters.number("foreign", "a share from 0 to 1", |v| (0.0..=1.0).contains(&v))?,
        })
    }
}

impl Conditions {
    /// Draw the parameters of both sides, sorted, and of the target.
    fn parameters(&self, curve: &Curve, rng: &mut ChaCha12Rng) -> (Vec<f64>, Vec<f64>) {
        let regular = |count: usize| (0..count).map(|k| (k as f64 + 0.5) / count as f64).collect::<Vec<f64>>();
        let mut draw = |count: usize| -> Vec<f64> {
            match self.sampling {
                Sampling::Same => regular(count),
                Sampling::Independent => (0..count).map(|_| rng.random()).collect(),
                Sampling::ArcLength => (0..count).map(|_| curve.at_length(rng.random())).collect(),
                Sampling::Modulated => (0..count).map(|_| modulated(rng)).collect(),
            }
        };
        let source = draw(self.num_source);
        let target = if self.sampling == Sampling::Same { source.clone() } else { draw(self.num_target) };
        (source, target)
    }

    /// Hide an arc: a run of parameters of a share of the curve.
    fn hide(&self, side: Occlusion, parameters: &mut Vec<f64>, rng: &mut ChaCha12Rng) {
        if self.occlusion != side && self.occlusion != Occlusion::Both {
            return;
        }
        let (begin, share): (f64, f64) = (rng.random(), rng.random_range(0.03..0.4));
        parameters.retain(|t| (t - begin).rem_euclid(1.0) >= share);
    }

    fn add_outliers(&self, image: &mut Vec<[f64; 2]>, rng: &mut ChaCha12Rng) {
        let count = (self.outlier_share * image.len() as f64).round() as usize;
        let (low, high) = bounds(image);
        let size = [high[0] - low[0], high[1] - low[1]];
        match self.outlier {
            None => {}
            Some(Outlier::Blob) => {
                let centre: [f64; 2] = std::array::from_fn(|d| low[d] + size[d] * rng.random_range(-0.1..1.1));
                let width = 0.05 * size[0].max(size[1]);
                let point = |_| centre.map(|x| x + width * (rng.random::<f64>() - 0.5));
                image.extend((0..count).map(point));
            }
            Some(Outlier::Uniform) => {
                let before = image.len();
                add_uniform(image, count, rng);
                // `add_uniform` takes 1.2 times the extent; the hunt takes 1.6.
                for q in &mut image[before..] {
                    *q = std::array::from_fn(|d| {
                        let centre = low[d] + 0.5 * size[d];
                        centre + (q[d] - centre) * (1.6 / 1.2)
                    });
                }
            }
            Some(Outlier::Curve) => {
                let other = Curve::draw(rng);
                let scale = rng.random_range(0.3..1.0) * size[0].max(size[1]);
                let at: [f64; 2] = std::array::from_fn(|d| low[d] + size[d] * rng.random_range(-0.2..1.2));
                let points = (0..count).map(|_| other.point(rng.random()));
                image.extend(points.map(|p| [at[0] + scale * p[0], at[1] + scale * p[1]]));
            }
        }
    }
}

/// Draw a parameter with density 1 + .8 cos: one side is three times as dense as the other, anew for each set.
fn modulated(rng: &mut ChaCha12Rng) -> f64 {
    loop {
        let (t, u): (f64, f64) = (rng.random(), rng.random());
        if u * 1.8 <= 1.0 + 0.8 * (TAU * t).cos() {
            return t;
        }
    }
}

fn bounds(points: &[[f64; 2]]) -> ([f64; 2], [f64; 2]) {
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for q in points {
        for d in 0..2 {
            low[d] = low[d].min(q[d]);
            high[d] = high[d].max(q[d]);
        }
    }
    (low, high)
}

impl Scenario for HuntPlanar {
    fn model(&self) -> &str {
        "plane-bearing"
    }

    fn trial(&self, rng: &mut ChaCha12Rng) -> Result<Trial, ScenarioError> {
        let conditions = Conditions::draw(self.points, self.clean, self.foreign, rng);
        let curve = Curve::draw(rng);
        let seen = if conditions.foreign { Curve::draw(rng) } else { curve.clone() };
        let impossible = || ScenarioError::Impossible("no pose shows the curve".to_string());
        let (theta, pose) = (0..MAX_DRAWS)
            .map(|_| conditions.pose.draw(rng))
            .find(|(_, pose)| seen.outline().all(|p| pose.apply([p[0], p[1], 1.0])[2] > MIN_DEPTH))
            .ok_or_else(impossible)?;
        let (mut on_source, mut on_target) = conditions.parameters(&curve, rng);
        conditions.hide(Occlusion::Source, &mut on_source, rng);
        conditions.hide(Occlusion::Target, &mut on_target, rng);
        let mut source: Vec<[f64; 2]> = on_source.iter().map(|t| curve.point(*t)).collect();
        let image_of = |p: [f64; 2]| {
            let [x, y, z] = pose.apply([p[0], p[1], 1.0]);
            [x / z, y / z]
        };
        let mut image: Vec<[f64; 2]> = on_target.iter().map(|t| image_of(seen.point(*t))).collect();
        let (low, high) = bounds(&image);
        let noise = conditions.noise * 0.5 * (high[0] - low[0]).max(high[1] - low[1]);
        image.iter_mut().flatten().for_each(|x| *x += noise * rng.sample::<f64, _>(StandardNormal));
        conditions.add_outliers(&mut image, rng);
        shuffle(&mut image, rng);
        shuffle(&mut source, rng);
        let start = conditions.start.map(|b_i| theta.map(|v| v + b_i * rng.sample::<f64, _>(StandardNormal)));
        let points = |side, rows: &[[f64; 2]]| {
            Points::from_rows(rows).map_err(|problem| ScenarioError::Points { side, problem })
        };
        let ambient = |theta: &[f64; 6]| {
            Layout::pose3()
                .from_list(theta, RotationForm::Euler)
                .map_err(|problem| ScenarioError::Impossible(problem.to_string()))
        };
        let mut trial = Trial::new(
            points(Side::Source, &source)?,
            points(Side::Target, &image)?,
            ambient(&theta)?,
            Success::Error(0.1),
        );
        trial.start = start.as_ref().map(ambient).transpose()?;
        trial.determined = if conditions.foreign { Determined::Nothing } else { Determined::Theta };
        trial.conditions = conditions.named();
        Ok(trial)
    }
}

impl conditions::View {
    /// Draw Euler angles and T_bar, and the pose.
    fn draw(self, rng: &mut ChaCha12Rng) -> ([f64; 6], Pose) {
        let theta = match self {
            Self::Table => std::array::from_fn(|j| rng.random_range(-1.0..1.0) * if j < 3 { 0.35 } else { 0.3 }),
            Self::Mild => conditions::anywhere(30.0, 0.8..1.6, rng),
            Self::Wide => conditions::anywhere(60.0, 0.5..3.0, rng),
        };
        let pose = Pose { rotation: rotation_of_euler(&theta[..3]), translation: [theta[3], theta[4], theta[5]] };
        (theta, pose)
    }
}

pub(super) const ENTRY: ScenarioEntry = ScenarioEntry {
    name: "hunt-planar",
    summary: "conditions at random: a planar curve, N 50 to 3142, sampling, noise, hidden arcs, outliers, other curves; success e <= .1",
    parameters: &[
        ParameterSpec {
            name: "points",
            default: "any",
            meaning: "number of source points, 8 to 100000, or any: 50 to 3142 at random",
        },
        ParameterSpec { name: "damage", default: "any", meaning: "any, or none: no hidden arcs, no outliers" },
        ParameterSpec {
            name: "foreign",
            default: "0.08",
            meaning: "share of trials whose target is another curve, so that every answer is wrong",
        },
    ],
    source: "project; docs/method.md, *How often a verdict is wrong*",
    build: |parameters| Ok(Box::new(HuntPlanar::new(parameters)?)),
};
