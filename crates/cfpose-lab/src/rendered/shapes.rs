//! Outlines of the rendered patterns.

use rand::RngExt;
use rand_chacha::ChaCha12Rng;
use rand_distr::StandardNormal;

use crate::curves;

/// Number of corners.
const CORNERS: usize = 1500;

/// Draw a shape: heart, flower, blob or a random star shape, largest absolute coordinate `scale`.
pub(super) fn draw(rng: &mut ChaCha12Rng, scale: f64) -> Vec<[f64; 2]> {
    match rng.random_range(0..5) {
        0 => named("heart", scale),
        1 => named("flower", scale),
        2 => named("blob", scale),
        _ => star(rng, scale),
    }
}

/// Return a shape of the table of curves; heart and the like have y up there, down here.
pub(super) fn named(name: &str, scale: f64) -> Vec<[f64; 2]> {
    let all = curves::points(name, scale).unwrap_or_default();
    all.iter().step_by(2).map(|p| [p[0], -p[1]]).collect()
}

/// Draw a star shape: radius 1 + sum of .35 / (1.6 k) (a cos k t + b sin k t), k = 1..6, a and b normal; at least .25.
pub(super) fn star(rng: &mut ChaCha12Rng, scale: f64) -> Vec<[f64; 2]> {
    let terms: Vec<[f64; 2]> =
        (1..=6).map(|k| [0, 1].map(|_| rng.sample::<f64, _>(StandardNormal) * 0.35 / (1.6 * f64::from(k)))).collect();
    let mut places: Vec<[f64; 2]> = (0..CORNERS)
        .map(|i| i as f64 / CORNERS as f64 * std::f64::consts::TAU)
        .map(|t| {
            let sum: f64 =
                (1..).zip(&terms).map(|(k, [a, b])| a * (f64::from(k) * t).cos() + b * (f64::from(k) * t).sin()).sum();
            let radius = (1.0 + sum).max(0.25);
            [radius * t.cos(), radius * t.sin()]
        })
        .collect();
    for d in 0..2 {
        let (low, high) = places.iter().map(|p| p[d]).fold((f64::MAX, f64::MIN), |(a, b), x| (a.min(x), b.max(x)));
        places.iter_mut().for_each(|p| p[d] -= (low + high) / 2.0);
    }
    let largest = places.iter().flatten().fold(0.0_f64, |a, b| a.max(b.abs()));
    places.iter_mut().flatten().for_each(|v| *v *= scale / largest);
    places
}

/// Return an ellipse.
pub(super) fn ellipse(centre: [f64; 2], radii: [f64; 2], angle: f64) -> Vec<[f64; 2]> {
    let (sine, cosine) = angle.sin_cos();
    (0..96)
        .map(|k| f64::from(k) / 96.0 * std::f64::consts::TAU)
        .map(|t| [radii[0] * t.cos(), radii[1] * t.sin()])
        .map(|[x, y]| [centre[0] + x * cosine - y * sine, centre[1] + x * sine + y * cosine])
        .collect()
}

/// Say whether a place lies in a polygon.
pub(super) fn contains(polygon: &[[f64; 2]], place: [f64; 2]) -> bool {
    let mut inside = false;
    for (k, a) in polygon.iter().enumerate() {
        let b = polygon[(k + 1) % polygon.len()];
        if (a[1] > place[1]) != (b[1] > place[1]) {
            let x = a[0] + (place[1] - a[1]) / (b[1] - a[1]) * (b[0] - a[0]);
            inside ^= place[0] < x;
        }
    }
    inside
}
