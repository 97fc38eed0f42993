//! The verdict is the truth: default flags of every model, symmetric shapes, directions that nothing determines, units and offsets,
//! exact small sets, chance.

mod common;

use std::f64::consts::TAU;

use cfpose::model::PointKind;
use cfpose::theta::rotation_of_euler;
use cfpose::{
    BuildContext, Estimate, Estimator, Execution, Points, Pose, PoseError, Registry, Settings, Supervision, Verdict,
};
use common::{asymmetric, moved, noisy, permuted, target_of};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha12Rng;

fn solve(settings: &Settings, source: &Points, target: &Points) -> Result<Estimate, cfpose::Error> {
    Estimator::new(&Registry::default(), settings, source, target, &Execution::default())?.solve(Supervision::default())
}

fn auto(model: &str) -> Settings {
    Settings::preset("auto", model).unwrap()
}

fn placed(rows: &[[f64; 3]], pose: &Pose) -> Points {
    Points::from_rows(&rows.iter().map(|p| pose.apply(*p)).collect::<Vec<_>>()).unwrap()
}

fn pose() -> Pose {
    Pose { rotation: rotation_of_euler(&[0.4, -0.3, 1.1]), translation: [0.5, -0.2, 0.3] }
}

#[test]
fn every_model_runs_with_its_default_flags() {
    let registry = Registry::default();
    for spec in registry.models.iter().map(|entry| entry.name) {
        for (case, sigma, fresh) in [("clean", 0.0, false), ("permuted", 0.002, false), ("independent", 0.002, true)] {
            let mut rng = ChaCha12Rng::seed_from_u64(11);
            let kind = registry.model(spec, &BuildContext::default()).unwrap().source_points;
            let source = asymmetric(kind, 300, &mut rng);
            let context = BuildContext { source: Some(&source), ..BuildContext::default() };
            let model = registry.model(spec, &context).unwrap();
            let truth = moved(&model, &model.typical, 0.05, &mut rng);
            let seen = if fresh { asymmetric(kind, 300, &mut rng) } else { source.clone() };
            let image = target_of(&model, &truth, &seen, &mut rng);
            let target = noisy(&image, model.target_points, sigma, &mut rng);
            let target = if case == "clean" { target } else { permuted(&target, &mut rng) };
            let estimate =
                solve(&auto(spec), &source, &target).unwrap_or_else(|error| panic!("{spec}, {case}: {error}"));
            println!("{spec} {case}: {:?} usable {}", estimate.verdict, estimate.usable());
            assert!(estimate.theta.iter().all(|value| value.is_finite()), "{spec}, {case}");
        }
    }
}

/// A curve of n-fold symmetry, sampled anew each time.
fn star(fold: f64, count: usize, rng: &mut ChaCha12Rng) -> Points {
    let rows: Vec<[f64; 2]> = (0..count)
        .map(|_| {
            let t = TAU * rng.random::<f64>();
            let radius = 1.0 + 0.3 * (fold * t).cos() + 0.1 * (2.0 * fold * t + 0.7).sin();
            [radius * t.cos(), radius * t.sin()]
        })
        .collect();
    Points::from_rows(&rows).unwrap()
}

#[test]
fn symmetric_shapes_are_ambiguous_and_every_pose_is_listed() {
    let mut rng = ChaCha12Rng::seed_from_u64(5);
    for fold in [2, 3, 4, 5] {
        let (source, seen) = (star(f64::from(fold), 1000, &mut rng), star(f64::from(fold), 1000, &mut rng));
        let (sin, cos) = 0.3_f64.sin_cos();
        let turn = |k: usize| {
            let (x, y) = (seen.column(0)[k], seen.column(1)[k]);
            [cos * x - sin * y + 0.2, sin * x + cos * y - 0.1]
        };
        let target = Points::from_rows(&(0..seen.len()).map(turn).collect::<Vec<_>>()).unwrap();
        let start = vec![0.3 + TAU / f64::from(fold) + 0.05, 0.2, -0.1];
        let estimate = solve(&auto("rigid2").start_at(start.clone()), &source, &target).unwrap();
        assert_eq!(estimate.verdict, Some(Verdict::Ambiguous), "{fold}-fold: {:?}", estimate.warnings);
        let distance = |theta: &[f64], k: i32| {
            let off = theta[0] - 0.3 - TAU * f64::from(k) / f64::from(fold);
            (off - TAU * (off / TAU).round()).abs()
        };
        assert!(distance(&estimate.theta, 1) < 0.05, "{fold}-fold: the mode of the start is {:?}", estimate.theta);
        let all: Vec<&[f64]> = std::iter::once(estimate.theta.as_slice())
            .chain(estimate.alternatives.iter().map(|other| other.theta.as_slice()))
            .collect();
        for k in 0..fold {
            assert!(all.iter().any(|theta| distance(theta, k) < 0.05), "{fold}-fold: mode {k} is missing in {all:?}");
        }
        assert!(estimate.alternatives.iter().all(|other| other.relative_likelihood.is_some()));
    }
}

/// The surface of a cube, sampled anew each time.
fn cube(count: usize, rng: &mut ChaCha12Rng) -> Vec<[f64; 3]> {
    (0..count)
        .map(|_| {
            let (face, side) = (rng.random_range(0..3), f64::from(2 * rng.random_range(0..2) - 1));
            std::array::from_fn(|d| if d == face { side } else { rng.random_range(-1.0..1.0) })
        })
        .collect()
}

#[test]
fn a_cube_has_twenty_four_poses_and_all_are_listed() {
    let mut rng = ChaCha12Rng::seed_from_u64(9);
    let (source, seen) = (cube(1000, &mut rng), cube(1000, &mut rng));
    let target = noisy(&placed(&seen, &pose()), PointKind::Plain(3), 0.01, &mut rng);
    let estimate = solve(&auto("rigid3"), &Points::from_rows(&source).unwrap(), &target).unwrap();
    assert_eq!(estimate.verdict, Some(Verdict::Ambiguous), "{:?}", estimate.warnings);
    // R' R_0 of every answer is a turn of the cube: its entries are 0, 1 and -1, each of the 24 once.
    let turn = |theta: &[f64]| -> [i32; 9] {
        std::array::from_fn(|at| {
            let entry: f64 = (0..3).map(|k| theta[3 * k + at / 3] * pose().rotation[3 * k + at % 3]).sum();
            assert!((entry - entry.round()).abs() < 0.05, "{entry}");
            entry.round() as i32
        })
    };
    let all = std::iter::once(&estimate.theta).chain(estimate.alternatives.iter().map(|other| &other.theta));
    let turns: std::collections::BTreeSet<[i32; 9]> = all.map(|theta| turn(theta.as_slice())).collect();
    assert_eq!(turns.len(), 24);
}

/// Kernels along the tangents lie outside of a bent surface: with them the scale of these bodies came out .7 % too small, 6 deviations.
#[test]
fn new_samples_of_a_bent_surface_have_the_right_scale() {
    let mut rng = ChaCha12Rng::seed_from_u64(10);
    let mut body = |axes: [f64; 3]| -> Vec<[f64; 3]> {
        (0..400)
            .map(|_| {
                let (turn, z) = (TAU * rng.random::<f64>(), rng.random_range(-1.0..1.0_f64));
                let (u, v) = ((1.0 - z * z).sqrt() * turn.cos(), (1.0 - z * z).sqrt() * turn.sin());
                let radius = 1.0 + 0.3 * u + 0.25 * u * v + 0.2 * v * z * z;
                [axes[0] * radius * u, axes[1] * radius * v, axes[2] * radius * z]
            })
            .collect()
    };
    let (mut off, mut squares) = (0.0, 0.0);
    for axes in [[1.0, 0.8, 0.6], [1.0, 0.9, 0.5], [1.0, 0.7, 0.7], [1.0, 1.0, 0.8]] {
        let (source, seen) = (body(axes), body(axes));
        let target = noisy(&placed(&seen, &pose()), PointKind::Plain(3), 0.005, &mut ChaCha12Rng::seed_from_u64(11));
        let start: Vec<f64> = pose().rotation.iter().chain(&pose().translation).copied().chain([1.0]).collect();
        let settings = auto("similarity3").start_at(start);
        let estimate = solve(&settings, &Points::from_rows(&source).unwrap(), &target).unwrap();
        let (scale, variance) = (estimate.theta[12] - 1.0, estimate.statistics.unwrap().covariance[6 * 7 + 6]);
        println!("scale off by {scale:.5}, sd {:.5}", variance.sqrt());
        off += scale / 4.0;
        squares += scale * scale / variance / 4.0;
    }
    assert!(off.abs() < 0.002 && squares < 4.0, "{off} {squares}");
}

#[test]
fn what_nothing_determines_is_named_and_has_no_variance() {
    let mut rng = ChaCha12Rng::seed_from_u64(8);
    let mut bottle = || -> Vec<[f64; 3]> {
        (0..800)
            .map(|_| {
                let (angle, height) = (TAU * rng.random::<f64>(), rng.random_range(-1.0..1.0_f64));
                let radius = 0.4 + 0.15 * (2.0 * height).sin();
                [radius * angle.cos(), radius * angle.sin(), height]
            })
            .collect()
    };
    let (source, seen) = (bottle(), bottle());
    let estimate = solve(&auto("rigid3"), &Points::from_rows(&source).unwrap(), &placed(&seen, &pose())).unwrap();
    assert_eq!(estimate.verdict, Some(Verdict::Ambiguous), "{:?}", estimate.warnings);
    let found = &estimate.undetermined[0];
    assert!(found.direction[2].abs() > 0.95, "{found:?}");
    assert!(found.words.starts_with("turns about ("), "{}", found.words);
    let statistics = estimate.statistics.unwrap();
    assert!(statistics.covariance[2 * 6 + 2].is_nan() && statistics.covariance[0].is_finite());
}

#[test]
fn units_and_offsets_change_nothing() {
    let mut rng = ChaCha12Rng::seed_from_u64(21);
    let shape = |rng: &mut ChaCha12Rng| asymmetric(PointKind::Plain(3), 2000, rng);
    let (source, seen) = (shape(&mut rng), shape(&mut rng));
    assert_same_in_all_units(&source, &seen, 0.002, &mut rng);
}

/// Noise wider than the reach of the neighbours lets few points stand for all of the source.
#[test]
fn units_and_offsets_change_nothing_about_a_noisy_curve() {
    let mut rng = ChaCha12Rng::seed_from_u64(22);
    let (source, seen) = (space_curve(2000, &mut rng), space_curve(2000, &mut rng));
    assert_same_in_all_units(&source, &seen, 0.05, &mut rng);
}

/// A closed curve in space without symmetry.
fn space_curve(count: usize, rng: &mut ChaCha12Rng) -> Points {
    let point =
        |t: f64| [t.cos() * (1.0 + 0.3 * (2.0 * t).cos()), 0.6 * t.sin(), 0.4 * (3.0 * t).sin() + 0.2 * t.cos()];
    let rows: Vec<[f64; 3]> = (0..count).map(|_| point(std::f64::consts::TAU * rng.random::<f64>())).collect();
    Points::from_rows(&rows).unwrap()
}

fn assert_same_in_all_units(source: &Points, seen: &Points, sigma: f64, rng: &mut ChaCha12Rng) {
    let rows = |points: &Points| (0..points.len()).map(|k| points.point(k)).collect::<Vec<_>>();
    let target = rows(&noisy(&placed(&rows(seen), &pose()), PointKind::Plain(3), sigma, rng));
    let plain = solve(&auto("rigid3"), source, &Points::from_rows(&target).unwrap()).unwrap();
    let truth = PoseError::between(&plain.pose.unwrap(), &pose());
    assert!(truth.total() < 0.05 && plain.verdict == Some(Verdict::Good), "{truth:?} {:?}", plain.warnings);
    for (unit, offset) in [(1e-6, 0.0), (1e6, 0.0), (1.0, 5e5), (1000.0, 4e6)] {
        let place = |rows: &[[f64; 3]]| {
            Points::from_rows(&rows.iter().map(|p| p.map(|x| unit * x + offset)).collect::<Vec<_>>()).unwrap()
        };
        let (p, q) = (place(&rows(source)), place(&target));
        let found = solve(&auto("rigid3"), &p, &q).unwrap();
        let found_pose = found.pose.unwrap();
        // Where the source's first point goes, in units of the shape.
        let there = found_pose.apply(p.point(0)).map(|x| (x - offset) / unit);
        let plain_there = plain.pose.unwrap().apply(source.point(0));
        let shift = (0..3).map(|d| (there[d] - plain_there[d]).powi(2)).sum::<f64>().sqrt();
        let precision = 1e-6;
        println!("unit {unit}, offset {offset}: shift {shift:.2e}, {:?}", found.verdict);
        assert_eq!(found.verdict, plain.verdict, "unit {unit}, offset {offset}: {:?}", found.warnings);
        assert!(shift < precision, "unit {unit}, offset {offset}: {shift}");
    }
}

#[test]
fn exact_small_sets_are_good_and_unrelated_ones_never() {
    let (mut good, mut trials) = (0, 0);
    for seed in 0..24 {
        let mut rng = ChaCha12Rng::seed_from_u64(300 + seed);
        let count = 8 + 2 * (seed as usize % 12);
        let mut cloud =
            || (0..count).map(|_| std::array::from_fn(|_| rng.random_range(-1.0..1.0))).collect::<Vec<[f64; 3]>>();
        let (source, other) = (cloud(), cloud());
        let points = Points::from_rows(&source).unwrap();
        let target = permuted(&placed(&source, &pose()), &mut ChaCha12Rng::seed_from_u64(seed));
        let estimate = solve(&auto("rigid3"), &points, &target).unwrap();
        trials += 1;
        good += usize::from(estimate.verdict == Some(Verdict::Good));
        if estimate.verdict == Some(Verdict::Good) {
            assert!(PoseError::between(&estimate.pose.unwrap(), &pose()).total() < 1e-3, "{count} points");
        } else {
            println!("{count} points: {:?} {:?}", estimate.verdict, estimate.warnings);
        }
        let unrelated = solve(&auto("rigid3"), &points, &placed(&other, &pose())).unwrap();
        assert_ne!(unrelated.verdict, Some(Verdict::Good), "{count} unrelated points");
    }
    assert!(10 * good >= 9 * trials, "{good} of {trials} exact sets are good");
}
