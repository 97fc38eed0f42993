//! A hunt for wrong answers that are called good: two clouds in space, every condition drawn at random.

use cfpose::entry::{EntryError, ParameterSpec, Parameters};
use cfpose::theta::Layout;
use cfpose::{Points, Pose, PoseError, Side};
use cfpose_optim::manifold::multiply3;
use rand::RngExt;
use rand_chacha::ChaCha12Rng;
use rand_distr::StandardNormal;

use crate::sampling::{add_uniform, cut_by_plane, shuffle};
use crate::scenario::{Scenario, ScenarioEntry, ScenarioError, Success, Trial};

mod body;
mod conditions;

use body::{Body, Kind};
use conditions::Conditions;

/// A surface in space and its moved copy. Which conditions a trial has, in which order they are drawn and how often: [`Conditions`].
///
/// Draws after the conditions: the points of the source, of the target, the direction of the cut, the noise of the target and of the
/// source (three normals a point), the clutter (uniform in 1.2 times the bounding box), the orders of target and source.
struct HuntSpace {
    model: &'static str,
    points: Option<usize>,
    clean: bool,
    kind: Option<Kind>,
    offset: f64,
    unit: f64,
}

const KINDS: [(&str, Option<Kind>); 14] = [
    ("any", None),
    ("star", Some(Kind::Star)),
    ("bump", Some(Kind::Bump)),
    ("cup", Some(Kind::Cup)),
    ("revolution", Some(Kind::Revolution)),
    ("box", Some(Kind::Box)),
    ("cube", Some(Kind::Cube)),
    ("plate", Some(Kind::Plate)),
    ("sphere", Some(Kind::Sphere)),
    ("cylinder", Some(Kind::Cylinder)),
    ("torus", Some(Kind::Torus)),
    ("disk", Some(Kind::Disk)),
    ("ring", Some(Kind::Ring)),
    ("rod", Some(Kind::Rod)),
];

impl HuntSpace {
    fn new(parameters: &Parameters) -> Result<Self, EntryError> {
        let points = match parameters.text("points") {
            "any" => None,
            _ => Some(parameters.count("points", 8, 1_000_000)?),
        };
        Ok(Self {
            model: parameters.choice("model", &[("rigid3", "rigid3"), ("similarity3", "similarity3")])?,
            points,
            clean: parameters.choice("damage", &[("any", false), ("none", true)])?,
            kind: parameters.choice("body", &KINDS)?,
            offset: parameters.number("offset", "a finite number", f64::is_finite)?,
            unit: parameters.number("unit", "a number above 0", |v| v > 0.0 && v.is_finite())?,
        })
    }
}

/// Add noise to every coordinate.
fn disturb(points: &mut [[f64; 3]], sigma: f64, rng: &mut ChaCha12Rng) {
    points.iter_mut().flatten().for_each(|x| *x += sigma * rng.sample::<f64, _>(StandardNormal));
}

impl Conditions {
    /// Draw both sides about the origin, in radii of the body.
    fn sides(&self, rng: &mut ChaCha12Rng) -> (Vec<[f64; 3]>, Vec<[f64; 3]>) {
        let mut source = self.body.sample(self.count, rng);
        let mut target = match (self.foreign, self.same) {
            (true, _) => Body::of(Kind::Star, rng).sample(self.count, rng),
            (false, true) => source.clone(),
            (false, false) => self.body.sample(self.count, rng),
        };
        if self.mirrored {
            target.iter_mut().for_each(|q| q[0] = -q[0]);
        }
        if self.cut > 0.0 {
            cut_by_plane(&mut target, ((1.0 - self.cut) * self.count as f64).round() as usize, rng);
        }
        let turn = Pose { rotation: self.rotation, translation: [0.0; 3] };
        for q in &mut target {
            let turned = turn.apply(*q);
            *q = std::array::from_fn(|d| self.scale * turned[d] + self.translation[d]);
        }
        disturb(&mut target, self.noise * self.scale, rng);
        if self.both {
            disturb(&mut source, self.noise, rng);
        }
        let strays = (self.clutter * target.len() as f64).round() as usize;
        add_uniform(&mut target, strays, rng);
        shuffle(&mut target, rng);
        shuffle(&mut source, rng);
        (source, target)
    }
}

impl HuntSpace {
    /// Put a point where the files have it.
    fn place(&self, p: &[f64; 3]) -> [f64; 3] {
        p.map(|x| self.unit * x + self.offset)
    }

    /// Return theta in the coordinates of the files, after a symmetry of the body.
    fn theta(&self, conditions: &Conditions, symmetry: &[f64; 9]) -> Vec<f64> {
        let turned = multiply3(&conditions.rotation, symmetry);
        let shift = |i: usize| {
            let of_offset: f64 = (0..3).map(|k| conditions.scale * turned[3 * i + k] * self.offset).sum();
            self.unit * conditions.translation[i] + self.offset - of_offset
        };
        let pose = turned.iter().copied().chain((0..3).map(shift));
        match self.model {
            "similarity3" => pose.chain([conditions.scale]).collect(),
            _ => pose.collect(),
        }
    }
}

impl Scenario for HuntSpace {
    fn model(&self) -> &str {
        self.model
    }

    fn trial(&self, rng: &mut ChaCha12Rng) -> Result<Trial, ScenarioError> {
        let conditions = Conditions::draw(self, rng);
        let (source, target) = conditions.sides(rng);
        let points = |side, rows: &[[f64; 3]]| {
            let placed: Vec<[f64; 3]> = rows.iter().map(|p| self.place(p)).collect();
            Points::from_rows(&placed).map_err(|problem| ScenarioError::Points { side, problem })
        };
        let mut thetas: Vec<Vec<f64>> =
            conditions.body.symmetries().iter().map(|symmetry| self.theta(&conditions, symmetry)).collect();
        let truth = thetas.remove(0);
        let success = Success::Parts { angle: 5.0_f64.to_radians(), translation: 0.05 };
        let mut trial = Trial::new(points(Side::Source, &source)?, points(Side::Target, &target)?, truth, success);
        trial.equally_true = thetas;
        trial.determined = conditions.determined();
        trial.conditions = conditions.named();
        Ok(trial)
    }

    /// The translation is compared at the body's centre, in radii; a wrong scale counts with it.
    fn error(&self, layout: &Layout, estimate: &[f64], truth: &[f64]) -> Option<PoseError> {
        let scale = |theta: &[f64]| layout.range("scale").map_or(1.0, |at| theta[at.start]);
        let centre = |theta: &[f64]| -> Option<[f64; 3]> {
            let pose = Pose::of_theta(layout, theta)?;
            let factor = scale(theta);
            let turned = Pose { translation: [0.0; 3], ..pose }.apply([self.offset; 3]);
            Some(std::array::from_fn(|d| factor * turned[d] + pose.translation[d]))
        };
        let (a, b) = (centre(estimate)?, centre(truth)?);
        let size = self.unit * scale(truth);
        let shift = (0..3).map(|d| (a[d] - b[d]).powi(2)).sum::<f64>().sqrt() / size;
        let (pose, true_pose) = (Pose::of_theta(layout, estimate)?, Pose::of_theta(layout, truth)?);
        let angle = PoseError::between(&pose, &true_pose).angle;
        let error = PoseError { angle, translation: shift.hypot(scale(estimate) / scale(truth) - 1.0) };
        error.total().is_finite().then_some(error)
    }
}

pub(super) const ENTRY: ScenarioEntry = ScenarioEntry {
    name: "hunt-space",
    summary: "conditions at random: bodies in space, N 20 to 3000, sampling, noise, cuts, clutter, symmetries, impostors; success below 5 deg and .05",
    parameters: &[
        ParameterSpec { name: "model", default: "rigid3", meaning: "rigid3 or similarity3" },
        ParameterSpec {
            name: "points",
            default: "any",
            meaning: "number of source points, 8 to 1000000, or any: 20 to 3000 at random",
        },
        ParameterSpec { name: "damage", default: "any", meaning: "any, or none: no cut, clutter, impostors" },
        ParameterSpec {
            name: "body",
            default: "any",
            meaning: "star, bump, cup, revolution, box, cube, plate, any of these, sphere, cylinder, torus, disk, ring or rod",
        },
        ParameterSpec { name: "offset", default: "0", meaning: "added to every coordinate of both sides" },
        ParameterSpec { name: "unit", default: "1", meaning: "length of the body's radius in the files, > 0" },
    ],
    source: "project; docs/method.md, *How often a verdict is wrong*",
    build: |parameters| Ok(Box::new(HuntSpace::new(parameters)?)),
};
