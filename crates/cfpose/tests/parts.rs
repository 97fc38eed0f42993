//! Parts: what both sides show is enough to find the pose, a second copy is another answer, a misfit is told from noise.

mod common;

use std::f64::consts::TAU;

use cfpose::start::StartContext;
use cfpose::theta::rotation_of_euler;
use cfpose::{
    BuildContext, Estimate, Estimator, Execution, Points, Pose, PoseError, Registry, Settings, Supervision, Verdict,
};
use common::noisy;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha12Rng;
use rand_distr::StandardNormal;

fn solve(settings: &Settings, source: &[[f64; 3]], target: &[[f64; 3]]) -> Estimate {
    let [source, target] = [source, target].map(|rows| Points::from_rows(rows).unwrap());
    let estimator = Estimator::new(&Registry::default(), settings, &source, &target, &Execution::default()).unwrap();
    estimator.solve(Supervision::default()).unwrap()
}

fn pose(angles: [f64; 3], translation: [f64; 3]) -> Pose {
    Pose { rotation: rotation_of_euler(&angles), translation }
}

/// Return the pose of a theta of `rigid3`.
fn pose_of(theta: &[f64]) -> Pose {
    Pose { rotation: std::array::from_fn(|i| theta[i]), translation: std::array::from_fn(|i| theta[9 + i]) }
}

fn direction(rng: &mut ChaCha12Rng) -> [f64; 3] {
    let v: [f64; 3] = std::array::from_fn(|_| rng.sample(StandardNormal));
    let length = v.iter().map(|x| x * x).sum::<f64>().sqrt();
    v.map(|x| x / length)
}

/// A sphere with bumps and dents.
struct Bumpy {
    bumps: Vec<([f64; 3], f64, f64)>,
}

impl Bumpy {
    fn new(seed: u64) -> Self {
        let mut rng = ChaCha12Rng::seed_from_u64(seed);
        let bump = |_| (direction(&mut rng), rng.random_range(-0.6..0.6), rng.random_range(3.0..12.0));
        Self { bumps: (0..14).map(bump).collect() }
    }

    /// Draw points, with noise of .005 each.
    fn draw(&self, count: usize, rng: &mut ChaCha12Rng) -> Vec<[f64; 3]> {
        let dot = |a: &[f64; 3], b: &[f64; 3]| (0..3).map(|d| a[d] * b[d]).sum::<f64>();
        (0..count)
            .map(|_| {
                let u = direction(rng);
                let height = |(c, a, k): &([f64; 3], f64, f64)| a * (k * (dot(&u, c) - 1.0)).exp();
                let radius = 1.0 + self.bumps.iter().map(height).sum::<f64>();
                u.map(|x| radius * x + 0.005 * rng.sample::<f64, _>(StandardNormal))
            })
            .collect()
    }
}

/// Keep the share of the points that lies farthest along a direction.
fn farthest(mut rows: Vec<[f64; 3]>, along: [f64; 3], share: f64) -> Vec<[f64; 3]> {
    let height = |p: &[f64; 3]| (0..3).map(|d| p[d] * along[d]).sum::<f64>();
    rows.sort_by(|a, b| height(b).total_cmp(&height(a)));
    rows.truncate((share * rows.len() as f64) as usize);
    rows
}

/// Two new samples of a body, of which either side shows two thirds: half of either is seen by the other.
fn halves(seed: u64, truth: &Pose) -> [Vec<[f64; 3]>; 2] {
    let (body, mut rng) = (Bumpy::new(seed), ChaCha12Rng::seed_from_u64(seed + 1000));
    let along = direction(&mut rng);
    let source = farthest(body.draw(3000, &mut rng), along, 2.0 / 3.0);
    let target = farthest(body.draw(3000, &mut rng), along.map(|x| -x), 2.0 / 3.0);
    [source, target.into_iter().map(|p| truth.apply(p)).collect()]
}

#[test]
fn local_features_propose_the_pose_of_halves_that_overlap() {
    let registry = Registry::default();
    let model = registry.model("rigid3", &BuildContext::default()).unwrap();
    let strategy = registry.start("local-features").unwrap();
    let mut proposed = 0;
    for seed in 0..6 {
        let truth = pose([2.0, 0.4 * seed as f64 - 1.0, -1.3], [0.5, -0.2, 0.3]);
        let [source, target] = halves(seed, &truth).map(|rows| Points::from_rows(&rows).unwrap());
        let cost = |_: &[f64]| 0.0;
        let context =
            StartContext { model: &model, source: &source, target: &target, cost: &cost, seed: 0, freedom: None };
        let starts = strategy.starts(&context).unwrap();
        let errors = starts.iter().map(|theta| PoseError::between(&pose_of(theta), &truth).total());
        let nearest = errors.fold(f64::INFINITY, f64::min);
        println!("body {seed}: {} starts, nearest {nearest:.3}", starts.len());
        proposed += usize::from(nearest < 0.3);
    }
    assert!(proposed >= 4, "{proposed} of 6");
}

#[test]
fn local_features_are_for_rigid_motions() {
    let settings = Settings {
        start: Some(cfpose::Start::Named("local-features".into())),
        ..Settings::preset("auto", "affine3").unwrap()
    };
    let rows = Bumpy::new(1).draw(300, &mut ChaCha12Rng::seed_from_u64(1));
    let points = Points::from_rows(&rows).unwrap();
    let estimator = Estimator::new(&Registry::default(), &settings, &points, &points, &Execution::default()).unwrap();
    let error = estimator.solve(Supervision::default()).unwrap_err().to_string();
    assert!(error.contains("local-features") && error.contains("rigid motion"), "{error}");
}

#[test]
fn a_start_that_proposes_nothing_says_so() {
    let few = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 3.0]];
    let points = Points::from_rows(&few).unwrap();
    let start = Some(cfpose::Start::Named("local-features".into()));
    let settings = Settings { start, ..Settings::preset("paper", "rigid3").unwrap() };
    let estimator = Estimator::new(&Registry::default(), &settings, &points, &points, &Execution::default()).unwrap();
    let error = estimator.solve(Supervision::default()).unwrap_err().to_string();
    assert!(error.contains("`local-features` proposes nothing") && error.contains("another start"), "{error}");
}

#[test]
fn halves_that_overlap_are_found_from_any_rotation_and_never_wrong_and_good() {
    let mut right = 0;
    for seed in 10..16 {
        let truth = pose([1.0, 0.4 * seed as f64 - 5.0, 2.3], [-0.3, 0.4, 0.1]);
        let [source, target] = halves(seed, &truth);
        let estimate = solve(&Settings::preset("auto", "rigid3").unwrap(), &source, &target);
        let error = PoseError::between(&estimate.pose.unwrap(), &truth);
        let is_right = error.angle < 5.0_f64.to_radians() && error.translation < 0.05;
        println!("body {seed}: {:.4} {:.4} {:?}", error.angle, error.translation, estimate.verdict);
        assert!(is_right || estimate.verdict != Some(Verdict::Good));
        right += usize::from(is_right);
    }
    assert!(right >= 4, "{right} of 6");
}

#[test]
fn a_second_copy_makes_the_answer_ambiguous_and_both_are_listed() {
    let (body, mut rng) = (Bumpy::new(20), ChaCha12Rng::seed_from_u64(20));
    let poses = [pose([0.4, -0.3, 1.1], [0.2, -0.1, 0.3]), pose([-1.4, 0.7, 2.5], [2.1, 0.6, -0.4])];
    let source = body.draw(1500, &mut rng);
    let target: Vec<[f64; 3]> =
        poses.iter().flat_map(|pose| body.draw(1500, &mut rng).into_iter().map(|p| pose.apply(p))).collect();
    let estimate = solve(&Settings::preset("auto", "rigid3").unwrap(), &source, &target);
    assert_eq!(estimate.verdict, Some(Verdict::Ambiguous), "{:?}", estimate.warnings);
    let listed: Vec<Pose> = std::iter::once(estimate.pose.unwrap())
        .chain(estimate.alternatives.iter().map(|other| pose_of(&other.theta)))
        .collect();
    for pose in &poses {
        let nearest = listed.iter().map(|found| PoseError::between(found, pose).total()).fold(f64::INFINITY, f64::min);
        assert!(nearest < 0.02, "{nearest}");
    }
}

/// Three quarters of a body without another part that looks alike are enough; a body that is another one is not.
#[test]
fn a_part_is_enough_where_it_is_clear() {
    let (body, mut rng) = (Bumpy::new(30), ChaCha12Rng::seed_from_u64(30));
    let truth = pose([0.4, -0.3, 1.1], [0.2, -0.1, 0.3]);
    let source = body.draw(2000, &mut rng);
    let placed = |rows: Vec<[f64; 3]>| rows.into_iter().map(|p| truth.apply(p)).collect::<Vec<_>>();
    let part = placed(farthest(body.draw(2000, &mut rng), direction(&mut rng), 0.75));
    let estimate = solve(&Settings::preset("auto", "rigid3").unwrap(), &source, &part);
    assert_eq!(estimate.verdict, Some(Verdict::Good), "{:?}", estimate.warnings);
    assert!(estimate.warnings.iter().any(|warning| warning.contains("partial overlap")), "{:?}", estimate.warnings);
    assert!(PoseError::between(&estimate.pose.unwrap(), &truth).total() < 0.03);
    let other = placed(farthest(Bumpy::new(31).draw(2000, &mut rng), direction(&mut rng), 0.75));
    let estimate = solve(&Settings::preset("auto", "rigid3").unwrap(), &source, &other);
    assert_ne!(estimate.verdict, Some(Verdict::Good), "{:?}", estimate.warnings);
}

/// Beside a cusp the points miss the normals of the curve together, by noise alone: no misfit.
#[test]
fn noise_beside_a_cusp_is_no_misfit() {
    let mut rng = ChaCha12Rng::seed_from_u64(40);
    let heart = |t: f64| {
        let y = 13.0 * t.cos() - 5.0 * (2.0 * t).cos() - 2.0 * (3.0 * t).cos() - (4.0 * t).cos();
        [t.sin().powi(3), (y + 2.0) / 16.0]
    };
    let source: Vec<[f64; 2]> = (0..2000).map(|k| heart(TAU * f64::from(k) / 2000.0)).collect();
    let (sin, cos) = 0.3_f64.sin_cos();
    let image: Vec<[f64; 2]> =
        source.iter().map(|p| [cos * p[0] - sin * p[1] + 0.1, sin * p[0] + cos * p[1]]).collect();
    let source = Points::from_rows(&source).unwrap();
    let target = noisy(&Points::from_rows(&image).unwrap(), cfpose::model::PointKind::Plain(2), 0.04, &mut rng);
    let settings = Settings::preset("auto", "rigid2").unwrap();
    let estimator = Estimator::new(&Registry::default(), &settings, &source, &target, &Execution::default()).unwrap();
    let estimate = estimator.solve(Supervision::default()).unwrap();
    assert_eq!(estimate.verdict, Some(Verdict::Good), "{:?}", estimate.warnings);
    assert!(estimate.evidence.unwrap().coherence < 0.25, "{:?}", estimate.evidence);
}
