//! The true theta of a trial, and how far another one is from it.

use std::f64::consts::TAU;

use cfpose::entry::{EntryError, Parameters};
use cfpose::model::{Model, Scene};
use cfpose::problem::map_points;
use cfpose::theta::{BlockKind, Layout};
use cfpose::{Execution, Points, Pose, PoseError, Side};
use cfpose_optim::Manifold;
use cfpose_optim::manifold::rotation_of_quaternion;
use rand::RngExt;
use rand_chacha::ChaCha12Rng;
use rand_distr::StandardNormal;

use super::map::{self, View};
use crate::scenario::ScenarioError;

/// Draws of a theta before a trial is impossible.
const MAX_DRAWS: usize = 500;
/// Largest distance of an image point from the middle, in sizes of the image: beyond it the horizon is near.
const MAX_STRETCH: f64 = 5.0;
/// Sizes of an image, in sizes of the source about the origin, within which a theta is accepted.
const SIZES: std::ops::Range<f64> = 0.1..10.0;

/// Where a trial begins.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Start {
    None,
    Identity,
    Near(f64),
}

/// How the rotations of theta are drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Turn {
    /// By `spread`, as everything else.
    Near,
    /// Uniform over all rotations, before the spread.
    Full,
    /// Uniform about z, and no spread.
    Yaw,
}

/// The distribution of theta.
///
/// A normal of standard deviation `spread` for each tangent coordinate, about the model's identity where the model is a linear map of
/// the plane or of space and about its typical theta where it is projective; with `rotation = full` rotations are uniform before
/// that (four normals, or a uniform for an angle), with `rotation = yaw` they are turns about z, drawn after it (a uniform). Drawn again until every point has an image, no point lies near the horizon,
/// the image's size is .1 to 10, and the model has no more to object than it has to the base.
#[derive(Debug, Clone, Copy)]
pub(super) struct Truth {
    spread: f64,
    turn: Turn,
    pub start: Start,
}

impl Truth {
    pub(super) fn of(parameters: &Parameters) -> Result<Self, EntryError> {
        let not_negative = |v: f64| v >= 0.0 && v.is_finite();
        Ok(Self {
            spread: parameters.number("spread", "a number >= 0", not_negative)?,
            turn: parameters.choice("rotation", &[("near", Turn::Near), ("full", Turn::Full), ("yaw", Turn::Yaw)])?,
            start: match parameters.text("start") {
                "none" => Start::None,
                "identity" => Start::Identity,
                _ => Start::Near(parameters.number("start", "none, identity or a number >= 0", not_negative)?),
            },
        })
    }

    /// Draw theta; `seen` are the points of the scene that the source shows.
    pub(super) fn draw(
        &self,
        view: &View,
        seen: &[[f64; 3]],
        source: &Points,
        rng: &mut ChaCha12Rng,
    ) -> Result<Vec<f64>, ScenarioError> {
        let model = &view.model;
        let base = if model.linear.is_some() { &model.identity } else { &model.typical };
        let objections = |theta: &[f64], image: &[[f64; 3]]| {
            let target = map::points(Side::Target, image, view.target_dim()).ok()?;
            let homogeneous = |points: &Points, dim: usize| match points.dim() < dim {
                true => points.with_constant_coordinate(1.0).ok(),
                false => Some(points.clone()),
            };
            let source = homogeneous(source, model.source.point_dim())?;
            let target = homogeneous(&target, model.target.map().point_dim())?;
            let found = (model.examine)(&Scene { theta, source: &source, target: &target });
            Some(found.warnings.len() + usize::from(found.implausible) + usize::from(found.theta.is_some()))
        };
        let of_base = view.image(base, seen).and_then(|image| objections(base, &image)).unwrap_or(usize::MAX);
        for _ in 0..MAX_DRAWS {
            let theta = match self.turn {
                Turn::Yaw => self.turned(model, &step(model, base, self.spread, rng), rng),
                Turn::Near | Turn::Full => step(model, &self.turned(model, base, rng), self.spread, rng),
            };
            let Some(image) = view.image(&theta, seen) else { continue };
            if is_in_view(&image, view.target_dim()) && objections(&theta, &image).is_some_and(|n| n <= of_base) {
                return Ok(theta);
            }
        }
        Err(ScenarioError::Impossible(format!(
            "none of {MAX_DRAWS} drawn thetas shows the whole shape; choose a smaller spread"
        )))
    }

    /// Turn theta uniformly: about all axes, about z, or not at all.
    fn turned(&self, model: &Model, base: &[f64], rng: &mut ChaCha12Rng) -> Vec<f64> {
        let mut theta = base.to_vec();
        if self.turn == Turn::Near {
            return theta;
        }
        let mut at = 0;
        for block in model.layout.blocks() {
            match block.kind {
                BlockKind::Rotation => {
                    let quaternion = match self.turn {
                        Turn::Yaw => {
                            let half = std::f64::consts::PI * rng.random::<f64>();
                            [half.cos(), 0.0, 0.0, half.sin()]
                        }
                        _ => std::array::from_fn(|_| rng.sample(StandardNormal)),
                    };
                    theta[at..at + 9].copy_from_slice(&rotation_of_quaternion(&quaternion));
                }
                BlockKind::Angle => theta[at] = TAU * (rng.random::<f64>() - 0.5),
                _ => {}
            }
            at += block.kind.manifold().ambient();
        }
        theta
    }
}

fn is_in_view(image: &[[f64; 3]], dim: usize) -> bool {
    let size = map::size(image, dim);
    let count = image.len() as f64;
    let mean: Vec<f64> = (0..dim).map(|d| image.iter().map(|q| q[d]).sum::<f64>() / count).collect();
    let farthest =
        image.iter().map(|q| (0..dim).map(|d| (q[d] - mean[d]).powi(2)).sum::<f64>()).fold(0.0, f64::max).sqrt();
    SIZES.contains(&size) && farthest <= MAX_STRETCH * size
}

/// Return theta after a random step: a normal times `spread` for each tangent coordinate.
pub(super) fn step(model: &Model, theta: &[f64], spread: f64, rng: &mut ChaCha12Rng) -> Vec<f64> {
    let manifold = model.layout.manifold();
    let step: Vec<f64> = (0..manifold.tangent()).map(|_| spread * rng.sample::<f64, _>(StandardNormal)).collect();
    let mut moved = vec![0.0; manifold.ambient()];
    manifold.retract(theta, &step, &mut moved);
    moved
}

/// Say whether theta is a rotation of space or of the plane with a translation.
pub(super) fn has_pose(model: &Model) -> bool {
    pose_error(&model.layout, &model.typical, &model.typical, 0.0).is_some()
}

/// Say whether the points may lie far from the origin: linear maps, and poses of bodies.
pub(super) fn can_be_far(model: &Model) -> bool {
    let linear = model.linear.is_some() && model.source.factored().is_some_and(|facts| facts.identity_projection);
    let in_space = model.source.point_dim() == 3 && model.source_points == cfpose::model::PointKind::Plain(3);
    model.layout.range("translation").is_some() && (linear || in_space)
}

/// Return theta for points that are moved by an offset: x -> A x + b becomes x -> A x + b + o - A o; the rays of a camera stay where
/// they are, and T becomes T - R o.
pub(super) fn far(model: &Model, theta: &[f64], offset: f64, dim: usize) -> Vec<f64> {
    let range = model.layout.range("translation").filter(|_| offset != 0.0);
    let Some(range) = range else { return theta.to_vec() };
    let mut moved = theta.to_vec();
    // A o is the difference of the images of o and 0 before any projection.
    let shift = match &model.linear {
        Some(_) => {
            let rows = [[0.0; 3], [offset; 3]];
            let image = map::points(Side::Source, &rows, dim).ok().and_then(|points| {
                map_points(model.source.as_ref(), &model.source.lift(&points), theta, &Execution::default()).ok()
            });
            let Some(image) = image else { return moved };
            let (zero, far) = (image.point(0), image.point(1));
            std::array::from_fn(|d| offset - (far[d] - zero[d]))
        }
        None => {
            let Some(pose) = Pose::of_theta(&model.layout, theta) else { return moved };
            Pose { translation: [0.0; 3], ..pose }.apply([offset; 3]).map(|x| -x)
        }
    };
    moved[range].iter_mut().zip(shift).for_each(|(value, by): (&mut f64, f64)| *value += by);
    moved
}

/// Compare two thetas as poses: the angle between the rotations, and how far apart the images of the middle of the shape (`offset` in
/// every coordinate) are before any projection. A wrong scale counts with the shift. `None` for a theta without a pose.
pub(super) fn pose_error(layout: &Layout, estimate: &[f64], truth: &[f64], offset: f64) -> Option<PoseError> {
    let scale = |theta: &[f64]| layout.range("scale").filter(|at| at.len() == 1).map_or(1.0, |at| theta[at.start]);
    let (angle, shift) = match (layout.range("rotation"), layout.range("angle")) {
        (Some(_), _) => {
            let (a, b) = (Pose::of_theta(layout, estimate)?, Pose::of_theta(layout, truth)?);
            let middle = |pose: &Pose, factor: f64| {
                let turned = Pose { translation: [0.0; 3], ..*pose }.apply([offset; 3]);
                [0, 1, 2].map(|d| factor * turned[d] + pose.translation[d])
            };
            let (p, q) = (middle(&a, scale(estimate)), middle(&b, scale(truth)));
            (PoseError::between(&a, &b).angle, (0..3).map(|d| (p[d] - q[d]).powi(2)).sum::<f64>().sqrt())
        }
        (None, Some(at)) => {
            let translation = layout.range("translation").filter(|range| range.len() == 2)?;
            let middle = |theta: &[f64]| {
                let (sin, cos) = theta[at.start].sin_cos();
                let reach = scale(theta) * offset;
                [reach * (cos - sin) + theta[translation.start], reach * (sin + cos) + theta[translation.start + 1]]
            };
            let (p, q) = (middle(estimate), middle(truth));
            let turn = (estimate[at.start] - truth[at.start] + 0.5 * TAU).rem_euclid(TAU) - 0.5 * TAU;
            (turn.abs(), (p[0] - q[0]).hypot(p[1] - q[1]))
        }
        _ => return None,
    };
    let error = PoseError { angle, translation: shift.hypot(scale(estimate) / scale(truth) - 1.0) };
    error.total().is_finite().then_some(error)
}
