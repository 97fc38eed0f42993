//! A hunt for wrong answers that are called good: two clouds in space, every condition drawn at random.

use cfpose::entry::{EntryError, ParameterSpec, Parameters};
use cfpose::theta::Layout;
use cfpose::{Points, Pose, PoseError, Side};
use cfpose_optim::manifold::{multiply3, rotation_of_quaternion};
use rand::RngExt;
use rand_chacha::ChaCha12Rng;
use rand_distr::StandardNormal;

use crate::sampling::{add_uniform, shuffle};
use crate::scenario::{Determined, Scenario, ScenarioEntry, ScenarioError, Success, Trial};

pub(super) mod body;

use body::{Body, Kind};

/// A surface in space and its moved copy. Draws of a trial, in this order: N (log uniform, 20 to 3000), the body ([`Body::draw`]), whether the
/// target is another body (8 %) or its mirror image (4 %), the sampling (the same points 50 %, else anew), the noise (one of 0,
/// .002, .005, .01, .02, .03 of the radius) and whether the source has it too (30 %), the cut of the target by a plane (25 %: 5 to 40 % of it
/// lost), the clutter (35 %: 5 to 50 % of N, uniform in 1.2 times the bounding box), the rotation (uniform), the translation
/// (normal, .5), the scale (similarity3: .5 to 2), then the points.
struct HuntSpace {
    model: &'static str,
    points: Option<usize>,
    clean: bool,
    kind: Option<Kind>,
    offset: f64,
    unit: f64,
}

const KINDS: [(&str, Option<Kind>); 8] = [
    ("any", None),
    ("star", Some(Kind::Star)),
    ("bump", Some(Kind::Bump)),
    ("cup", Some(Kind::Cup)),
    ("revolution", Some(Kind::Revolution)),
    ("box", Some(Kind::Box)),
    ("cube", Some(Kind::Cube)),
    ("plate", Some(Kind::Plate)),
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

impl Scenario for HuntSpace {
    fn model(&self) -> &str {
        self.model
    }

    fn trial(&self, rng: &mut ChaCha12Rng) -> Result<Trial, ScenarioError> {
        let drawn = (20.0 * 150.0_f64.powf(rng.random())).round() as usize;
        let count = self.points.unwrap_or(drawn);
        let drawn = Body::draw(rng);
        let body = self.kind.map_or(drawn, |kind| Body::of(kind, rng));
        let fate: f64 = rng.random();
        // The mirror image of a body with a plane of symmetry is the body itself.
        let chiral = matches!(body.kind, Kind::Star | Kind::Bump);
        let mirrored = (0.08..0.12).contains(&fate) && !self.clean && chiral;
        let foreign = fate < 0.08 && !self.clean;
        let same = rng.random::<f64>() < 0.5;
        let noise = [0.0, 0.002, 0.005, 0.01, 0.02, 0.03][rng.random_range(0..6)];
        let both = rng.random::<f64>() < 0.3;
        let cut = if rng.random::<f64>() < 0.25 && !self.clean { rng.random_range(0.05..0.4) } else { 0.0 };
        let clutter = if rng.random::<f64>() < 0.35 && !self.clean { rng.random_range(0.05..0.5) } else { 0.0 };
        let quaternion: [f64; 4] = std::array::from_fn(|_| rng.sample(StandardNormal));
        let rotation = rotation_of_quaternion(&quaternion);
        let translation: [f64; 3] = std::array::from_fn(|_| 0.5 * rng.sample::<f64, _>(StandardNormal));
        let log_scale = rng.random_range(-0.69..0.69_f64);
        let scale = if self.model == "similarity3" { log_scale.exp() } else { 1.0 };

        let mut source = body.sample(count, rng);
        let mut target = match (foreign, same) {
            (true, _) => Body::of(Kind::Star, rng).sample(count, rng),
            (false, true) => source.clone(),
            (false, false) => body.sample(count, rng),
        };
        if mirrored {
            target.iter_mut().for_each(|q| q[0] = -q[0]);
        }
        if cut > 0.0 {
            let axis = crate::shapes::direction(rng);
            let along = |p: &[f64; 3]| (0..3).map(|d| p[d] * axis[d]).sum::<f64>();
            target.sort_by(|a, b| along(a).total_cmp(&along(b)));
            target.truncate(((1.0 - cut) * count as f64).round() as usize);
        }
        let pose = Pose { rotation, translation: [0.0; 3] };
        let moved = |p: [f64; 3]| {
            let turned = pose.apply(p);
            std::array::from_fn(|d| scale * turned[d] + translation[d])
        };
        target.iter_mut().for_each(|q| *q = moved(*q));
        disturb(&mut target, noise * scale, rng);
        if both {
            disturb(&mut source, noise, rng);
        }
        let strays = (clutter * target.len() as f64).round() as usize;
        add_uniform(&mut target, strays, rng);
        shuffle(&mut target, rng);
        shuffle(&mut source, rng);

        // x -> unit x + offset on both sides.
        let place = |p: &mut [f64; 3]| *p = p.map(|x| self.unit * x + self.offset);
        source.iter_mut().for_each(place);
        target.iter_mut().for_each(place);
        let theta_of = |symmetry: &[f64; 9]| {
            let turned = multiply3(&rotation, symmetry);
            let shifted: Vec<f64> = (0..3)
                .map(|i| {
                    let of_offset: f64 = (0..3).map(|k| scale * turned[3 * i + k] * self.offset).sum();
                    self.unit * translation[i] + self.offset - of_offset
                })
                .collect();
            match self.model {
                "similarity3" => turned.iter().copied().chain(shifted).chain([scale]).collect::<Vec<f64>>(),
                _ => turned.iter().copied().chain(shifted).collect(),
            }
        };
        let points = |side, rows: &[[f64; 3]]| {
            Points::from_rows(rows).map_err(|problem| ScenarioError::Points { side, problem })
        };
        let success = Success::Parts { angle: 5.0_f64.to_radians(), translation: 0.05 };
        let mut thetas = body.symmetries().iter().map(theta_of).collect::<Vec<_>>();
        let truth = thetas.remove(0);
        let mut trial = Trial::new(points(Side::Source, &source)?, points(Side::Target, &target)?, truth, success);
        trial.equally_true = thetas;
        trial.determined = match (foreign || mirrored, same) {
            (true, _) => Determined::Nothing,
            // The pattern of the points tells symmetric poses apart, where the noise does not hide it.
            (false, true) => Determined::Theta,
            (false, false) => body.determined(),
        };
        let word = |value: bool, yes: &str, no: &str| if value { yes } else { no }.to_string();
        let size = [50, 100, 200, 300, 1000, 3001].into_iter().find(|most| count <= *most).unwrap_or(usize::MAX);
        trial.conditions = vec![
            ("N", format!("<= {size}")),
            ("body", format!("{:?}", body.kind).to_lowercase()),
            ("noise", noise.to_string()),
            ("noise on", word(both, "both sides", "the target")),
            ("sampling", word(same, "same", "independent")),
            ("cut", word(cut > 0.0, "yes", "no")),
            ("clutter", word(clutter > 0.0, "yes", "no")),
            ("target", word(foreign, "another body", if mirrored { "mirrored" } else { "the body" })),
        ];
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
        ParameterSpec { name: "body", default: "any", meaning: "any, star, bump, cup, revolution, box, cube or plate" },
        ParameterSpec { name: "offset", default: "0", meaning: "added to every coordinate of both sides" },
        ParameterSpec { name: "unit", default: "1", meaning: "length of the body's radius in the files, > 0" },
    ],
    source: "project; docs/method.md, *How often a verdict is wrong*",
    build: |parameters| Ok(Box::new(HuntSpace::new(parameters)?)),
};
