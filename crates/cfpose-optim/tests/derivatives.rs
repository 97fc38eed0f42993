//! Derivatives of every test problem against differences, first and second, on flat and curved manifolds.

use std::sync::Arc;

use cfpose_optim::LeastSquares;
use cfpose_optim::check::check_derivatives;
use cfpose_optim::manifold::{Euclidean, Manifold, Product, Rotation3};
use cfpose_optim::masked::Restricted;
use cfpose_optim::testproblems::pose::{Alignment, RelativePose};
use cfpose_optim::testproblems::{hock_schittkowski, more_garbow_hillstrom, nist};

fn check(name: &str, problem: &dyn LeastSquares, theta: &[f64], tolerance: f64) {
    let report = check_derivatives(problem, theta);
    assert!(report.passes(tolerance), "{name}: {report}");
}

#[test]
fn problems_on_vector_spaces() {
    for reference in more_garbow_hillstrom::all().into_iter().chain(hock_schittkowski::all()) {
        // Number 3 mixes 1e4 x y with exp: differences see its curvature to fewer digits.
        let tolerance = if reference.name.starts_with("3 ") { 1e-5 } else { 1e-6 };
        check(&reference.name, reference.problem.as_ref(), &reference.start, tolerance);
    }
    for problem in nist::all() {
        check(problem.name, &problem.problem(), problem.certified.parameters, 1e-5);
    }
}

#[test]
fn poses_on_their_manifolds() {
    let pose: Arc<dyn Manifold> = Arc::new(Product::new(vec![Arc::new(Rotation3), Arc::new(Euclidean(3))]));
    let alignment = Alignment::simulate(9, 2.0, 0.1, 1);
    let theta = alignment.closed_form().expect("nine points");
    let problem = alignment.problem();
    check("alignment", &problem, &theta, 1e-7);
    let restricted = Restricted::new(&problem, pose, &[false, false, true, true, true, false]);
    check("alignment, yaw and two translations", &restricted, &theta, 1e-7);

    let two_views = RelativePose::simulate(15, 0.4, 1e-3, 2);
    let start = two_views.start(0.3);
    check("relative pose on the sphere", &two_views.clone().on_sphere(), &start, 1e-7);
    check("relative pose in space", &two_views.constrained(None), &start, 1e-7);
}

#[test]
fn a_wrong_jacobian_is_found() {
    struct Wrong(cfpose_optim::testproblems::Rosenbrock);
    impl LeastSquares for Wrong {
        fn manifold(&self) -> &dyn Manifold {
            self.0.manifold()
        }
        fn num_residuals(&self) -> usize {
            2
        }
        fn residual(&self, theta: &[f64], residual: &mut [f64]) {
            self.0.residual(theta, residual);
        }
        fn jacobian(&self, theta: &[f64], residual: &mut [f64], jacobian: &mut [f64]) {
            self.0.jacobian(theta, residual, jacobian);
            jacobian[0] *= 1.001;
        }
    }
    let report = check_derivatives(&Wrong(cfpose_optim::testproblems::Rosenbrock), &[-1.2, 1.0]);
    assert!(!report.passes(1e-5), "{report}");
    let worst = report.jacobian.iter().max_by(|a, b| a.relative_error.total_cmp(&b.relative_error)).expect("entries");
    assert_eq!((worst.row, worst.column), (0, 0));
}
