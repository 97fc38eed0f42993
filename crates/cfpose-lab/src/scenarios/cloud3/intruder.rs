//! Things with a shape of their own that stand in the target.

use std::f64::consts::TAU;

use cfpose::entry::{EntryError, Parameters};
use cfpose_optim::manifold::rotation_of_quaternion;
use rand::RngExt;
use rand_chacha::ChaCha12Rng;
use rand_distr::StandardNormal;

use crate::shapes::{Shape, Star, direction};

/// What stands in the target beside the shape of radius 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Intruder {
    None,
    /// A ball of normal deviation .1, its middle .8 to 1.4 from that of the shape.
    Blob,
    /// Another surface of radius .4 to .8, its middle 1.2 to 1.8 away.
    Object,
    /// A square of side 4 below the shape, its middle under the shape's.
    Ground,
    /// The shape again, turned at random, its middle 1.8 to 2.6 away.
    Copy,
}

impl Intruder {
    pub fn of(parameters: &Parameters) -> Result<Self, EntryError> {
        parameters.choice(
            "intruder",
            &[
                ("none", Intruder::None),
                ("blob", Intruder::Blob),
                ("object", Intruder::Object),
                ("ground", Intruder::Ground),
                ("copy", Intruder::Copy),
            ],
        )
    }

    /// Draw `count` points of it, in the frame of the shape, which `points` show a part of.
    ///
    /// Draws: for all but the ground a direction (three normals) and a distance; an object then its seed, its radius and its surface
    /// points, a copy its rotation (four normals) and its surface points, a blob three normals a point; the ground a direction, then two
    /// uniforms a point.
    pub fn draw(self, count: usize, points: &[[f64; 3]], shape: &Shape, rng: &mut ChaCha12Rng) -> Vec<[f64; 3]> {
        let away = |range: std::ops::Range<f64>, rng: &mut ChaCha12Rng| {
            let (u, distance) = (direction(rng), rng.random_range(range));
            u.map(|x| distance * x)
        };
        let moved = |rows: Vec<[f64; 3]>, scale: f64, middle: [f64; 3]| -> Vec<[f64; 3]> {
            rows.into_iter().map(|p| std::array::from_fn(|d| middle[d] + scale * p[d])).collect()
        };
        match self {
            Intruder::None => Vec::new(),
            Intruder::Blob => {
                let middle = away(0.8..1.4, rng);
                let normals = (0..count).map(|_| std::array::from_fn(|_| rng.sample(StandardNormal))).collect();
                moved(normals, 0.1, middle)
            }
            Intruder::Object => {
                let middle = away(1.2..1.8, rng);
                let other = Star::new(rng.random_range(1_000_000..2_000_000));
                let radius = rng.random_range(0.4..0.8);
                moved((0..count).map(|_| other.point(direction(rng))).collect(), radius, middle)
            }
            Intruder::Ground => ground(count, points, rng),
            Intruder::Copy => {
                let middle = away(1.8..2.6, rng);
                let quaternion: [f64; 4] = std::array::from_fn(|_| rng.sample(StandardNormal));
                let turn = cfpose::Pose { rotation: rotation_of_quaternion(&quaternion), translation: [0.0; 3] };
                moved(shape.sample(count, rng).into_iter().map(|p| turn.apply(p)).collect(), 1.0, middle)
            }
        }
    }
}

/// Draw points of a square that the points stand on: it touches the lowest of them along a random direction.
fn ground(count: usize, points: &[[f64; 3]], rng: &mut ChaCha12Rng) -> Vec<[f64; 3]> {
    let up = direction(rng);
    let height = |p: &[f64; 3]| p[0] * up[0] + p[1] * up[1] + p[2] * up[2];
    let lowest = points.iter().map(height).fold(f64::INFINITY, f64::min);
    // Two directions in the ground: up is turned about the axis it leans on least.
    let least = (0..3).min_by(|a, b| up[*a].abs().total_cmp(&up[*b].abs())).unwrap_or(0);
    let mut first: [f64; 3] = std::array::from_fn(|d| f64::from(u8::from(d == least)) - up[least] * up[d]);
    let length = cfpose_optim::manifold::norm3(&first);
    first.iter_mut().for_each(|x| *x /= length);
    let second =
        [up[1] * first[2] - up[2] * first[1], up[2] * first[0] - up[0] * first[2], up[0] * first[1] - up[1] * first[0]];
    let turn = TAU * rng.random::<f64>();
    let axes = [turn.cos(), turn.sin()];
    (0..count)
        .map(|_| {
            let [u, v] = [4.0 * (rng.random::<f64>() - 0.5), 4.0 * (rng.random::<f64>() - 0.5)];
            let (a, b) = (u * axes[0] - v * axes[1], u * axes[1] + v * axes[0]);
            std::array::from_fn(|d| lowest * up[d] + a * first[d] + b * second[d])
        })
        .collect()
}
