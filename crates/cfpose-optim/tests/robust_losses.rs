//! Robust losses: derivatives, monotone costs, and the same minimum by different solvers.

use cfpose_optim::check::check_derivatives;
use cfpose_optim::robust::{Robust, RobustLoss};
use cfpose_optim::testproblems::pose::Alignment;
use cfpose_optim::{Control, LeastSquares, solvers};

const LOSSES: [RobustLoss; 4] = [
    RobustLoss::Huber { scale: 0.1 },
    RobustLoss::Cauchy { scale: 0.1 },
    RobustLoss::GemanMcClure { scale: 0.1 },
    RobustLoss::Truncated { scale: 0.3 },
];

/// Points with a fifth of gross outliers, and the pose of the clean ones.
fn spoilt() -> (Alignment, Vec<f64>) {
    let mut points = Alignment::simulate(40, 0.7, 0.02, 11);
    let truth = points.closed_form().expect("forty points");
    for k in (0..40).step_by(5) {
        points.target[k][k % 3] += 3.0;
    }
    (points, truth)
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max)
}

#[test]
fn derivatives_of_every_loss() {
    let (points, truth) = spoilt();
    let problem = points.problem();
    for loss in LOSSES {
        for block in [1, 3] {
            let robust = Robust::new(&problem, loss, block);
            let report = check_derivatives(&robust, &truth);
            assert!(report.passes(1e-6), "{loss:?}, blocks of {block}: {report}");
        }
    }
}

#[test]
fn every_loss_recovers_the_pose_and_the_cost_never_rises() {
    let (points, truth) = spoilt();
    let start = points.closed_form().expect("forty points");
    assert!(distance(&start, &truth) > 0.2);
    let problem = points.problem();
    for loss in LOSSES {
        let robust = Robust::new(&problem, loss, 3);
        for spec in ["levenberg-marquardt", "trust-region", "newton-trust-region", "l-bfgs", "nelder-mead"] {
            // Redescending losses need a start near: the Huber estimate.
            let near = solvers::build("levenberg-marquardt").expect("a known solver");
            let huber = Robust::new(&problem, RobustLoss::Huber { scale: 0.05 }, 3);
            let near = near.solve(&huber, &start, &mut Control::default()).expect("a good start");
            let solver = solvers::build(spec).expect("a known solver");
            let mut control = Control { trace: true, ..Control::default() };
            (control.stopping.max_evaluations, control.stopping.max_iterations) = (20_000, 20_000);
            let outcome = solver.solve(&robust, &near.theta, &mut control).expect("a good start");
            assert!(outcome.usable(), "{loss:?}, {spec}: {outcome:?}");
            let error = distance(&outcome.theta, &truth);
            assert!(error < 0.05, "{loss:?}, {spec}: {error}");
            let accepted: Vec<f64> = outcome.trace.iter().filter(|row| row.accepted).map(|row| row.cost).collect();
            let rise = accepted.windows(2).map(|w| w[1] / w[0] - 1.0).fold(0.0, f64::max);
            assert!(rise < 1e-13, "{loss:?}, {spec}: the cost rose by {rise:e}");
        }
    }
}

/// Huber's loss inside the cone program and around the problem are the same minimisation.
#[test]
fn cones_and_wrapper_agree() {
    let (points, truth) = spoilt();
    let start = points.closed_form().expect("forty points");
    let problem = points.problem();
    let robust = Robust::new(&problem, RobustLoss::Huber { scale: 0.1 }, 1);
    let run = |spec: &str, problem: &dyn LeastSquares| {
        let solver = solvers::build(spec).expect("a known solver");
        solver.solve(problem, &start, &mut Control::default()).expect("a good start")
    };
    let wrapped = run("trust-region", &robust);
    let cones = run("clarabel[loss=huber,scale=0.1]", &problem);
    assert!((wrapped.cost / cones.cost - 1.0).abs() < 1e-9, "{} {}", wrapped.cost, cones.cost);
    assert!(distance(&wrapped.theta, &cones.theta) < 1e-5);

    let absolute = run("clarabel[loss=l1]", &problem);
    assert!(absolute.usable() && distance(&absolute.theta, &truth) < 0.05, "{absolute:?}");
    let mut residual = vec![0.0; problem.num_residuals()];
    problem.residual(&absolute.theta, &mut residual);
    let sum: f64 = residual.iter().map(|r| r.abs()).sum();
    assert!((sum / absolute.cost - 1.0).abs() < 1e-14);
    // No step along a coordinate lowers the sum of absolute values.
    for j in 0..6 {
        for h in [1e-4, -1e-4] {
            let (mut step, mut moved) = (vec![0.0; 6], absolute.theta.clone());
            step[j] = h;
            problem.manifold().retract(&absolute.theta, &step, &mut moved);
            problem.residual(&moved, &mut residual);
            let near = residual.iter().map(|r| r.abs()).sum::<f64>();
            assert!(near > sum, "coordinate {j}: {:e} lower, {absolute:?}", sum - near);
        }
    }
}
