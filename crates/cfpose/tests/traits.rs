//! The traits hold everything of the method at once: weights that move with theta, run-time lifts, general maps, groups,
//! extra rows, nuisance noise, second derivatives - each written by an author without a derivative.

use std::sync::Arc;

use cfpose::block::Transform;
use cfpose::check::derivatives;
use cfpose::model::{Map, Model, PointMap, UnitRay, unit3};
use cfpose::problem::{Noise, ResidualRows};
use cfpose::theta::{BlockKind, Layout};
use cfpose::{BuildContext, Execution, MomentProblem, Points, Registry, Scalar};
use cfpose_optim::manifold::rotation_exp;
use cfpose_optim::problem::LeastSquares;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha12Rng;

/// Bearing with the area element of a plane, 1/z^3.
struct AreaBearing;

impl Map<3, 3, 3> for AreaBearing {
    fn affine<S: Scalar>(&self, theta: &[S], a: &mut [S], b: &mut [S]) {
        a.copy_from_slice(&theta[..9]);
        b.copy_from_slice(&theta[9..12]);
    }
    #[inline(always)]
    fn project<S: Scalar>(&self, y: [S; 3]) -> [S; 3] {
        unit3(y)
    }
    #[inline(always)]
    fn density<S: Scalar>(&self, y: [S; 3]) -> Option<S> {
        let w = y[2].recip();
        Some(w * w * w)
    }
}

/// The same in general form.
struct GeneralAreaBearing;

impl PointMap<3, 3> for GeneralAreaBearing {
    #[inline(always)]
    fn map<S: Scalar>(&self, theta: &[S], p: [S; 3]) -> [S; 3] {
        let mut y = [theta[9], theta[10], theta[11]];
        for i in 0..3 {
            for k in 0..3 {
                y[i] = y[i] + theta[3 * i + k] * p[k];
            }
        }
        unit3(y)
    }
    #[inline(always)]
    fn density<S: Scalar>(&self, theta: &[S], p: [S; 3]) -> Option<S> {
        let z = theta[6] * p[0] + theta[7] * p[1] + theta[8] * p[2] + theta[11];
        let w = z.recip();
        Some(w * w * w)
    }
}

/// A plane polynomial warp of run-time degree with its area element through four more rows of A.
struct Warp {
    degree: usize,
}

impl Warp {
    fn num_terms(&self) -> usize {
        (self.degree + 1) * (self.degree + 2) / 2
    }
}

impl Map<2, 6, 2> for Warp {
    fn lift_len(&self) -> usize {
        3 * self.num_terms()
    }
    fn lift(&self, p: [f64; 2], out: &mut [f64]) {
        let k = self.num_terms();
        let power = |x: f64, n: usize| x.powi(n as i32);
        let mut i = 0;
        for d in 0..=self.degree {
            for v in 0..=d {
                let u = d - v;
                out[i] = power(p[0], u) * power(p[1], v);
                out[k + i] = if u > 0 { u as f64 * power(p[0], u - 1) * power(p[1], v) } else { 0.0 };
                out[2 * k + i] = if v > 0 { v as f64 * power(p[0], u) * power(p[1], v - 1) } else { 0.0 };
                i += 1;
            }
        }
    }
    fn affine<S: Scalar>(&self, theta: &[S], a: &mut [S], _b: &mut [S]) {
        let k = self.num_terms();
        for c in 0..2 {
            for i in 0..k {
                a[c * 3 * k + i] = theta[c * k + i];
                a[(2 + 2 * c) * 3 * k + k + i] = theta[c * k + i];
                a[(3 + 2 * c) * 3 * k + 2 * k + i] = theta[c * k + i];
            }
        }
    }
    #[inline(always)]
    fn project<S: Scalar>(&self, y: [S; 6]) -> [S; 2] {
        [y[0], y[1]]
    }
    #[inline(always)]
    fn density<S: Scalar>(&self, y: [S; 6]) -> Option<S> {
        Some((y[2] * y[5] - y[3] * y[4]).abs())
    }
}

/// A prior that pulls the translation to zero.
struct TranslationPrior;

impl ResidualRows for TranslationPrior {
    fn num_rows(&self) -> usize {
        3
    }
    fn rows<S: Scalar>(&self, theta: &[S], out: &mut [S]) {
        for i in 0..3 {
            out[i] = theta[9 + i] * theta[9 + i] * 0.1;
        }
    }
}

fn points<const D: usize>(count: usize, centre: [f64; D], seed: u64) -> Points {
    let mut rng = ChaCha12Rng::seed_from_u64(seed);
    let rows: Vec<[f64; D]> = (0..count).map(|_| centre.map(|c| c + rng.random::<f64>() - 0.5)).collect();
    Points::from_rows(&rows).unwrap()
}

fn weighted(points: &Points, seed: u64) -> Points {
    let mut rng = ChaCha12Rng::seed_from_u64(seed);
    let columns = (0..points.dim()).map(|d| points.column(d).to_vec()).collect();
    Points::weighted(columns, (0..points.len()).map(|_| 0.5 + rng.random::<f64>()).collect()).unwrap()
}

fn scaled() -> Transform {
    Transform::new([0.1, 0.0, 0.2], [[1.4, 0.2, 0.0], [0.2, 1.3, 0.0], [0.0, 0.0, 1.2]])
}

fn problem(model: Model, family: &str, source: &Points, target: &Points) -> MomentProblem {
    let context = BuildContext { dim: model.dim(), ..BuildContext::default() };
    let family = Arc::from(Registry::default().family(family, &context).unwrap());
    MomentProblem::new(Arc::new(model), family, scaled(), source, target, Execution::default())
}

fn pose_theta() -> Vec<f64> {
    let mut theta = rotation_exp(&[0.2, -0.3, 0.4]).to_vec();
    theta.extend([0.1, -0.2, 0.3]);
    theta
}

fn warp_theta(degree: usize) -> (Layout, Vec<f64>) {
    let k = (degree + 1) * (degree + 2) / 2;
    let mut theta: Vec<f64> = (0..2 * k).map(|i| 0.02 * (1.7 * i as f64).sin()).collect();
    theta[1] += 1.0;
    theta[k + 2] += 1.0;
    (Layout::new(&[("coefficients", "1", BlockKind::Vector(2 * k))]), theta)
}

#[track_caller]
fn check(problem: &MomentProblem, theta: &[f64]) {
    let report = derivatives(problem, theta);
    assert!(report.finite_difference < 1e-6 && report.oracle < 1e-12 && report.lanes < 1e-12, "{report:?}");
}

#[test]
fn weights_that_depend_on_theta_enter_the_jacobian_in_both_forms() {
    let (source, target) = (weighted(&points(150, [0.0, 0.0, 1.5], 1), 9), points(130, [0.0, 0.0, 1.0], 2));
    let factored = Model::new(Layout::pose3(), AreaBearing).with_target(UnitRay);
    let general = Model::general(Layout::pose3(), GeneralAreaBearing).with_target(UnitRay);
    let (factored, general) =
        (problem(factored, "trig18", &source, &target), problem(general, "trig18", &source, &target));
    check(&factored, &pose_theta());
    check(&general, &pose_theta());
    let (a, b) = (factored.evaluate(&pose_theta()), general.evaluate(&pose_theta()));
    for (x, y) in a.residual.iter().zip(&b.residual).chain(a.jacobian.iter().zip(&b.jacobian)) {
        assert!((x - y).abs() < 1e-11 * x.abs().max(1.0), "{x} {y}");
    }
}

#[test]
fn a_lift_of_run_time_size_and_more_than_eight_unknowns_work() {
    let (layout, theta) = warp_theta(3);
    let (source, target) = (points(150, [0.0, 0.0], 3), points(130, [0.0, 0.0], 4));
    check(&problem(Model::new(layout, Warp { degree: 3 }), "hermite[degree=6]", &source, &target), &theta);
}

#[test]
fn groups_share_theta_and_extra_rows_follow_them() {
    let model = Model::new(Layout::pose3(), AreaBearing).with_target(UnitRay);
    let (a, b) = (points(100, [0.0, 0.0, 1.5], 5), points(90, [0.2, 0.0, 1.6], 6));
    let one = problem(model, "trig18", &a, &b);
    let one_cost = one.evaluate(&pose_theta()).cost;
    let both = one.with_group(&b, &a).with_rows(Arc::new(TranslationPrior));
    assert_eq!(both.num_residuals(), 18 + 18 + 3);
    check(&both, &pose_theta());
    let all = both.evaluate(&pose_theta());
    let first: f64 = all.residual[..18].iter().map(|r| 0.5 * r * r).sum();
    assert!((first - one_cost).abs() < 1e-15);
}

#[test]
fn noise_is_a_parameter_with_derivatives_through_the_blur() {
    for (noise, nuisance) in [(Noise::Isotropic, vec![0.02]), (Noise::Full, vec![0.02, 0.005, 0.03])] {
        for family in ["trig18", "hermite[degree=4]"] {
            let (layout, mut theta) = warp_theta(1);
            let model = Model::new(layout, Warp { degree: 1 });
            let (source, target) = (points(150, [0.0, 0.0], 7), points(130, [0.0, 0.0], 8));
            let problem = problem(model, family, &source, &target).with_noise(noise);
            theta.extend(&nuisance);
            assert_eq!(problem.manifold().tangent(), 6 + nuisance.len());
            check(&problem, &theta);
        }
    }
}

#[test]
fn whitening_multiplies_the_feature_rows() {
    let model = Model::new(Layout::pose3(), AreaBearing).with_target(UnitRay);
    let (a, b) = (points(100, [0.0, 0.0, 1.5], 5), points(90, [0.2, 0.0, 1.6], 6));
    let mut rng = ChaCha12Rng::seed_from_u64(4);
    let matrix: Vec<f64> = (0..10 * 18).map(|_| rng.random::<f64>() - 0.5).collect();
    let weighted = problem(model, "trig18", &a, &b).with_whitening(Some(matrix));
    assert_eq!(weighted.num_residuals(), 10);
    check(&weighted, &pose_theta());
}

#[test]
fn exact_second_derivatives_equal_differences_of_the_jacobian() {
    let model = Model::new(Layout::pose3(), AreaBearing).with_target(UnitRay);
    let (a, b) = (points(60, [0.0, 0.0, 1.5], 5), points(50, [0.2, 0.0, 1.6], 6));
    let problem = problem(model, "hermite[degree=2]", &a, &b);
    let theta = pose_theta();
    let (l, m) = (problem.num_residuals(), 6);
    let weights: Vec<f64> = (0..l).map(|i| 1.0 + 0.3 * i as f64).collect();
    let mut hessian = vec![0.0; m * m];
    problem.curvature(&theta, &weights, &mut hessian);
    // Second differences of the weighted residual along the retraction.
    let h = 1e-4;
    let value = |step: &[f64]| {
        let mut moved = theta.clone();
        problem.manifold().retract(&theta, step, &mut moved);
        let mut r = vec![0.0; l];
        problem.residual(&moved, &mut r);
        r.iter().zip(&weights).map(|(r, w)| r * w).sum::<f64>()
    };
    for u in 0..m {
        for v in 0..=u {
            let at = |su: f64, sv: f64| {
                let mut step = vec![0.0; m];
                step[u] += su * h;
                step[v] += sv * h;
                value(&step)
            };
            let difference = (at(1.0, 1.0) - at(1.0, -1.0) - at(-1.0, 1.0) + at(-1.0, -1.0)) / (4.0 * h * h);
            let exact = hessian[u * m + v];
            assert!((difference - exact).abs() < 1e-5 * exact.abs().max(10.0), "({u},{v}): {difference} {exact}");
        }
    }
}
