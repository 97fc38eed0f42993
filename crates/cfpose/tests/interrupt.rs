//! A deadline and a cancel flag hold for the whole estimate, and points without weight do not count.

mod common;

use std::sync::atomic::AtomicBool;
use std::time::Duration;

use cfpose::theta::rotation_of_euler;
use cfpose::{Estimate, Estimator, Execution, Points, Pose, Registry, Settings, Supervision, Verdict};
use cfpose_optim::{Observer, Status, TraceRow};
use common::permuted;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha12Rng;

fn body(count: usize, rng: &mut ChaCha12Rng) -> Vec<[f64; 3]> {
    let point = |rng: &mut ChaCha12Rng| {
        let v: [f64; 3] = std::array::from_fn(|_| rng.random_range(-1.0..1.0));
        let length = v.iter().map(|x| x * x).sum::<f64>().sqrt().max(0.1);
        let radius = 1.0 + 0.3 * (3.0 * v[0] / length).sin() + 0.2 * (v[1] / length).powi(2);
        v.map(|x| x / length * radius)
    };
    (0..count).map(|_| point(rng)).collect()
}

/// A body and its half, seen from elsewhere: what takes longest.
fn half_missing(count: usize) -> (Points, Points) {
    let mut rng = ChaCha12Rng::seed_from_u64(5);
    let rows = body(count, &mut rng);
    let pose = Pose { rotation: rotation_of_euler(&[0.4, -0.3, 1.1]), translation: [0.5, -0.2, 0.3] };
    let seen: Vec<[f64; 3]> = rows.iter().filter(|p| p[0] > 0.0).map(|p| pose.apply(*p)).collect();
    (Points::from_rows(&rows).unwrap(), permuted(&Points::from_rows(&seen).unwrap(), &mut rng))
}

fn estimator(source: &Points, target: &Points) -> Estimator {
    let settings = Settings::preset("auto", "rigid3").unwrap();
    Estimator::new(&Registry::default(), &settings, source, target, &Execution::default()).unwrap()
}

/// The same, but the means are led somewhere on so few points first.
fn exploring(explored: usize, source: &Points, target: &Points) -> Estimator {
    let mut pipeline = estimator(source, target).pipeline().clone();
    pipeline.criteria.explored = explored;
    let settings = Settings { pipeline: Some(pipeline), ..Settings::preset("auto", "rigid3").unwrap() };
    Estimator::new(&Registry::default(), &settings, source, target, &Execution::default()).unwrap()
}

/// Raises the flag after so many iterations.
struct Raise<'a>(&'a AtomicBool, usize);

impl Observer for Raise<'_> {
    fn iteration(&mut self, _row: &TraceRow, _theta: &[f64]) {
        match self.1 {
            0 => self.0.store(true, std::sync::atomic::Ordering::Relaxed),
            _ => self.1 -= 1,
        }
    }
}

fn is_the_best_so_far(estimate: &Estimate, status: Status) {
    assert_eq!(estimate.outcome.status, status);
    assert!(estimate.theta.iter().all(|value| value.is_finite()), "{:?}", estimate.theta);
    assert!(matches!(estimate.verdict, Some(Verdict::Suspect | Verdict::Failed)), "{:?}", estimate.verdict);
    assert!(estimate.alternatives.is_empty());
}

#[test]
fn a_flag_that_is_up_before_the_call_ends_it_at_once() {
    let (source, target) = half_missing(2000);
    let flag = AtomicBool::new(true);
    let estimate =
        estimator(&source, &target).solve(Supervision { cancel: Some(&flag), ..Supervision::default() }).unwrap();
    is_the_best_so_far(&estimate, Status::Cancelled);
    assert_eq!(estimate.iterations, 0);
}

#[test]
fn a_flag_that_goes_up_at_any_moment_ends_the_search_with_the_best_so_far() {
    let (source, target) = half_missing(600);
    for estimator in [estimator(&source, &target), exploring(100, &source, &target)] {
        let whole = estimator.solve(Supervision::default()).unwrap();
        for moment in [0, 1, 7, 40, 90] {
            let flag = AtomicBool::new(false);
            let mut observer = Raise(&flag, moment);
            let supervision = Supervision { cancel: Some(&flag), deadline: None, observer: Some(&mut observer) };
            let estimate = estimator.solve(supervision).unwrap();
            is_the_best_so_far(&estimate, Status::Cancelled);
            assert!(estimate.usable() && estimate.iterations <= moment + 1, "{} after {moment}", estimate.iterations);
            assert!(estimate.iterations < whole.iterations);
        }
    }
}

#[test]
fn a_deadline_ends_every_preset_with_the_best_so_far() {
    let (source, target) = half_missing(2000);
    let estimate =
        estimator(&source, &target).solve(Supervision { deadline: Some(Duration::ZERO), ..Supervision::default() });
    is_the_best_so_far(&estimate.unwrap(), Status::Deadline);
    let settings = Settings::preset("paper", "rigid3").unwrap().features("hermite[degree=3]");
    let paper = Estimator::new(&Registry::default(), &settings, &source, &target, &Execution::default()).unwrap();
    let estimate = paper.solve(Supervision { deadline: Some(Duration::ZERO), ..Supervision::default() }).unwrap();
    assert_eq!(estimate.outcome.status, Status::Deadline);
    assert_ne!(estimate.verdict, Some(Verdict::Good));
}

#[test]
fn three_weighted_points_are_not_three_hundred() {
    let mut rng = ChaCha12Rng::seed_from_u64(8);
    let rows = body(300, &mut rng);
    let pose = Pose { rotation: rotation_of_euler(&[0.1, 0.2, 0.3]), translation: [0.5, -0.2, 0.3] };
    let columns =
        |rows: &[[f64; 3]]| (0..3).map(|d| rows.iter().map(|row| row[d]).collect()).collect::<Vec<Vec<f64>>>();
    let moved: Vec<[f64; 3]> = rows.iter().map(|p| pose.apply(*p)).collect();
    let verdict = |weights: &dyn Fn(usize) -> f64| {
        let weights: Vec<f64> = (0..300).map(weights).collect();
        let of = |rows: &[[f64; 3]]| Points::weighted(columns(rows), weights.clone()).unwrap();
        let (source, target) = (of(&rows), of(&moved));
        let solve = |estimator: Estimator| estimator.solve(Supervision::default()).unwrap().verdict;
        let verdict = solve(estimator(&source, &target));
        // On a part that hardly a point with weight is in, nothing is explored; the answer is the same.
        assert_eq!(solve(exploring(100, &source, &target)), verdict);
        verdict
    };
    assert_eq!(verdict(&|_| 2.0), Some(Verdict::Good));
    assert_eq!(verdict(&|k| if k % 7 == 0 { 0.0 } else { 1.0 + (k % 3) as f64 }), Some(Verdict::Good));
    for rest in [0.0, 1e-9] {
        assert_ne!(verdict(&|k| if k < 3 { 1.0 } else { rest }), Some(Verdict::Good), "rest of weight {rest}");
    }
}
