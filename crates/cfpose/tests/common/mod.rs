//! Data for any model: a set without symmetry, its image at a theta, thetas nearby.

#![allow(dead_code)] // every test takes what it needs

use cfpose::model::PointKind;
use cfpose::problem::map_points;
use cfpose::{Execution, Model, Points, Pose};
use cfpose_optim::manifold::Manifold;
use rand::RngExt;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha12Rng;
use rand_distr::StandardNormal;

/// A set without symmetry, coordinates within about -0.5..0.5.
pub fn asymmetric(kind: PointKind, count: usize, rng: &mut ChaCha12Rng) -> Points {
    let rows: Vec<[f64; 3]> = (0..count)
        .map(|_| {
            let (u, v, w): (f64, f64, f64) = (rng.random(), rng.random(), rng.random());
            let y = v * v * (0.4 + 0.6 * u);
            [u * (0.6 + 0.4 * v) - 0.4, y - 0.2, 0.8 * w * w * (0.3 + u) + 0.3 * u * y - 0.2]
        })
        .collect();
    let points = match kind {
        PointKind::Plain(1) => Points::from_columns(vec![rows.iter().map(|p| p[0]).collect()]),
        PointKind::Plain(2) => Points::from_rows(&rows.iter().map(|p| [p[0], p[1]]).collect::<Vec<_>>()),
        PointKind::Plain(_) => Points::from_rows(&rows),
        PointKind::Homogeneous => Points::from_rows(&rows.iter().map(|p| [p[0], p[1], 1.0]).collect::<Vec<_>>()),
    };
    points.unwrap()
}

pub fn permuted(points: &Points, rng: &mut ChaCha12Rng) -> Points {
    let mut order: Vec<usize> = (0..points.len()).collect();
    order.shuffle(rng);
    points.select(&order).unwrap()
}

/// Return the noise-free target of a source at theta, weights with the area element.
pub fn target_of(model: &Model, theta: &[f64], source: &Points, rng: &mut ChaCha12Rng) -> Points {
    if model.target.is_moving() {
        // Two views of a general scene: a ray of the first camera at any depth, seen from the second.
        let pose = Pose::of_theta(&model.layout, theta).unwrap();
        let rows: Vec<[f64; 3]> = (0..source.len())
            .map(|k| {
                let depth = 2.0 + 3.0 * rng.random::<f64>();
                pose.apply(source.point(k).map(|value| depth * value))
            })
            .collect();
        return Points::from_rows(&rows).unwrap();
    }
    map_points(model.source.as_ref(), &model.source.lift(source), theta, &Execution::default()).unwrap()
}

/// Return the point one tangent step of the given norm away, in a random direction.
pub fn moved(model: &Model, theta: &[f64], distance: f64, rng: &mut ChaCha12Rng) -> Vec<f64> {
    let manifold = model.layout.manifold();
    let mut gauss = || (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0;
    let step: Vec<f64> = (0..manifold.tangent()).map(|_| gauss()).collect();
    let norm = step.iter().map(|value| value * value).sum::<f64>().sqrt();
    let step: Vec<f64> = step.iter().map(|value| value * distance / norm).collect();
    let mut out = vec![0.0; theta.len()];
    manifold.retract(theta, &step, &mut out);
    out
}

/// Add Gaussian noise to every coordinate, of image points to the first two.
pub fn noisy(points: &Points, kind: PointKind, sigma: f64, rng: &mut ChaCha12Rng) -> Points {
    let moving = if kind == PointKind::Homogeneous { 2 } else { points.dim() };
    let mut column = |d: usize| -> Vec<f64> {
        let noise = |x: &f64| if d < moving { x + sigma * rng.sample::<f64, _>(StandardNormal) } else { *x };
        points.column(d).iter().map(noise).collect()
    };
    Points::from_columns((0..points.dim()).map(&mut column).collect()).unwrap()
}
