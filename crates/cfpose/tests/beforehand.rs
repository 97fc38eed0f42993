//! What is known beforehand: bounds that no answer leaves, priors that are joined with the data, told apart from wrong ones.

mod common;

use cfpose::bounds::{Bound, Bounds};
use cfpose::theta::{euler_of_rotation, rotation_of_euler};
use cfpose::{Estimate, Estimator, Execution, Points, Pose, Prior, Registry, Settings, Supervision, Verdict};
use cfpose_optim::Manifold;
use common::permuted;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha12Rng;
use rand_distr::StandardNormal;

fn solve(settings: &Settings, source: &Points, target: &Points) -> Estimate {
    Estimator::new(&Registry::default(), settings, source, target, &Execution::default())
        .and_then(|estimator| estimator.solve(Supervision::default()))
        .unwrap()
}

fn auto() -> Settings {
    Settings::preset("auto", "rigid3").unwrap()
}

/// A bar with a bent end, or, `symmetric`, with the same bend at both: equal to itself after half a turn about z.
fn bar(count: usize, symmetric: bool, rng: &mut ChaCha12Rng) -> Vec<[f64; 3]> {
    let mut rows = Vec::new();
    while rows.len() < count {
        let (u, v) = (2.0 * rng.random::<f64>() - 1.0, 2.0 * rng.random::<f64>() - 1.0);
        let bend = if symmetric { 0.3 * u * u.abs() } else { 0.5 * u.max(0.0) };
        let p = [u, 0.3 * v + bend, 0.2 * v * v + 0.1 * u * u];
        rows.push(p);
        if symmetric && rows.len() < count {
            rows.push([-p[0], -p[1], p[2]]);
        }
    }
    rows
}

fn observed(rows: &[[f64; 3]], pose: &Pose, sigma: f64, rng: &mut ChaCha12Rng) -> Points {
    let noisy: Vec<[f64; 3]> =
        rows.iter().map(|p| pose.apply(*p).map(|value| value + sigma * rng.sample::<f64, _>(StandardNormal))).collect();
    permuted(&Points::from_rows(&noisy).unwrap(), rng)
}

fn turned(angle: f64) -> Pose {
    Pose { rotation: rotation_of_euler(&[0.1, -0.2, angle]), translation: [0.4, 0.1, -0.3] }
}

fn theta_of(pose: &Pose) -> Vec<f64> {
    [&pose.rotation[..], &pose.translation].concat()
}

#[test]
fn bounds_choose_among_equal_modes_and_are_never_left() {
    let mut rng = ChaCha12Rng::seed_from_u64(5);
    let rows = bar(400, true, &mut rng);
    let source = Points::from_rows(&rows).unwrap();
    let target = observed(&bar(400, true, &mut rng), &turned(1.1), 0.005, &mut rng);
    assert_eq!(solve(&auto(), &source, &target).verdict, Some(Verdict::Ambiguous));
    let pi = std::f64::consts::PI;
    for (low, high, expected) in [(0.6, 1.6, 1.1), (-2.6, -1.6, 1.1 - pi)] {
        let bounds = vec![Bound { column: 2, low, high }];
        let estimate = solve(&auto().bounds(bounds.clone()), &source, &target);
        let angle = euler_of_rotation(&estimate.theta[..9])[2];
        assert!((angle - expected).abs() < 0.02, "{low}..{high}: {angle}, {expected}");
        assert_eq!(estimate.verdict, Some(Verdict::Good), "{:?}", estimate.warnings);
        let check = Bounds::new(&cfpose::theta::Layout::pose3(), &bounds).unwrap();
        for theta in estimate.alternatives.iter().map(|other| &other.theta).chain([&estimate.theta]) {
            assert!(check.violated(theta).is_empty());
        }
    }
}

#[test]
fn an_answer_at_its_bound_is_suspect_and_a_start_outside_is_refused() {
    let mut rng = ChaCha12Rng::seed_from_u64(6);
    let rows = bar(300, false, &mut rng);
    let source = Points::from_rows(&rows).unwrap();
    let target = observed(&rows, &turned(0.3), 0.002, &mut rng);
    // tx is .4: the bounds end before.
    let settings = auto().bounds(vec![Bound { column: 3, low: -1.0, high: 0.35 }]);
    let estimate = solve(&settings, &source, &target);
    assert!(estimate.theta[9] <= 0.35);
    assert_ne!(estimate.verdict, Some(Verdict::Good));
    let outside = settings.start_at(theta_of(&turned(0.3)));
    let refused = Estimator::new(&Registry::default(), &outside, &source, &target, &Execution::default());
    let words = refused.err().map(|error| error.to_string()).unwrap_or_default();
    assert!(words.contains("tx") && words.contains("outside"), "{words}");
}

#[test]
fn a_prior_is_joined_in_its_calibrated_share_and_a_wrong_one_is_reported() {
    let layout = cfpose::theta::Layout::pose3();
    let manifold = layout.manifold();
    let deviations = [0.003, 0.003, 0.003, 0.001, 0.001, 0.001];
    let covariance: Vec<f64> =
        (0..36).map(|at| if at % 7 == 0 { deviations[at / 7] * deviations[at / 7] } else { 0.0 }).collect();
    let (mut joined, mut alone, mut agreeing) = (0.0, 0.0, 0);
    const TRIALS: u64 = 24;
    for seed in 0..TRIALS {
        let mut rng = ChaCha12Rng::seed_from_u64(100 + seed);
        let rows = bar(200, false, &mut rng);
        let source = Points::from_rows(&rows).unwrap();
        let truth = theta_of(&turned(rng.random::<f64>() - 0.5));
        let target = observed(&rows, &Pose::of_theta(&layout, &truth).unwrap(), 0.02, &mut rng);
        let step: Vec<f64> = deviations.iter().map(|s| s * rng.sample::<f64, _>(StandardNormal)).collect();
        let mut theta = truth.clone();
        manifold.retract(&truth, &step, &mut theta);
        let estimate = solve(&auto().prior(Prior { theta, covariance: covariance.clone() }), &source, &target);
        let report = estimate.prior.unwrap();
        agreeing += usize::from(report.used);
        assert_eq!(report.degrees_of_freedom, 6);
        let statistics = estimate.statistics.as_ref().unwrap();
        let mut error = vec![0.0; 6];
        manifold.local(&estimate.theta, &truth, &mut error);
        joined += squared(&error, &statistics.covariance);
        alone += solve(&auto(), &source, &target).statistics.unwrap().covariance[0] / statistics.covariance[0];
        assert!(statistics.covariance[0] < deviations[0] * deviations[0]);
    }
    let nees = joined / (6.0 * TRIALS as f64);
    println!(
        "NEES / dof {nees:.2}, variance without prior {:.1} times, {agreeing} of {TRIALS} joined",
        alone / TRIALS as f64
    );
    assert!(agreeing as u64 >= TRIALS - 1);
    assert!((0.6..1.6).contains(&nees), "{nees}");

    // Ten deviations off: said, left out, never good.
    let mut rng = ChaCha12Rng::seed_from_u64(7);
    let rows = bar(200, false, &mut rng);
    let source = Points::from_rows(&rows).unwrap();
    let target = observed(&rows, &turned(0.2), 0.002, &mut rng);
    let mut theta = theta_of(&turned(0.2));
    theta[9] += 0.01;
    let estimate = solve(&auto().prior(Prior { theta, covariance }), &source, &target);
    assert!(!estimate.prior.unwrap().used && estimate.prior.unwrap().p_value < 1e-6);
    assert!((estimate.theta[9] - 0.4).abs() < 2e-3);
    assert_eq!(estimate.verdict, Some(Verdict::Suspect));
    assert!(estimate.warnings.iter().any(|words| words.contains("prior disagrees")), "{:?}", estimate.warnings);
}

#[test]
fn a_prior_tells_modes_apart_and_fills_what_the_data_leave_open() {
    let variances = [0.01, 0.01, 0.0004, 0.04, 0.04, 0.04];
    let covariance: Vec<f64> = (0..36).map(|at| if at % 7 == 0 { variances[at / 7] } else { 0.0 }).collect();
    let mut rng = ChaCha12Rng::seed_from_u64(8);
    let source = Points::from_rows(&bar(400, true, &mut rng)).unwrap();
    let target = observed(&bar(400, true, &mut rng), &turned(1.1), 0.005, &mut rng);
    let theta = theta_of(&turned(1.12));
    let estimate = solve(&auto().prior(Prior { theta, covariance: covariance.clone() }), &source, &target);
    assert!((euler_of_rotation(&estimate.theta[..9])[2] - 1.1).abs() < 0.02);
    assert_eq!(estimate.verdict, Some(Verdict::Good), "{:?}", estimate.warnings);

    // A body of revolution about z.
    let cone = |count: usize, rng: &mut ChaCha12Rng| -> Vec<[f64; 3]> {
        (0..count)
            .map(|_| {
                let (angle, height): (f64, f64) = (std::f64::consts::TAU * rng.random::<f64>(), rng.random());
                let radius = 0.2 + 0.6 * height * height;
                [radius * angle.cos(), radius * angle.sin(), 1.5 * height]
            })
            .collect()
    };
    let source = Points::from_rows(&cone(500, &mut rng)).unwrap();
    let pose = turned(0.4);
    let target = observed(&cone(500, &mut rng), &pose, 0.005, &mut rng);
    let blind = solve(&auto(), &source, &target);
    assert!(!blind.undetermined.is_empty() && blind.verdict != Some(Verdict::Good));
    let prior = Prior { theta: theta_of(&turned(0.41)), covariance };
    let told = solve(&auto().prior(prior), &source, &target);
    let angles = euler_of_rotation(&told.theta[..9]);
    assert!((angles[2] - 0.41).abs() < 0.03, "{angles:?}");
    let statistics = told.statistics.unwrap();
    assert!(statistics.covariance.iter().all(|value| value.is_finite()), "{:?} {:?}", told.undetermined, told.prior);
    assert!((statistics.covariance[14].sqrt() - 0.02).abs() < 0.01, "{}", statistics.covariance[14].sqrt());
}

/// d' C^-1 d.
fn squared(d: &[f64], covariance: &[f64]) -> f64 {
    use faer::linalg::solvers::Solve;
    let n = d.len();
    let factor = faer::Mat::from_fn(n, n, |i, j| covariance[i * n + j]).llt(faer::Side::Lower).unwrap();
    let solution = factor.solve(faer::Mat::from_fn(n, 1, |i, _| d[i]));
    (0..n).map(|i| d[i] * solution[(i, 0)]).sum()
}
