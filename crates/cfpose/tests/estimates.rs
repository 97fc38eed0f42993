//! Estimates whose answer is known.

use cfpose::theta::RotationForm;
use cfpose::{Estimator, Execution, Points, Pose, PoseError, Registry, Settings, Start, Supervision};
use cfpose_optim::manifold::rotation_of_quaternion;
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha12Rng;

fn rng(seed: u64) -> ChaCha12Rng {
    ChaCha12Rng::seed_from_u64(seed)
}

/// An asymmetric cloud: a bent sheet with a bump.
fn cloud(count: usize, rng: &mut ChaCha12Rng) -> Vec<[f64; 3]> {
    (0..count)
        .map(|_| {
            let (u, v) = (rng.random::<f64>(), rng.random::<f64>());
            [2.0 * u, v * (1.0 + 0.5 * u), 0.6 * u * u + 0.3 * (3.0 * v).sin() * u]
        })
        .collect()
}

fn random_pose(rng: &mut ChaCha12Rng) -> Pose {
    let mut gauss = || (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0;
    let q = [gauss(), gauss(), gauss(), gauss()];
    let translation = [gauss(), gauss(), gauss()];
    Pose { rotation: rotation_of_quaternion(&q), translation }
}

fn solve(settings: &Settings, source: &Points, target: &Points) -> (Estimator, cfpose::Estimate) {
    let registry = Registry::default();
    let estimator = Estimator::new(&registry, settings, source, target, &Execution::default()).unwrap();
    let estimate = estimator.solve(Supervision::default()).unwrap();
    (estimator, estimate)
}

#[test]
fn motivation_example_gives_gain_one_and_the_printed_correspondence() {
    let p = Points::from_rows(&[[1.0], [2.0], [3.0], [4.0]]).unwrap();
    let q = Points::from_rows(&[[2.0], [3.0], [1.0], [4.0]]).unwrap();
    for features in ["coordinates", "trig18", "hermite"] {
        let settings = Settings { features: Some(features.into()), ..Settings::preset("paper", "gain1").unwrap() };
        let (estimator, estimate) = solve(&settings, &p, &q);
        assert!((estimate.theta[0] - 1.0).abs() < 1e-9, "{features}: {:?}", estimate.theta);
        let c: Vec<usize> = estimator.correspondence(&estimate.theta).unwrap().iter().map(|k| k + 1).collect();
        assert_eq!(c, vec![3, 1, 2, 4]);
    }
}

#[test]
fn rigid3_recovers_any_rotation_of_a_permuted_cloud_from_principal_axes() {
    for seed in 0..10 {
        let mut rng = rng(seed);
        let rows = cloud(2000, &mut rng);
        let truth = random_pose(&mut rng);
        let mut moved: Vec<[f64; 3]> = rows.iter().map(|p| truth.apply(*p)).collect();
        moved.shuffle(&mut rng);
        let (p, q) = (Points::from_rows(&rows).unwrap(), Points::from_rows(&moved).unwrap());
        let settings = Settings {
            features: Some("hermite[degree=3]".into()),
            start: Some(Start::Named("pca".into())),
            ..Settings::preset("paper", "rigid3").unwrap()
        };
        let (estimator, estimate) = solve(&settings, &p, &q);
        let pose = Pose::of_theta(&estimator.model().layout, &estimate.theta).unwrap();
        let degrees = PoseError::between(&pose, &truth).angle.to_degrees();
        assert!(degrees < 1e-6, "seed {seed}: {degrees} degrees, {:?}", estimate.outcome.status);
        assert!(estimate.usable() && estimate.starts == 4);
    }
}

#[test]
fn epipolar_returns_the_truth_with_the_sign_of_positive_depth() {
    for seed in 0..10 {
        let mut rng = rng(100 + seed);
        let mut uniform = |low: f64, high: f64| low + (high - low) * rng.random::<f64>();
        let truth_list = [uniform(-0.2, 0.2), uniform(-0.2, 0.2), uniform(-0.2, 0.2), 0.8, uniform(-0.5, 0.5), 0.3];
        let registry = Registry::default();
        let settings = Settings::preset("paper", "epipolar").unwrap();
        let model = registry.model("epipolar", &Default::default()).unwrap();
        let truth = model.layout.from_list(&truth_list, RotationForm::Vector).unwrap();
        let pose = Pose::of_theta(&model.layout, &truth).unwrap();
        let (mut p, mut q) = (Vec::new(), Vec::new());
        for _ in 0..400 {
            let z = uniform(2.0, 5.0);
            let scene = [uniform(-0.6, 0.6) * z, uniform(-0.6, 0.6) * z, z];
            let other = pose.apply(scene);
            p.push([scene[0] / z, scene[1] / z]);
            q.push([other[0] / other[2], other[1] / other[2]]);
        }
        q.shuffle(&mut rng);
        let start_list: Vec<f64> =
            truth_list.iter().enumerate().map(|(j, v)| v + 0.008 * if j % 2 == 0 { 1.0 } else { -1.0 }).collect();
        let start = model.layout.from_list(&start_list, RotationForm::Vector).unwrap();
        let settings = Settings { start: Some(Start::Given(vec![start])), ..settings };
        let (p, q) = (Points::from_rows(&p).unwrap(), Points::from_rows(&q).unwrap());
        let (_, estimate) = solve(&settings, &p, &q);
        let distance = |theta: &[f64]| theta.iter().zip(&truth).fold(0.0_f64, |a, (x, y)| a.max((x - y).abs()));
        let error = distance(&estimate.theta);
        assert!(error < 1e-6, "seed {seed}: {error}, cost {}", estimate.outcome.cost);
        assert!(estimate.alternatives.is_empty(), "positive depth decides the sign of T");
    }
}

#[test]
fn too_few_features_and_wrong_dimensions_are_errors_in_one_line() {
    let registry = Registry::default();
    let cube = Points::from_rows(&[[0.0, 0.0, 0.0], [1.0, 0.2, 0.0], [0.0, 1.0, 0.4]]).unwrap();
    let plane = Points::from_rows(&[[0.0, 0.0], [1.0, 0.2], [0.0, 1.0]]).unwrap();
    let settings = Settings { features: Some("coordinates".into()), ..Settings::preset("paper", "rigid3").unwrap() };
    let run = |settings: &Settings, p: &Points, q: &Points| {
        let estimator = Estimator::new(&registry, settings, p, q, &Execution::default());
        estimator.and_then(|estimator| estimator.solve(Supervision::default())).err().unwrap().to_string()
    };
    assert_eq!(
        run(&settings, &cube, &cube),
        "3 feature function(s) cannot determine 6 unknowns; use a larger family or fix parameters"
    );
    assert_eq!(
        run(&settings, &plane, &cube),
        "source points have 2 coordinates, model `rigid3` takes 3; give points of 3, or a model for 2"
    );
    let equal = Points::from_rows(&[[1.0, 1.0, 1.0]; 5]).unwrap();
    assert_eq!(run(&settings, &cube, &equal), "target points: only 1 distinct point(s); an estimate needs at least 2");
    let settings = Settings { features: Some("trig19".into()), ..settings };
    assert!(run(&settings, &cube, &cube).contains("did you mean trig18?"));
}
