//! What a family sees of a shape, and what symmetric and planar shapes hide.

use cfpose::coverage::{Seen, coverage};
use cfpose::{Points, Registry};
use rand::SeedableRng;
use rand_chacha::ChaCha12Rng;
use rand_distr::{Distribution, StandardNormal};

/// Points of a shape in three dimensions, placed off the origin.
fn placed(shape: impl Fn(f64, f64) -> [f64; 3]) -> Points {
    let mut rows = Vec::new();
    for i in 0..40 {
        for j in 0..40 {
            let p = shape((f64::from(i) + 0.5) / 40.0, (f64::from(j) + 0.5) / 40.0);
            rows.push([p[0] + 1.0, p[1] - 0.5, p[2] + 0.2]);
        }
    }
    Points::from_rows(&rows).unwrap()
}

#[test]
fn coverage_names_what_symmetric_and_planar_shapes_hide() {
    use std::f64::consts::TAU;
    let registry = Registry::default();
    let run = |family: &str, points: &Points| coverage(&registry, family, "rigid3", points).unwrap();
    let unseen = |family: &str, points: &Points| -> Vec<(String, String)> {
        let report = run(family, points);
        let unseen = report.directions.iter().filter(|d| d.seen != Seen::Observable);
        unseen.map(|d| (d.motion.clone(), d.reason.clone())).collect()
    };
    let cylinder = placed(|u, v| [0.4 * (TAU * u).cos(), 0.4 * (TAU * u).sin(), 2.0 * v - 1.0]);
    let found = unseen("hermite", &cylinder);
    assert_eq!(found.len(), 1, "{found:?}");
    assert_eq!(found[0].0, "rotation about the axis (0.000, 0.000, 1.000) through (1.000, -0.500, 0.200)");
    assert_eq!(found[0].1, "the shape is symmetric under it");
    assert!(run("hermite", &cylinder).condition.is_infinite());

    // A dish that is not flat and has no symmetry.
    let general = placed(|u, v| [u, 0.7 * v + 0.2 * u * u, 0.4 * u * v + 0.2 * (3.0 * v).sin()]);
    let report = run("hermite", &general);
    assert!(report.is_complete() && report.condition < 100.0, "{report}");

    // A flat shape: separable functions do not see it tilt, cross terms do.
    let flat = placed(|u, v| [u, 0.7 * v + 0.2 * u * u, 0.0]);
    let report = run("trig18", &flat);
    assert!(report.shape.contains("plane with normal (0.000, 0.000, 1.000)"), "{report}");
    let found = unseen("trig18", &flat);
    assert_eq!(found.len(), 2, "{report}");
    for (motion, reason) in &found {
        assert!(motion.starts_with("rotation about the axis"), "{motion}");
        assert_eq!(reason, "`trig18` does not change to first order, `hermite[degree=2]` does");
    }
    assert!(unseen("hermite[degree=2]", &flat).is_empty());

    // Points on a line: the rotation about it moves nothing.
    let line = placed(|u, _| [u, 2.0 * u, 0.0]);
    let found = unseen("hermite", &line);
    assert_eq!((found.len(), found[0].1.as_str()), (1, "no point moves"), "{found:?}");

    // Random points of a sphere: all rotations about its centre vanish up to sampling.
    let mut rng = ChaCha12Rng::seed_from_u64(1);
    let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
    let rows: Vec<[f64; 3]> = (0..2000)
        .map(|_| {
            let p = [normal(), normal(), normal()];
            let norm = (p[0] * p[0] + p[1] * p[1] + p[2] * p[2]).sqrt();
            p.map(|value| value / norm)
        })
        .collect();
    let found = unseen("hermite", &Points::from_rows(&rows).unwrap());
    assert_eq!(found.len(), 3, "{found:?}");
    assert!(found.iter().all(|(motion, reason)| motion.contains("rotation") && reason.contains("number of points")));
}
