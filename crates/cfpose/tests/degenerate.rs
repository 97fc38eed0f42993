//! Degenerate and ambiguous data are reported in words, not silently returned.

use cfpose::homography::decompose;
use cfpose::theta::{RotationForm, rotation_of_euler};
use cfpose::{
    BuildContext, Estimate, Estimator, Execution, Points, Pose, Registry, Scene, Settings, Start, Supervision,
};
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha12Rng;

fn rng(seed: u64) -> ChaCha12Rng {
    ChaCha12Rng::seed_from_u64(seed)
}

/// Solve from a list of numbers (Euler angles) with the given features.
#[track_caller]
fn solve<const P: usize, const Q: usize>(
    model: &str,
    features: &str,
    start: &[f64],
    source: &[[f64; P]],
    target: &[[f64; Q]],
) -> (Estimate, Vec<f64>) {
    let registry = Registry::default();
    let (source, target) = (Points::from_rows(source).unwrap(), Points::from_rows(target).unwrap());
    let context = BuildContext { source: Some(&source), ..BuildContext::default() };
    let layout = registry.model(model, &context).unwrap().layout;
    let start = layout.from_list(start, RotationForm::Euler).unwrap();
    let settings = Settings {
        features: Some(features.into()),
        start: Some(Start::Given(vec![start])),
        ..Settings::preset("paper", model).unwrap()
    };
    let estimator = Estimator::new(&registry, &settings, &source, &target, &Execution::default()).unwrap();
    let estimate = estimator.solve(Supervision::default()).unwrap();
    let list = layout.to_list(&estimate.theta, RotationForm::Euler);
    (estimate, list)
}

#[track_caller]
fn warns(estimate: &Estimate, words: &str) {
    assert!(estimate.warnings.iter().any(|warning| warning.contains(words)), "`{words}` in {:?}", estimate.warnings);
}

/// Rings of 16 points: moments up to degree 15 do not know a rotation about z.
fn rings(heights: &[f64]) -> Vec<[f64; 3]> {
    let point = |h: usize, i: usize| {
        let (radius, angle) = (0.4 + 0.1 * h as f64, std::f64::consts::TAU * i as f64 / 16.0);
        [radius * angle.cos(), radius * angle.sin(), heights[h]]
    };
    (0..16 * heights.len()).map(|k| point(k / 16, k % 16)).collect()
}

fn blob(count: usize, seed: u64) -> Vec<[f64; 2]> {
    let mut rng = rng(seed);
    (0..count)
        .map(|_| {
            let (u, v): (f64, f64) = (rng.random(), rng.random());
            [u * (0.6 + 0.4 * v) - 0.4, v * v * (0.4 + 0.6 * u) - 0.2]
        })
        .collect()
}

fn image(h: &[f64; 9], points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    points.iter().map(|p| cfpose::homography::apply(h, *p)).collect()
}

#[test]
fn symmetric_clouds_leave_the_rotation_about_their_axis_open() {
    let cloud = rings(&[-0.5, 0.1, 0.7]);
    let (estimate, _) = solve("rigid3", "hermite[degree=3]", &[0.05, 0.02, 0.3, 0.1, 0.0, 0.0], &cloud, &cloud);
    assert_eq!((estimate.conditioning.rank, estimate.conditioning.unknowns), (5, 6));
    warns(&estimate, "undetermined by these points and features: rotation about z");
    let ring: Vec<[f64; 2]> = rings(&[0.0]).iter().map(|p| [p[0], p[1]]).collect();
    let (estimate, _) = solve("rigid2", "hermite[degree=3]", &[0.3, 0.1, 0.0], &ring, &ring);
    assert_eq!(estimate.conditioning.rank, 2);
    warns(&estimate, "undetermined by these points and features: angle");
}

#[test]
fn flat_and_collinear_sources_are_named_with_the_directions_they_leave_open() {
    let line: Vec<[f64; 3]> = (0..40).map(|k| [f64::from(k * k) / 1600.0, 0.0, 0.0]).collect();
    let (estimate, _) = solve("rigid3", "hermite[degree=3]", &[0.0, 0.05, 0.02, 0.0, 0.0, 0.1], &line, &line);
    warns(&estimate, "the source lies on a line");
    warns(&estimate, "rotation about x");
    let flat: Vec<[f64; 3]> = blob(200, 1).iter().map(|p| [p[0], p[1], 0.0]).collect();
    let start = [1.1, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.1, 0.0, 0.0];
    let (estimate, _) = solve("affine3", "hermite[degree=3]", &start, &flat, &flat);
    assert_eq!(estimate.conditioning.rank, 9);
    warns(&estimate, "the source lies in a plane");
    warns(&estimate, "matrix entries");
    let line: Vec<[f64; 2]> = line.iter().map(|p| [p[0], 2.0 * p[0]]).collect();
    let (estimate, _) = solve("affine2", "hermite[degree=3]", &[1.0, 0.1, 0.0, 1.0, 0.0, 0.0], &line, &line);
    warns(&estimate, "the source lies on a line");
    assert_eq!(estimate.conditioning.rank, 4);
    let start = [1.0, 0.1, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
    let (estimate, _) = solve("homography[relation=plane]", "hermite[degree=4]", &start, &line, &line);
    warns(&estimate, "the source lies on a line");
    assert!(estimate.conditioning.rank < 8);
}

#[test]
fn shapes_of_even_symmetry_list_their_half_turn() {
    let mut half = blob(100, 2);
    half.extend(half.clone().iter().map(|p| [-p[0], -p[1]]));
    let (estimate, _) = solve("rigid2", "hermite[degree=4]", &[0.2, 0.1, 0.0], &half, &half);
    assert_eq!(estimate.alternatives.len(), 1);
    warns(&estimate, "explain(s) the data as well");
    let turned = (estimate.alternatives[0].theta[0] - estimate.theta[0]).rem_euclid(std::f64::consts::TAU);
    assert!((turned - std::f64::consts::PI).abs() < 1e-6);
    let start = [1.1, 0.0, 0.1, 1.0, 0.05, 0.0];
    let (estimate, _) = solve("affine2", "hermite[degree=4]", &start, &half, &half);
    assert_eq!(estimate.alternatives.len(), 1);
    let lone = blob(200, 3);
    let (estimate, _) = solve("affine2", "hermite[degree=4]", &start, &lone, &lone);
    assert!(estimate.alternatives.is_empty() && estimate.warnings.is_empty(), "{:?}", estimate.warnings);
}

#[test]
fn a_negative_scale_is_turned_into_the_same_map_of_positive_scale() {
    let shape = blob(200, 4);
    let start = [std::f64::consts::PI - 0.1, 0.0, 0.0, -1.1];
    let (estimate, list) = solve("similarity2", "hermite[degree=3]", &start, &shape, &shape);
    assert!(estimate.usable() && list[0].abs() < 1e-8 && (list[3] - 1.0).abs() < 1e-8, "{list:?}");
}

#[test]
fn plane_homography_returns_both_decompositions_and_names_a_pure_rotation() {
    let shape = blob(300, 5);
    let (r, t, n) = (rotation_of_euler(&[0.1, -0.15, 0.2]), [0.4, -0.2, 0.15], [0.36, 0.48, 0.8]);
    let mut h = r;
    for i in 0..3 {
        for k in 0..3 {
            h[3 * i + k] += t[i] * n[k];
        }
    }
    let start = [0.12, -0.13, 0.18, 0.42, -0.18, 0.13, 0.38, 0.46, 0.8];
    let (estimate, _) = solve("plane-homography", "hermite[degree=3]", &start, &shape, &image(&h, &shape));
    assert_eq!(estimate.alternatives.len(), 1);
    let mean = [-0.1, 0.0, 1.0];
    for theta in [&estimate.theta, &estimate.alternatives[0].theta] {
        let facing: f64 = (0..3).map(|i| theta[12 + i] * mean[i]).sum();
        assert!(facing > 0.0, "the plane lies in front");
        for i in 0..3 {
            for k in 0..3 {
                let entry = theta[3 * i + k] + theta[9 + i] * theta[12 + k];
                assert!((entry - h[3 * i + k]).abs() < 1e-8, "{theta:?}");
            }
        }
    }
    let exact = decompose(&h, &mean).solutions;
    for theta in [&estimate.theta, &estimate.alternatives[0].theta] {
        let near = |s: &cfpose::homography::PlaneMotion| (0..3).all(|i| (s.normal[i] - theta[12 + i]).abs() < 1e-7);
        assert!(exact.iter().any(near), "{theta:?} {exact:?}");
    }
    let start = [0.12, -0.13, 0.18, 0.02, -0.01, 0.01, 0.0, 0.0, 1.0];
    let (estimate, list) = solve("plane-homography", "hermite[degree=3]", &start, &shape, &image(&r, &shape));
    assert!(list[3..6].iter().all(|value| value.abs() < 1e-6), "{list:?}");
    warns(&estimate, "the plane normal is undetermined");
}

#[test]
fn decompositions_of_random_motions_hold_the_truth_and_reproduce_the_matrix() {
    for seed in 0..200 {
        let mut rng = rng(seed);
        let mut uniform = |size: f64| size * (2.0 * rng.random::<f64>() - 1.0);
        let r = rotation_of_euler(&[uniform(0.5), uniform(0.5), uniform(3.0)]);
        let t = [uniform(0.5), uniform(0.5), uniform(0.5)];
        let n = [uniform(0.5), uniform(0.5), 1.0];
        let size = cfpose_optim::manifold::norm3(&n);
        let n = n.map(|value| value / size);
        let mut h = r;
        for i in 0..3 {
            for k in 0..3 {
                h[3 * i + k] += t[i] * n[k];
            }
        }
        let mean = [0.0, 0.0, 1.0];
        if h[8] <= 0.05 {
            continue; // the plane's mean is behind the second camera: no such view
        }
        let scale = 0.1 + uniform(5.0).abs();
        let found = decompose(&h.map(|value| value * scale), &mean);
        assert!(found.normal_determined && !found.solutions.is_empty());
        let mut nearest = f64::INFINITY;
        for s in &found.solutions {
            assert!((cfpose_optim::manifold::determinant3(&s.rotation) - 1.0).abs() < 1e-9);
            for i in 0..3 {
                for k in 0..3 {
                    let entry = s.rotation[3 * i + k] + s.translation[i] * s.normal[k];
                    assert!((entry - h[3 * i + k]).abs() < 1e-8, "seed {seed}");
                }
            }
            let pairs = s.rotation.iter().zip(&r).chain(s.translation.iter().zip(&t)).chain(s.normal.iter().zip(&n));
            nearest = nearest.min(pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max));
        }
        assert!(nearest < 1e-6, "seed {seed}: {nearest}");
    }
}

#[test]
fn a_back_side_pose_of_a_mirror_symmetric_pattern_gives_way_to_the_front() {
    let mut pattern = blob(150, 6);
    pattern.extend(pattern.clone().iter().map(|p| [p[0], -p[1] - 0.4])); // mirrored at y = -0.2
    let truth = Pose { rotation: rotation_of_euler(&[0.2, 0.3, -0.25]), translation: [-0.1, 0.05, 0.2] };
    let views: Vec<[f64; 2]> = pattern
        .iter()
        .map(|p| {
            let y = truth.apply([p[0], p[1], 1.0]);
            [y[0] / y[2], y[1] / y[2]]
        })
        .collect();
    // The half turn about the mirror axis y = -0.2, z = 1 maps the pattern onto itself.
    let half_turn = [1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, -1.0];
    let back = Pose {
        rotation: cfpose_optim::manifold::multiply3(&truth.rotation, &half_turn),
        translation: truth.apply([0.0, -0.4, 2.0]),
    };
    let angles = cfpose::theta::euler_of_rotation(&back.rotation);
    let start: Vec<f64> = angles.iter().chain(&back.translation).map(|value| value + 0.01).collect();
    let (estimate, _) = solve("plane-bearing", "hermite[degree=3]", &start, &pattern, &views);
    let error: f64 = (0..9).map(|i| (estimate.theta[i] - truth.rotation[i]).abs()).fold(0.0, f64::max);
    assert!(error < 1e-6, "{error}: {:?}", estimate.warnings);
    assert!(estimate.alternatives.len() == 1, "the back side is still listed");
    warns(&estimate, "explain(s) the data as well");
}

#[test]
fn points_behind_the_camera_and_folds_are_reported() {
    let registry = Registry::default();
    let source = Points::from_rows(&blob(50, 7).iter().map(|p| [p[0], p[1], 1.0]).collect::<Vec<_>>()).unwrap();
    let model = registry.model("homography", &BuildContext::default()).unwrap();
    let behind: Vec<f64> = model.identity.iter().map(|value| -value).collect();
    let findings = (model.examine)(&Scene { theta: &behind, source: &source, target: &source });
    assert!(findings.implausible && findings.warnings[0].contains("all points lie behind the camera"));
    let plane = Points::from_rows(&blob(50, 7)).unwrap();
    let model = registry.model("polynomial2", &BuildContext::default()).unwrap();
    let mut folded = model.identity.clone();
    folded[3] = 3.0; // x + 3 x^2 turns back at x = -1/6
    let findings = (model.examine)(&Scene { theta: &folded, source: &plane, target: &plane });
    assert!(findings.warnings.iter().any(|warning| warning.contains("the map folds")), "{:?}", findings.warnings);
}

#[test]
fn epipolar_says_when_the_camera_only_turned() {
    let mut rng = rng(8);
    let pose = Pose { rotation: rotation_of_euler(&[0.1, -0.05, 0.1]), translation: [0.0; 3] };
    let p: Vec<[f64; 2]> = (0..300).map(|_| [rng.random::<f64>() - 0.5, rng.random::<f64>() - 0.6]).collect();
    let mut q: Vec<[f64; 2]> = p
        .iter()
        .map(|m| {
            let y = pose.apply([m[0], m[1], 1.0]);
            [y[0] / y[2], y[1] / y[2]]
        })
        .collect();
    q.shuffle(&mut rng);
    let start = [0.101, -0.051, 0.1, 1.0, 0.1, 0.0];
    let (estimate, _) = solve("epipolar", "angular[harmonics=8]", &start, &p, &q);
    warns(&estimate, "the sign of T is undetermined");
    assert!(estimate.alternatives.len() == 1, "-T is listed");
}

#[test]
fn a_model_that_reads_normals_asks_for_them() {
    let registry = Registry::default();
    let cloud = Points::from_rows(&rings(&[2.0, 2.5])).unwrap();
    let settings = Settings::preset("paper", "bearing3[area=on]").unwrap();
    let error = Estimator::new(&registry, &settings, &cloud, &cloud, &Execution::default()).err().unwrap();
    let expected = "model `bearing3[area=on]` needs the attribute `normal` of every source point";
    assert_eq!(error.to_string(), expected);
}
