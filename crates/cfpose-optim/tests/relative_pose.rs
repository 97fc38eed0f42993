//! norm(T) = 1 in four ways on a relative pose with given correspondences: all reach the same point.

use cfpose_optim::testproblems::pose::RelativePose;
use cfpose_optim::{Control, solvers};

fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max)
}

#[test]
fn sphere_cones_null_space_and_penalty_agree() {
    for seed in 0..10 {
        let views = RelativePose::simulate(40, 0.4, 1e-3, seed);
        let start = views.start(0.15);
        let solve = |spec: &str, constrained: bool| {
            let solver = solvers::build(spec).expect("a known solver");
            let mut control = Control::default();
            let outcome = if constrained {
                solver.solve(&views.clone().constrained(None), &start, &mut control)
            } else {
                solver.solve(&views.clone().on_sphere(), &start, &mut control)
            };
            outcome.expect("a good start")
        };
        let sphere = solve("levenberg-marquardt", false);
        assert!(sphere.status.converged(), "{sphere:?}");
        assert!(largest_difference(&sphere.theta, &views.truth) < 0.05, "seed {seed}: {:?}", sphere.theta);
        for spec in ["clarabel", "null-space", "augmented-lagrangian", "penalty"] {
            let other = solve(spec, true);
            let difference = largest_difference(&sphere.theta, &other.theta);
            assert!(other.usable() && other.violation < 1e-8, "{spec}, seed {seed}: {other:?}");
            assert!(
                difference < 1e-5,
                "{spec}, seed {seed}: {difference:e}, {} {}",
                other.status.name(),
                other.message
            );
        }
    }
}

/// A linear inequality on the translation: without effect where it holds, and where it does not, the same point on its
/// boundary by cones and by multipliers.
#[test]
fn a_half_space_holds_the_translation() {
    let views = RelativePose::simulate(40, 0.4, 1e-3, 5);
    let start = views.start(0.1);
    let direction = [views.truth[9], views.truth[10], views.truth[11]];
    let solve = |spec: &str, half_space| {
        let solver = solvers::build(spec).expect("a known solver");
        let problem = views.clone().constrained(half_space);
        solver.solve(&problem, &start, &mut Control::default()).expect("a good start")
    };
    let free = solve("clarabel", None);
    let inactive = solve("clarabel", Some((direction, 0.5)));
    assert!(largest_difference(&free.theta, &inactive.theta) < 1e-6, "{inactive:?}");

    // Keep T at 3 degrees from the truth at least: T . (-direction) >= -cos 3 degrees.
    let away = direction.map(|d| -d);
    let half_space = Some((away, -(3.0_f64.to_radians().cos())));
    let (cones, multipliers) = (solve("clarabel", half_space), solve("augmented-lagrangian", half_space));
    for outcome in [&cones, &multipliers] {
        assert!(outcome.usable() && outcome.violation < 1e-8, "{outcome:?}");
        let angle = (0..3).map(|i| outcome.theta[9 + i] * direction[i]).sum::<f64>().acos().to_degrees();
        assert!((angle - 3.0).abs() < 1e-5, "{angle} {outcome:?}");
    }
    assert!((cones.cost / multipliers.cost - 1.0).abs() < 1e-6, "{:e} {:e}", cones.cost, multipliers.cost);
    assert!(largest_difference(&cones.theta, &multipliers.theta) < 1e-4);
}
