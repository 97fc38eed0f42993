//! Rotation forms, free parameters, starts and the read-out.

use std::sync::Arc;

use cfpose::check::derivatives;
use cfpose::distances::{assign, correspond};
use cfpose::free::{Frame, Freedom, find_columns};
use cfpose::theta::{EulerOrder, RotationForm, euler_of_rotation, rotation_of_euler};
use cfpose::{
    Attribute, BuildContext, Estimate, Estimator, Execution, Points, Pose, Registry, Settings, Start, Supervision,
};
use cfpose_optim::manifold::{Manifold, determinant3, multiply3, rotation_exp, rotation_of_quaternion};
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha12Rng;

fn rng(seed: u64) -> ChaCha12Rng {
    ChaCha12Rng::seed_from_u64(seed)
}

fn gauss(rng: &mut ChaCha12Rng) -> f64 {
    (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0
}

fn blob3(count: usize, rng: &mut ChaCha12Rng) -> Vec<[f64; 3]> {
    (0..count)
        .map(|_| {
            let (u, v, w): (f64, f64, f64) = (rng.random(), rng.random(), rng.random());
            let y = v * v * (0.4 + 0.6 * u);
            [u * (0.6 + 0.4 * v) - 0.4, y - 0.2, 0.8 * w * w * (0.3 + u) + 0.3 * u * y - 0.2]
        })
        .collect()
}

fn blob2(count: usize, rng: &mut ChaCha12Rng) -> Vec<[f64; 2]> {
    blob3(count, rng).iter().map(|p| [p[0], p[1]]).collect()
}

fn run(settings: &Settings, source: &Points, target: &Points) -> (Estimator, Estimate) {
    let registry = Registry::default();
    let estimator = Estimator::new(&registry, settings, source, target, &Execution::default()).unwrap();
    let estimate = estimator.solve(Supervision::default()).unwrap();
    (estimator, estimate)
}

#[test]
fn euler_angles_round_trip_in_every_order_also_at_gimbal_lock() {
    let mut rng = rng(1);
    for order in EulerOrder::all() {
        for k in 0..200 {
            let free = rotation_of_quaternion(&[gauss(&mut rng), gauss(&mut rng), gauss(&mut rng), gauss(&mut rng)]);
            let middle = if order.axes()[0] == order.axes()[2] {
                [0.0, std::f64::consts::PI]
            } else {
                [1.0, -1.0].map(f64::asin)
            };
            let locked = order.matrix(&[gauss(&mut rng), middle[k % 2], gauss(&mut rng)]);
            for r in [free, locked] {
                let angles = order.angles(&r);
                let back = order.matrix(&angles);
                let error = (0..9).map(|i| (back[i] - r[i]).abs()).fold(0.0, f64::max);
                assert!(error < 1e-11, "{}: {error}", order.name());
            }
        }
    }
    // R = Rz Ry Rx, each factor the exponential of its axis.
    let factors = [[0.0, 0.0, 0.7], [0.0, -0.4, 0.0], [0.3, 0.0, 0.0]].map(|w| rotation_exp(&w));
    let product = multiply3(&multiply3(&factors[0], &factors[1]), &factors[2]);
    for (a, b) in rotation_of_euler(&[0.3, -0.4, 0.7]).iter().zip(product) {
        assert!((a - b).abs() < 1e-15);
    }
    let layout = cfpose::theta::Layout::pose3();
    let form: RotationForm = "euler-yxz".parse().unwrap();
    let theta = layout.from_list(&[0.1, 0.2, 0.3, 4.0, 5.0, 6.0], form).unwrap();
    assert!((layout.to_list(&theta, form)[1] - 0.2).abs() < 1e-15);
}

#[test]
fn freed_euler_angles_keep_the_fixed_ones_and_have_right_derivatives() {
    let layout = cfpose::theta::Layout::pose3();
    let mut rng = rng(2);
    for names in [&["ry", "tx", "tz"][..], &["rx", "ry", "tz"], &["rx", "rz"], &["tx"]] {
        let free = find_columns(&layout, names, Frame::Camera).unwrap();
        let start = layout.from_list(&[0.3, -0.2, 0.5, 1.0, 2.0, 3.0], RotationForm::Euler).unwrap();
        let manifold = Freedom::new(&layout, &free, &start).manifold().clone();
        let (mut theta, mut next) = (start.clone(), start.clone());
        for _ in 0..50 {
            let step: Vec<f64> = (0..free.len()).map(|_| 0.3 * (rng.random::<f64>() - 0.5)).collect();
            manifold.retract(&theta, &step, &mut next);
            let mut back = vec![0.0; free.len()];
            manifold.local(&theta, &next, &mut back);
            assert!(back.iter().zip(&step).all(|(a, b)| (a - b).abs() < 1e-12));
            theta.copy_from_slice(&next);
        }
        let list = layout.to_list(&theta, RotationForm::Euler);
        for (j, value) in [0.3, -0.2, 0.5, 1.0, 2.0, 3.0].iter().enumerate() {
            assert_eq!(!free.contains(&j), (list[j] - value).abs() < 1e-12, "{names:?}: {list:?}");
        }
        // The same through the whole chain.
        let sample = cfpose::check::Sample::draw(&Registry::default(), "bearing3", 100, 0.3, 5).unwrap();
        let problem = sample.problem(&Registry::default(), "trig18", &Execution::default()).unwrap().unwrap();
        let problem = problem.with_model_manifold(Arc::new(manifold));
        let report = derivatives(&problem, &sample.theta);
        assert!(report.finite_difference < 1e-6 && report.oracle < 1e-12, "{names:?}: {report:?}");
    }
}

#[test]
fn a_ground_robot_moves_in_three_degrees_of_freedom() {
    let registry = Registry::default();
    let model = registry.model("plane-bearing", &BuildContext::default()).unwrap();
    let mut rng = rng(3);
    let pattern = blob2(300, &mut rng);
    // The camera is tilted by a known pitch; yaw, sideways and forward are unknown.
    let truth = model.layout.from_list(&[0.1, 0.3, 0.0, -0.2, 0.05, 0.3], RotationForm::Euler).unwrap();
    let start = model.layout.from_list(&[0.1, 0.1, 0.0, 0.0, 0.05, 0.1], RotationForm::Euler).unwrap();
    let pose = Pose::of_theta(&model.layout, &truth).unwrap();
    let views: Vec<[f64; 2]> = pattern
        .iter()
        .map(|p| {
            let y = pose.apply([p[0], p[1], 1.0]);
            [y[0] / y[2], y[1] / y[2]]
        })
        .collect();
    let free = find_columns(&model.layout, &["yaw", "x", "y"], Frame::Robot).unwrap();
    assert_eq!(free, [1, 3, 5]);
    let settings = Settings {
        features: Some("hermite[degree=2]".into()),
        start: Some(Start::Given(vec![start])),
        free: Some(free),
        ..Settings::preset("paper", "plane-bearing").unwrap()
    };
    let (p, q) = (Points::from_rows(&pattern).unwrap(), Points::from_rows(&views).unwrap());
    let (estimator, estimate) = run(&settings, &p, &q);
    assert_eq!((estimator.num_unknowns(), estimate.conditioning.rank), (3, 3));
    let error = estimate.theta.iter().zip(&truth).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(error < 1e-8, "{error}");
    assert!((euler_of_rotation(&estimate.theta)[0] - 0.1).abs() < 1e-12);
    let unknown = find_columns(&model.layout, &["yow"], Frame::Robot).unwrap_err().to_string();
    assert_eq!(unknown, "free parameters: `yow` is no parameter of this model; it has x, y, z, roll, pitch, yaw");
}

#[test]
fn start_strategies_find_any_map_of_their_group() {
    let cases = [
        ("rigid2", "pca", 2),
        ("rigid2", "grid[count=24]", 2),
        ("similarity2", "pca", 2),
        ("similarity2", "grid[count=24,keep=3]", 2),
        ("rigid3", "grid[count=72,keep=6]", 3),
        ("similarity3", "pca", 3),
        ("affine2", "whitened-affine", 2),
        ("affine2", "whitened-affine[reflections=allow]", 2),
        ("polynomial2[degree=1]", "whitened-affine", 2),
        ("affine3", "whitened-affine[count=400,keep=8]", 3),
    ];
    let registry = Registry::default();
    for (name, start, dim) in cases {
        for seed in 0..5 {
            let mut rng = rng(10 + seed);
            let model = registry.model(name, &BuildContext::default()).unwrap();
            let group = model.linear.as_ref().unwrap();
            let mut matrix: Vec<f64> = match (group.kind, dim) {
                (cfpose::model::LinearKind::General, _) => loop {
                    let a: Vec<f64> = (0..dim * dim).map(|_| gauss(&mut rng)).collect();
                    let det = if dim == 2 { a[0] * a[3] - a[1] * a[2] } else { determinant3(&a) };
                    if det > 0.2 || det < -0.2 && start.contains("allow") {
                        break a;
                    }
                },
                (_, 2) => {
                    let (sin, cos) = (6.0 * rng.random::<f64>()).sin_cos();
                    vec![cos, -sin, sin, cos]
                }
                _ => rotation_of_quaternion(&[gauss(&mut rng), gauss(&mut rng), gauss(&mut rng), gauss(&mut rng)])
                    .to_vec(),
            };
            if group.kind == cfpose::model::LinearKind::Similarity {
                let scale = 0.2 + 3.0 * rng.random::<f64>();
                matrix.iter_mut().for_each(|value| *value *= scale);
            }
            let offset: Vec<f64> = (0..dim).map(|_| 3.0 * gauss(&mut rng)).collect();
            let truth = (group.theta)(&matrix, &offset);
            let rows = blob3(400, &mut rng);
            let columns: Vec<Vec<f64>> = (0..dim).map(|d| rows.iter().map(|p| p[d]).collect()).collect();
            let source = Points::from_columns(columns).unwrap();
            let mut order: Vec<usize> = (0..400).collect();
            order.shuffle(&mut rng);
            let image =
                |i: usize, k: usize| offset[i] + (0..dim).map(|c| matrix[i * dim + c] * rows[k][c]).sum::<f64>();
            let moved = (0..dim).map(|i| order.iter().map(|k| image(i, *k)).collect()).collect();
            let target = Points::from_columns(moved).unwrap();
            let settings = Settings {
                features: Some("hermite[degree=4]".into()),
                normaliser: Some("whiten".into()),
                start: Some(Start::Named(start.into())),
                ..Settings::preset("paper", name).unwrap()
            };
            let (_, estimate) = run(&settings, &source, &target);
            let error = estimate.theta.iter().zip(&truth).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(error < 1e-7, "{name} from {start}, seed {seed}: {error}, cost {:.1e}", estimate.outcome.cost);
        }
    }
}

#[test]
fn a_grid_of_rotations_finds_the_pose_of_rays_without_a_start() {
    for seed in 0..3 {
        let mut rng = rng(30 + seed);
        let rows = blob3(300, &mut rng);
        let rotation = rotation_of_quaternion(&[gauss(&mut rng), gauss(&mut rng), gauss(&mut rng), gauss(&mut rng)]);
        let truth = Pose { rotation, translation: [0.2, -0.3, 2.0] };
        let rays: Vec<[f64; 3]> = rows.iter().map(|p| truth.apply(*p)).collect();
        let settings = Settings {
            features: Some("hermite[degree=4]".into()),
            start: Some(Start::Named("grid[count=300,keep=10]".into())),
            ..Settings::preset("paper", "bearing3").unwrap()
        };
        let (source, target) = (Points::from_rows(&rows).unwrap(), Points::from_rows(&rays).unwrap());
        let (_, estimate) = run(&settings, &source, &target);
        let error = (0..9).map(|i| (estimate.theta[i] - truth.rotation[i]).abs()).fold(0.0, f64::max);
        assert!(error < 1e-6, "seed {seed}: {error}, cost {:.1e}", estimate.outcome.cost);
    }
}

#[test]
fn a_surface_seen_with_its_normals_weights_points_as_its_image_does() {
    // A plate filled evenly; its image filled evenly too. Without the area element the pose is biased.
    let side = 60;
    let at = |i: usize| (i as f64 + 0.5) / f64::from(side) - 0.5;
    let inside = |u: f64, v: f64| u > -0.5 && u < 0.5 && v > -0.5 && v < 0.3 + 0.3 * u;
    let plate: Vec<[f64; 3]> = (0..side as usize * side as usize)
        .map(|k| [at(k % side as usize), at(k / side as usize), 0.0])
        .filter(|p| inside(p[0], p[1]))
        .collect();
    let truth = Pose { rotation: rotation_of_euler(&[0.4, -0.5, 0.2]), translation: [0.1, 0.0, 2.0] };
    let mut back = Vec::new();
    for k in 0..400 * 400 {
        // The pixel (x, y) is in the image when its ray meets the plate inside.
        let (x, y) = ((k % 400) as f64 / 400.0 - 0.5, (k / 400) as f64 / 400.0 - 0.5);
        let r = &truth.rotation;
        let ray = [x, y, 1.0];
        let along = |v: [f64; 3], axis: usize| (0..3).map(|i| r[3 * i + axis] * v[i]).sum::<f64>();
        let depth = along(truth.translation, 2) / along(ray, 2);
        let hit = [0, 1].map(|axis| depth * along(ray, axis) - along(truth.translation, axis));
        if inside(hit[0], hit[1]) {
            back.push([x, y]);
        }
    }
    let normals = Attribute::Vector(vec![vec![0.0; plate.len()], vec![0.0; plate.len()], vec![1.0; plate.len()]]);
    let source = Points::from_rows(&plate).unwrap().with_attribute("normal", normals).unwrap();
    let target = Points::from_rows(&back).unwrap();
    let mut errors = Vec::new();
    for model in ["bearing3[relation=plane,area=on]", "bearing3[relation=plane]", "bearing3[area=on]"] {
        let mut start = truth.rotation.to_vec();
        start.extend(truth.translation);
        let settings = Settings {
            features: Some("hermite[degree=4]".into()),
            start: Some(Start::Given(vec![start])),
            ..Settings::preset("paper", model).unwrap()
        };
        let (estimator, estimate) = run(&settings, &source, &target);
        let pose = Pose::of_theta(&estimator.model().layout, &estimate.theta).unwrap();
        errors.push(cfpose::PoseError::between(&pose, &truth).total());
    }
    println!("pose errors with area, without, with area on the sphere: {errors:?}");
    assert!(errors[0] < 0.02 && errors[2] < 0.02 && errors[1] > 5.0 * errors[0], "{errors:?}");
}

#[test]
fn assignment_is_the_best_of_all_and_reads_off_permutations() {
    let mut rng = rng(40);
    for _ in 0..50 {
        let cost: Vec<f64> = (0..5 * 6).map(|_| (8.0 * rng.random::<f64>()).floor()).collect();
        let found = assign(&cost, 6).unwrap();
        let total = |columns: &[usize]| columns.iter().enumerate().map(|(i, j)| cost[i * 6 + j]).sum::<f64>();
        let mut best = f64::INFINITY;
        for code in 0..6_usize.pow(5) {
            let columns: Vec<usize> = (0..5).map(|i| code / 6_usize.pow(i) % 6).collect();
            let mut distinct = columns.clone();
            distinct.sort_unstable();
            distinct.dedup();
            if distinct.len() == 5 {
                best = best.min(total(&columns));
            }
        }
        assert_eq!(total(&found), best);
    }
    let rows = blob3(700, &mut rng);
    let mut order: Vec<usize> = (0..700).collect();
    order.shuffle(&mut rng);
    let source = Points::from_rows(&rows).unwrap();
    let noisy: Vec<[f64; 3]> = order.iter().map(|k| rows[*k].map(|x| x + 1e-6 * gauss(&mut rng))).collect();
    let target = Points::from_rows(&noisy).unwrap();
    let found = correspond(&source, &target, None);
    assert!(found.one_to_one && found.inlier_share == 1.0 && found.max < 1e-5 && found.rms < found.max);
    assert!(found.target_of_source.iter().enumerate().all(|(k, q)| order[q.unwrap()] == k));
    let fewer = target.select(&(0..500).collect::<Vec<_>>()).unwrap();
    let found = correspond(&source, &fewer, None);
    assert_eq!(found.target_of_source.iter().flatten().count(), 500);
    assert!((found.inlier_share - 500.0 / 700.0).abs() < 1e-12);
    assert_eq!(assign(&[1.0, f64::NAN], 2), None);
}

#[test]
fn per_axis_gives_every_coordinate_the_same_spread() {
    let points = Points::from_rows(&blob3(500, &mut rng(50))).unwrap();
    let transform = Registry::default().normaliser("per-axis").unwrap().fit(&points).unwrap();
    let covariance = transform.apply_covariance(points.covariance());
    for (i, row) in covariance.iter().enumerate() {
        assert!((row[i] - 0.25).abs() < 1e-12);
    }
    let flat = points.with_constant_coordinate(1.0).err().is_some();
    assert!(flat, "three coordinates are all there are");
}

#[test]
fn homographies_and_splines_start_from_affine_maps() {
    for (model, features) in [("homography", "hermite[degree=4]"), ("homography[relation=plane]", "hermite[degree=4]")]
    {
        for seed in 0..5 {
            let mut rng = rng(60 + seed);
            let rows = blob2(400, &mut rng);
            let (sin, cos) = (6.0 * rng.random::<f64>()).sin_cos();
            let truth = [1.2 * cos, -0.8 * sin, 0.3, 1.2 * sin, 0.8 * cos, -0.2, 0.08 * gauss(&mut rng), 0.08, 1.0];
            let mut images: Vec<[f64; 2]> = rows.iter().map(|p| cfpose::homography::apply(&truth, *p)).collect();
            images.shuffle(&mut rng);
            let settings = Settings {
                features: Some(features.into()),
                start: Some(Start::Named("whitened-affine".into())),
                ..Settings::preset("paper", model).unwrap()
            };
            let (source, target) = (Points::from_rows(&rows).unwrap(), Points::from_rows(&images).unwrap());
            let (estimator, estimate) = run(&settings, &source, &target);
            let h = estimator.homography(&estimate.theta).unwrap();
            let found = cfpose::homography::in_file_units(&h, None, None).unwrap();
            let error = (0..9).map(|i| (found[i] - truth[i]).abs()).fold(0.0, f64::max);
            assert!(error < 1e-7, "{model}, seed {seed}: {error}, cost {:.1e}", estimate.outcome.cost);
        }
    }
    // 32 unknowns, 14 features: the bending energy decides the rest, and an affine map does not bend.
    let rows = blob2(300, &mut rng(70));
    let moved: Vec<[f64; 2]> =
        rows.iter().rev().map(|p| [0.3 * p[0] - 1.1 * p[1] + 2.0, 0.9 * p[0] + 0.2 * p[1]]).collect();
    let settings = Settings {
        features: Some("hermite[degree=4]".into()),
        start: Some(Start::Named("whitened-affine".into())),
        ..Settings::preset("paper", "thin-plate2[grid=4,bending=0.01]").unwrap()
    };
    let (source, target) = (Points::from_rows(&rows).unwrap(), Points::from_rows(&moved).unwrap());
    let (estimator, estimate) = run(&settings, &source, &target);
    let found = estimator.matches(&estimate.theta, None).unwrap();
    assert!(found.max < 1e-7 && found.one_to_one, "{} {:?}", found.max, estimate.warnings);
    assert_eq!(estimate.conditioning.rank, 32);
}
