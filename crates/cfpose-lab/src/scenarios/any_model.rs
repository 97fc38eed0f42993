//! A shape and its image under a map of any model of the registry, the map drawn anew each trial.

use std::path::{Path, PathBuf};

use cfpose::entry::{EntryError, ParameterSpec, Parameters};
use cfpose::theta::Layout;
use cfpose::{BuildContext, Points, PoseError, Registry, Side};
use rand::RngExt;
use rand_chacha::ChaCha12Rng;
use rand_distr::StandardNormal;

use crate::metric::{Metric, POSE, Score};
use crate::sampling::{add_uniform, cut_by_plane, shuffle};
use crate::scenario::{Determined, Scenario, ScenarioEntry, ScenarioError, Success, Trial};

mod figure;
mod map;
mod truth;

use figure::{Figure, Kind};
use map::View;
use truth::{Start, Truth};

/// Largest rotation and shift of a success where the images cannot be compared point by point.
const POSE_SUCCESS: Success = Success::Parts { angle: 0.087_266_462_599_716_47, translation: 0.1 };

/// Metrics of models with a pose, of models without one, and of models whose target side moves with theta: there a source point has
/// no image to compare.
const POSE_AND_TRANSFER: &[Metric] = &[POSE[0], POSE[1], POSE[2], TRANSFER];
const ONLY_TRANSFER: &[Metric] = &[TRANSFER];
const TRANSFER: Metric = Metric::error("transfer", "sizes");

/// Two point sets P and Q = h(P, theta) of a model by name.
///
/// Random draws of a trial, in this order: with `shape = random` its seed; the source points (the shape says how); with
/// `hidden_source` the direction of the cut; the order of the source; with `noise_on` source or both its noise (a normal a coordinate);
/// theta, until the image is in view ([`Truth`]); with `sampling = independent` the target points; with `hidden` the
/// direction of the cut; with `noise_on` target or both the noise; the clutter; the order of the target; the start.
struct AnyModel {
    registry: Registry,
    model: String,
    figure: Figure,
    num_points: usize,
    independent: bool,
    varied: bool,
    noise: f64,
    noise_on: [bool; 2],
    hidden: [f64; 2],
    clutter: f64,
    truth: Truth,
    offset: f64,
    tolerance: f64,
    metrics: &'static [Metric],
}

impl AnyModel {
    fn new(parameters: &Parameters) -> Result<Self, EntryError> {
        let registry = parameters.table::<Registry>().cloned().unwrap_or_default();
        let share = |key| parameters.number(key, "a share from 0 to .9", |v| (0.0..=0.9).contains(&v));
        let not_negative = |key| parameters.number(key, "a number >= 0", |v| v >= 0.0 && v.is_finite());
        let model = parameters.text("model").to_string();
        let built = registry
            .model(&model, &BuildContext::default())
            .map_err(|problem| parameters.bad("model", &problem.to_string()))?;
        let metrics = match (built.target.is_moving(), truth::has_pose(&built)) {
            (true, true) => POSE,
            (true, false) => {
                return Err(parameters.bad("model", "its target side moves with theta and theta is no pose"));
            }
            (false, true) => POSE_AND_TRANSFER,
            (false, false) => ONLY_TRANSFER,
        };
        let offset = parameters.number("offset", "a finite number", f64::is_finite)?;
        if offset != 0.0 && !truth::can_be_far(&built) {
            return Err(parameters.bad("offset", "the model takes image points or bends; only 0 is possible"));
        }
        Ok(Self {
            figure: Figure::of(parameters, Kind::of(&built))?,
            num_points: parameters.count("points", 4, 10_000_000)?,
            independent: parameters.choice("sampling", &[("permutation", false), ("independent", true)])?,
            varied: parameters.choice("density", &[("even", false), ("varied", true)])?,
            noise: not_negative("noise")?,
            noise_on: parameters
                .choice("noise_on", &[("target", [false, true]), ("source", [true, false]), ("both", [true, true])])?,
            hidden: [share("hidden_source")?, share("hidden")?],
            clutter: parameters.number("clutter", "a share from 0 to 10", |v| (0.0..=10.0).contains(&v))?,
            truth: Truth::of(parameters)?,
            offset,
            tolerance: parameters.number("tolerance", "a number above 0", |v| v > 0.0)?,
            metrics,
            registry,
            model,
        })
    }

    fn view(&self, source: &Points) -> Result<View, ScenarioError> {
        View::new(&self.registry, &self.model, source)
    }

    /// Cut the share that is hidden off.
    fn hide(&self, side: usize, points: &mut Vec<[f64; 3]>, rng: &mut ChaCha12Rng) {
        if self.hidden[side] > 0.0 {
            let kept = ((1.0 - self.hidden[side]) * points.len() as f64).round() as usize;
            cut_by_plane(points, kept.max(4), rng);
        }
    }

    /// Add the noise of a side, in units of its size.
    fn disturb(&self, side: usize, points: &mut [[f64; 3]], dim: usize, rng: &mut ChaCha12Rng) {
        if self.noise_on[side] {
            let sigma = self.noise * map::size(points, dim);
            let coordinates = points.iter_mut().flat_map(|point| &mut point[..dim]);
            coordinates.for_each(|x| *x += sigma * rng.sample::<f64, _>(StandardNormal));
        }
    }

    /// Map to the image, add clutter and order.
    fn image(
        &self,
        view: &View,
        theta: &[f64],
        scene: &[[f64; 3]],
        rng: &mut ChaCha12Rng,
    ) -> Result<Points, ScenarioError> {
        let dim = view.target_dim();
        let mut image = view
            .image(theta, scene)
            .ok_or_else(|| ScenarioError::Impossible("a target point has no image".to_string()))?;
        self.disturb(1, &mut image, dim, rng);
        let strays = (self.clutter * image.len() as f64).round() as usize;
        match dim {
            3 => add_uniform(&mut image, strays, rng),
            _ => {
                let mut flat: Vec<[f64; 2]> = image.iter().map(|q| [q[0], q[1]]).collect();
                add_uniform(&mut flat, strays, rng);
                image = flat.into_iter().map(|q| [q[0], q[1], 0.0]).collect();
            }
        }
        shuffle(&mut image, rng);
        if view.moves_target() {
            image.iter_mut().for_each(|q| q[..dim].iter_mut().for_each(|x| *x += self.offset));
        }
        map::points(Side::Target, &image, dim)
    }
}

impl Scenario for AnyModel {
    fn model(&self) -> &str {
        &self.model
    }

    fn load(&mut self, folder: &Path) -> Result<(), ScenarioError> {
        self.figure.load(folder, self.num_points)
    }

    fn files(&self) -> Vec<PathBuf> {
        self.figure.file().into_iter().collect()
    }

    fn trial(&self, rng: &mut ChaCha12Rng) -> Result<Trial, ScenarioError> {
        let figure = self.figure.drawn(rng)?;
        let (dim, varied) = (self.figure.dim(), self.varied && self.independent);
        let scene = figure.sample(self.num_points, false, rng);
        let mut seen = scene.clone();
        self.hide(0, &mut seen, rng);
        let mut rows: Vec<[f64; 3]> = seen.iter().map(|p| self.figure.flat(*p)).collect();
        shuffle(&mut rows, rng);
        self.disturb(0, &mut rows, dim, rng);
        let source = map::points(Side::Source, &rows, dim)?;
        let view = self.view(&source)?;
        let theta = self.truth.draw(&view, &seen, &source, rng)?;
        let mut other = if self.independent { figure.sample(self.num_points, varied, rng) } else { scene };
        self.hide(1, &mut other, rng);
        let target = self.image(&view, &theta, &other, rng)?;
        // Both sides are drawn about the origin; the files may be far from it.
        let far = |theta: &[f64]| truth::far(&view.model, theta, self.offset, dim);
        let source = match self.offset {
            0.0 => source,
            offset => map::points(Side::Source, &rows.iter().map(|p| p.map(|x| x + offset)).collect::<Vec<_>>(), dim)?,
        };
        let success = if self.metrics == POSE { POSE_SUCCESS } else { Success::Metric(self.tolerance) };
        let mut trial = Trial::new(source, target, far(&theta), success);
        trial.equally_true = view.equally_true(&theta).iter().map(|theta| far(theta)).collect();
        trial.determined = if trial.equally_true.is_empty() { Determined::Theta } else { Determined::OneOfSeveral };
        Ok(match self.truth.start {
            Start::None => trial,
            Start::Identity => trial.with_start(view.model.identity.clone()),
            Start::Near(spread) => {
                let start = far(&truth::step(&view.model, &theta, spread, rng));
                trial.with_start(start)
            }
        })
    }

    /// The shift is that of the image of the shape's middle, so that it means the same at any offset.
    fn error(&self, layout: &Layout, estimate: &[f64], truth: &[f64]) -> Option<PoseError> {
        truth::pose_error(layout, estimate, truth, self.offset)
    }

    fn metrics(&self) -> &[Metric] {
        self.metrics
    }

    fn score(&self, layout: &Layout, estimate: &[f64], truth: &[f64], trial: &Trial) -> Option<Score> {
        let pose = self.error(layout, estimate, truth).filter(|_| self.metrics != ONLY_TRANSFER);
        let mut values = pose.map_or_else(Vec::new, |error| Score::of_pose(error).values);
        if self.metrics != POSE {
            let view = self.view(&trial.source).ok()?;
            values.push(view.transfer(estimate, truth, &trial.source).unwrap_or(f64::INFINITY));
        }
        (values.len() == self.metrics.len()).then_some(Score { pose, values })
    }

    fn succeeds(&self, score: &Score, trial: &Trial) -> bool {
        match (trial.success, score.values.last()) {
            (Success::Metric(limit), Some(transfer)) => *transfer <= limit,
            _ => trial.success.holds_for(score, self.metrics),
        }
    }
}

const fn parameter(name: &'static str, default: &'static str, meaning: &'static str) -> ParameterSpec {
    ParameterSpec { name, default, meaning }
}

pub(super) const ENTRY: ScenarioEntry = ScenarioEntry {
    name: "any-model",
    summary: "a shape and its image under a map of any model, drawn anew each trial: noise on either side, density, hidden parts, clutter, N",
    parameters: &[
        parameter("model", "rigid3", "any model of the registry, such as affine2, bearing3[relation=plane], epipolar"),
        parameter(
            "shape",
            "random",
            "random (drawn anew each trial); for models of the plane a curve (heart, fourier[seed=K] ...), in space a seed, bunny, or a mesh or point file; of radius 1, image points .5",
        ),
        parameter("points", "1000", "points of each side, 4 to 10000000"),
        parameter(
            "sampling",
            "permutation",
            "permutation (the same points in another order) or independent (sampled anew)",
        ),
        parameter(
            "density",
            "even",
            "even, or varied: samples of the target are up to nine times as dense on one side of the shape (with independent)",
        ),
        parameter(
            "noise",
            "0",
            "standard deviation of the noise in units of the side's size (root mean square radius)",
        ),
        parameter("noise_on", "target", "target, source or both"),
        parameter("hidden", "0", "share of the target that is hidden, cut by a plane of random direction, 0 to .9"),
        parameter("hidden_source", "0", "share of the source that is hidden, 0 to .9"),
        parameter(
            "clutter",
            "0",
            "false points added to the target, as a share of its points; uniform in its bounding box enlarged by a fifth",
        ),
        parameter(
            "spread",
            "0.2",
            "standard deviation of each tangent coordinate of theta about the identity, or about the model's typical theta",
        ),
        parameter(
            "rotation",
            "near",
            "near (by `spread`), full: uniform over all rotations, or yaw: uniform about z alone",
        ),
        parameter(
            "start",
            "none",
            "none, identity, or the standard deviation of each tangent coordinate of the start about the truth",
        ),
        parameter("offset", "0", "added to every coordinate of the source, and of a target in the same space"),
        parameter(
            "tolerance",
            "0.05",
            "success: root mean square distance between the images of the source under estimate and truth, in sizes of the image; epipolar: 5 deg and .1",
        ),
    ],
    source: "project",
    build: |parameters| Ok(Box::new(AnyModel::new(parameters)?)),
};
