//! Two clouds on one asymmetric surface, a full random rotation apart.

use cfpose::entry::{EntryError, ParameterSpec, Parameters};
use cfpose::theta::Layout;
use cfpose::{Points, Pose};
use cfpose_optim::manifold::{norm3, rotation_of_quaternion};
use rand::RngExt;
use rand_chacha::ChaCha12Rng;
use rand_distr::StandardNormal;

use crate::scenario::{Scenario, ScenarioEntry, ScenarioError, Success, Trial};
use crate::seed::data_stream;

/// Number of bumps of the surface.
const NUM_BUMPS: usize = 6;

/// A star-shaped surface: x = radius(u) (1, .8, .6) u over unit directions u, with
/// radius(u) = 1 + sum_b height_b exp(sharpness_b (u . centre_b - 1)), scaled to largest norm 1 on a fixed set of directions.
///
/// Six bumps of different height (.2 to .6), sharpness (2 to 8) and random centre leave no symmetry. Drawn from ChaCha12
/// of the shape's own seed (stream "cloud3"): per bump the centre (three normals), the height, the sharpness.
struct Shape {
    bumps: Vec<([f64; 3], f64, f64)>,
    scale: f64,
}

impl Shape {
    fn new(seed: u64) -> Self {
        let mut rng = data_stream(seed, u64::from_be_bytes(*b"cloud3\0\0"));
        let bumps = (0..NUM_BUMPS)
            .map(|_| (direction(&mut rng), 0.2 + 0.4 * rng.random::<f64>(), 2.0 + 6.0 * rng.random::<f64>()))
            .collect();
        let mut shape = Self { bumps, scale: 1.0 };
        let largest = (0..4000).map(|_| norm3(&shape.point(direction(&mut rng)))).fold(0.0, f64::max);
        shape.scale = 1.0 / largest;
        shape
    }

    /// Return the surface point in direction u.
    fn point(&self, u: [f64; 3]) -> [f64; 3] {
        let bump = |(centre, height, sharpness): &([f64; 3], f64, f64)| {
            let cosine: f64 = (0..3).map(|i| u[i] * centre[i]).sum();
            height * (sharpness * (cosine - 1.0)).exp()
        };
        let radius = self.scale * (1.0 + self.bumps.iter().map(bump).sum::<f64>());
        [radius * u[0], 0.8 * radius * u[1], 0.6 * radius * u[2]]
    }
}

/// Draw a direction uniform on the sphere: three normals, divided by their norm.
fn direction(rng: &mut ChaCha12Rng) -> [f64; 3] {
    loop {
        let v: [f64; 3] = std::array::from_fn(|_| rng.sample(StandardNormal));
        let norm = norm3(&v);
        if norm > 1e-9 {
            return v.map(|x| x / norm);
        }
    }
}

/// Two clouds P and Q = R P + T, or Q sampled from the surface anew.
///
/// Random draws of a trial, in this order: the rotation (four normals, a uniform quaternion), the translation (three
/// normals, times `translation`), the directions of the source points, with `sampling = independent` those of the target
/// points, the noise (three normals a target point), the permutation of the target (Fisher-Yates from the end).
struct Cloud3 {
    shape: Shape,
    num_points: usize,
    independent: bool,
    noise: f64,
    translation: f64,
}

impl Scenario for Cloud3 {
    fn model(&self) -> &str {
        "rigid3"
    }

    fn trial(&self, rng: &mut ChaCha12Rng) -> Result<Trial, ScenarioError> {
        let quaternion: [f64; 4] = std::array::from_fn(|_| rng.sample(StandardNormal));
        let translation = std::array::from_fn(|_| self.translation * rng.sample::<f64, _>(StandardNormal));
        let pose = Pose { rotation: rotation_of_quaternion(&quaternion), translation };
        let source: Vec<[f64; 3]> = (0..self.num_points).map(|_| self.shape.point(direction(rng))).collect();
        let mut target = source.clone();
        if self.independent {
            target.iter_mut().for_each(|p| *p = self.shape.point(direction(rng)));
        }
        for q in &mut target {
            *q = pose.apply(*q);
            for x in q {
                *x += self.noise * rng.sample::<f64, _>(StandardNormal);
            }
        }
        for k in (1..target.len()).rev() {
            target.swap(k, rng.random_range(0..=k));
        }
        let points = |side, rows: &[[f64; 3]]| {
            Points::from_rows(rows).map_err(|problem| ScenarioError::Points { side, problem })
        };
        Ok(Trial {
            source: points("source", &source)?,
            target: points("target", &target)?,
            truth: pose.rotation.iter().chain(&pose.translation).copied().collect(),
            start: Layout::pose3().neutral(),
            success: Success::Parts { angle: 5.0_f64.to_radians(), translation: 0.05 },
        })
    }
}

fn build(parameters: &Parameters) -> Result<Box<dyn Scenario>, EntryError> {
    let not_negative = |key| parameters.number(key, "a number >= 0", |v| v >= 0.0 && v.is_finite());
    Ok(Box::new(Cloud3 {
        shape: Shape::new(parameters.parse("shape", "a whole number >= 0")?),
        num_points: parameters.count("points", 4, 10_000_000)?,
        independent: parameters.choice("sampling", &[("permutation", false), ("independent", true)])?,
        noise: not_negative("noise")?,
        translation: not_negative("translation")?,
    }))
}

pub(super) const ENTRY: ScenarioEntry = ScenarioEntry {
    name: "cloud3",
    summary: "3D-3D: clouds on an asymmetric surface of radius 1, full random rotation; success below 5 deg and 0.05",
    parameters: &[
        ParameterSpec { name: "shape", default: "1", meaning: "seed of the surface, a whole number >= 0" },
        ParameterSpec { name: "points", default: "1000", meaning: "points of each cloud, 4 to 10000000" },
        ParameterSpec {
            name: "sampling",
            default: "permutation",
            meaning: "permutation (the same points in another order) or independent (sampled anew)",
        },
        ParameterSpec { name: "noise", default: "0", meaning: "standard deviation of the target's noise, >= 0" },
        ParameterSpec { name: "translation", default: "0.3", meaning: "standard deviation of the translation, >= 0" },
    ],
    source: "project; setting of the 3D-3D experiments of Domokos and Hagege",
    build,
};
