//! What each family promises: orthonormality, order, blurs, concatenation, Gram matrices.

use std::sync::Arc;

use cfpose::check::{Sample, derivatives};
use cfpose::families::orthonormalised::{Method, Of, Orthonormalised, Weight};
use cfpose::families::quadrature_blur::QuadratureBlur;
use cfpose::family::{DynFamily, General};
use cfpose::problem::Noise;
use cfpose::statistics::gram::gram;
use cfpose::{BuildContext, Execution, Family, Points, Registry, Scalar};
use gauss_quad::{GaussHermite, GaussLegendre};
use num_dual::HyperDual64;
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha12Rng;

fn family_on(spec: &str, target: &Points) -> Box<dyn DynFamily> {
    let context = BuildContext { dim: target.dim(), target: Some(target), ..BuildContext::default() };
    Registry::default().family(spec, &context).unwrap()
}

fn family(spec: &str) -> Box<dyn DynFamily> {
    Registry::default().family(spec, &BuildContext::default()).unwrap()
}

/// A lopsided cloud with weights.
fn cloud(dim: usize, count: usize, seed: u64) -> Points {
    let mut rng = ChaCha12Rng::seed_from_u64(seed);
    let mut columns = vec![Vec::new(); dim];
    for _ in 0..count {
        let u: f64 = rng.random();
        for (q, column) in columns.iter_mut().enumerate() {
            column.push(0.9 * rng.random::<f64>() - 0.5 + 0.3 * u * u * (q as f64 - 0.5));
        }
    }
    Points::weighted(columns, (0..count).map(|_| 0.5 + rng.random::<f64>()).collect()).unwrap()
}

/// Features and their gradients (feature x dim) at a point, by the second-order path.
fn features_with_gradients(family: &dyn DynFamily, x: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let (dim, num) = (x.len(), family.num_basis(x.len()));
    let c = family.coefficients(dim);
    let mut gradients = vec![0.0; family.num_features(dim) * dim];
    for q in 0..dim {
        let seeded: Vec<HyperDual64> =
            (0..dim).map(|d| HyperDual64::new(x[d], f64::from(u8::from(d == q)), 0.0, 0.0)).collect();
        let mut basis = vec![HyperDual64::from(0.0); num];
        family.hyper(&seeded, &mut basis);
        for i in 0..gradients.len() / dim {
            gradients[i * dim + q] = match &c {
                None => basis[i].eps1,
                Some(c) => (0..num).map(|k| c[i * num + k] * basis[k].eps1).sum(),
            };
        }
    }
    (family.features(x), gradients)
}

/// Largest deviation of E f f' (or of gradients) from the identity under nodes (coordinates, weight).
fn deviation(family: &dyn DynFamily, nodes: &[(Vec<f64>, f64)], of_gradients: bool) -> f64 {
    let (dim, total) = (nodes[0].0.len(), nodes.iter().map(|(_, w)| w).sum::<f64>());
    let l = family.num_features(dim);
    let mut sum = vec![0.0; l * l];
    for (x, w) in nodes {
        let (values, gradients) = features_with_gradients(family, x);
        let (rows, width) = if of_gradients { (gradients, dim) } else { (values, 1) };
        for i in 0..l {
            for j in 0..l {
                let product: f64 = (0..width).map(|q| rows[i * width + q] * rows[j * width + q]).sum();
                sum[i * l + j] += product * w / total;
            }
        }
    }
    (0..l * l)
        .fold(0.0, |worst, index| f64::max(worst, (sum[index] - f64::from(u8::from(index / l == index % l))).abs()))
}

/// Tensor product of a rule of one coordinate.
fn tensor(rule: &[(f64, f64)], dim: usize) -> Vec<(Vec<f64>, f64)> {
    let mut nodes = vec![(Vec::new(), 1.0)];
    for _ in 0..dim {
        nodes = nodes
            .iter()
            .flat_map(|(x, w)| rule.iter().map(move |(t, u)| ([x.as_slice(), &[*t]].concat(), w * u)))
            .collect();
    }
    nodes
}

/// The paper's weight p(x) = 2 / sqrt(2 pi) exp(-2 x^2).
fn gaussian(dim: usize) -> Vec<(Vec<f64>, f64)> {
    let rule: Vec<(f64, f64)> =
        GaussHermite::new(40.try_into().unwrap()).iter().map(|(t, w)| (t * 0.5_f64.sqrt(), *w)).collect();
    tensor(&rule, dim)
}

fn nodes_of(points: &Points) -> Vec<(Vec<f64>, f64)> {
    (0..points.len()).map(|k| (points.point(k)[..points.dim()].to_vec(), points.weights()[k])).collect()
}

#[test]
fn orthonormalised_families_are_orthonormal_under_their_weight() {
    let cases = [
        ("trig", 1),
        ("trig", 2),
        ("monomial[degree=4]", 1),
        ("monomial[degree=3]", 2),
        ("fourier[k=2]", 2),
        ("chebyshev", 2),
    ];
    for (basis, dim) in cases {
        for method in ["eigen", "gram-schmidt"] {
            for of in ["values", "gradients"] {
                let spec = format!("orthonormalised[basis={basis},of={of},method={method},coordinates=joint]");
                let built = family(&spec);
                assert!(built.num_features(dim) > 0, "{spec}");
                let worst = deviation(built.as_ref(), &gaussian(dim), of == "gradients");
                assert!(worst < 1e-7, "{spec} in {dim} dimensions: {worst}");
                let points = cloud(dim, 300, 4);
                let spec = spec.replace("basis=", "weight=empirical,basis=");
                let built = family_on(&spec, &points);
                let worst = deviation(built.as_ref(), &nodes_of(&points), of == "gradients");
                assert!(worst < 1e-7, "{spec} in {dim} dimensions: {worst}");
            }
        }
    }
    // The whole three dimensions once, by the report instead of the slow path.
    let points = cloud(3, 2000, 5);
    let built = family_on("orthonormalised[basis=hermite[degree=2] + fourier[k=2,w0=3],weight=empirical]", &points);
    let report = gram(built.as_ref(), &points);
    assert_eq!((report.num_features, report.values.rank), (9 + 32, 41));
    assert!((report.values.condition - 1.0).abs() < 1e-7, "{report}");
}

#[test]
fn the_construction_gives_the_printed_functions() {
    let exact = family("orthonormalised[basis=trig,weight=gaussian,of=values,method=eigen]");
    let (exact, printed) = (exact.coefficients(1).unwrap(), family("trig18").coefficients(1).unwrap());
    assert_eq!(exact.len(), 36);
    let mut worst = 0.0_f64;
    for (mine, print) in exact.chunks_exact(6).zip(printed.chunks_exact(6)) {
        let largest = mine.iter().fold(0.0_f64, |a, b| if b.abs() > a.abs() { *b } else { a });
        assert!(largest > 0.0, "the stated rule of signs");
        let sign = if print.iter().zip(mine).map(|(a, b)| a * b).sum::<f64>() < 0.0 { -1.0 } else { 1.0 };
        for (a, b) in mine.iter().zip(print) {
            worst = worst.max((sign * a - b).abs());
        }
    }
    assert!(worst < 2.95e-3 && worst > 2.8e-3, "largest difference from the print {worst}");
    // The last function has the smallest eigenvalue and the largest error of the print.
    for (mine, expected) in exact[30..33].iter().zip([4.6580, -2.2909, 5.1859]) {
        assert!((mine - expected).abs() < 5e-5, "{:?}", &exact[30..36]);
    }
    // In three dimensions the order is that of f_1..f_18, the coordinate index fastest.
    let full = family("orthonormalised");
    let (a, b) = (full.features(&[0.3, -0.7, 0.05]), family("trig18").features(&[0.3, -0.7, 0.05]));
    assert_eq!(a.len(), 18);
    assert!(a.iter().zip(&b).all(|(x, y)| (x.abs() - y.abs()).abs() < 3e-3), "{a:?} {b:?}");
}

#[test]
fn gram_schmidt_keeps_the_order_of_a_user_basis_and_drops_dependent_functions() {
    struct Mine;
    impl Family for Mine {
        fn num_basis(&self, _dim: usize) -> usize {
            3
        }
        #[inline(always)]
        fn basis<S: Scalar, const D: usize>(&self, x: [S; D], out: &mut [S]) {
            out[0] = x[0];
            out[1] = x[0] * 2.0;
            out[2] = x[0] * x[0] + x[0];
        }
    }
    let built = Orthonormalised::new(Box::new(General(Mine)), Weight::Gaussian, Of::Values, Method::GramSchmidt);
    // E x^2 = 1/4: f_1 = 2 x; x^2 + x minus its projection is x^2, and E x^4 = 3/16.
    let c = built.coefficients(1).unwrap();
    let expected = [2.0, 0.0, 0.0, -(16.0_f64 / 3.0).sqrt(), 0.0, (16.0_f64 / 3.0).sqrt()];
    assert!(c.len() == 6 && c.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{c:?}");
}

#[test]
fn legendre_and_chebyshev_are_orthonormal_under_their_weights() {
    let a = 0.7;
    let uniform: Vec<(f64, f64)> =
        GaussLegendre::new(20.try_into().unwrap()).iter().map(|(t, w)| (a * t, 0.5 * w)).collect();
    // Gauss-Chebyshev: equal weights at cosines.
    let arcsine: Vec<(f64, f64)> =
        (0..20).map(|k| (a * (std::f64::consts::PI * (f64::from(k) + 0.5) / 20.0).cos(), 0.05)).collect();
    for (name, rule) in [("legendre", uniform), ("chebyshev", arcsine)] {
        for (kind, dim) in [("total", 1), ("total", 3), ("separable", 2)] {
            let built = family(&format!("{name}[degree=4,kind={kind},half-width={a}]"));
            let worst = deviation(built.as_ref(), &tensor(&rule, dim), false);
            // Separable products of degree 0 in all other coordinates are orthonormal too: means of P_n, n >= 1, vanish.
            assert!(worst < 1e-10, "{name} {kind} in {dim}: {worst}");
        }
        let raw = family(&format!("{name}[degree=5,scale=raw,half-width={a}]"));
        assert!(raw.features(&[a]).iter().all(|value| (value - 1.0).abs() < 1e-12), "value 1 at the end");
    }
}

#[test]
fn fourier_equals_sines_and_cosines_of_each_frequency() {
    let mut rng = ChaCha12Rng::seed_from_u64(8);
    let (w0, h) = (1.3, 0.25);
    for (dim, k_max, expected) in [(1, 8_i32, 16), (2, 4, 48), (3, 4, 256), (3, 8, 2108)] {
        let built = family(&format!("fourier[k={k_max},w0={w0},damping={h}]"));
        let range = |q: usize| if q < dim { -k_max..=k_max } else { 0..=0 };
        let mut modes = Vec::new();
        for x in range(0) {
            for y in range(1) {
                for z in range(2) {
                    let square = x * x + y * y + z * z;
                    let first = [x, y, z].into_iter().find(|e| *e != 0);
                    if first.is_some_and(|e| e > 0) && square <= k_max * k_max {
                        modes.push((square, [x, y, z]));
                    }
                }
            }
        }
        modes.sort();
        assert_eq!(built.num_basis(dim), 2 * modes.len());
        assert_eq!(2 * modes.len(), expected);
        for _ in 0..20 {
            let x: Vec<f64> = (0..dim).map(|_| 3.0 * rng.random::<f64>() - 1.5).collect();
            let features = built.features(&x);
            for (i, (square, mode)) in modes.iter().enumerate() {
                let phase: f64 = (0..dim).map(|q| w0 * f64::from(mode[q]) * x[q]).sum();
                let damping = (-0.5 * h * h * w0 * w0 * f64::from(*square)).exp();
                let error = (features[i] - damping * phase.cos()).abs();
                let error = error.max((features[modes.len() + i] - damping * phase.sin()).abs());
                assert!(error < 1e-13, "{mode:?}: {error}");
            }
        }
    }
}

#[test]
fn angular_functions_are_harmonics_of_the_angle() {
    let built = family("angular[harmonics=32,decay=0]");
    assert!(!built.supports(1) && built.supports(2) && !built.supports(3));
    for k in 0..50 {
        let phi = 0.13 * f64::from(k) - 3.0;
        let features = built.features(&[phi.cos(), phi.sin()]);
        for n in 1..=32_usize {
            let angle = n as f64 * phi;
            assert!((features[n - 1] - angle.cos()).abs() < 1e-13 && (features[31 + n] - angle.sin()).abs() < 1e-13);
            let divided = family("angular[harmonics=32]").features(&[phi.cos(), phi.sin()])[n - 1] * n as f64;
            assert!((divided - features[n - 1]).abs() < 1e-15);
        }
    }
}

#[test]
fn families_that_depend_on_seed_or_target_are_reproducible() {
    let x = [0.2, -0.4];
    let seeded = |spec: &str, seed| {
        let context = BuildContext { dim: 2, seed, ..BuildContext::default() };
        Registry::default().family(spec, &context).unwrap().features(&x)
    };
    assert_eq!(seeded("random-fourier[seed=3]", 1), seeded("random-fourier[seed=3]", 2));
    assert_eq!(seeded("random-fourier", 3), seeded("random-fourier[seed=3]", 1));
    assert_ne!(seeded("random-fourier", 3), seeded("random-fourier", 4));
    // Frequencies have the stated scale: E cos(w.x) = exp(-scale^2 |x|^2 / 2).
    let many = seeded("random-fourier[count=4096,scale=3]", 1);
    let mean = many[..4096].iter().sum::<f64>() / 4096.0;
    assert!((mean - (-0.5 * 9.0 * 0.2_f64).exp()).abs() < 0.03, "{mean}");

    let target = cloud(2, 200, 1);
    let mut order: Vec<usize> = (0..200).collect();
    order.shuffle(&mut ChaCha12Rng::seed_from_u64(2));
    let shuffled = target.select(&order).unwrap();
    for spec in ["rbf[count=20]", "rbf[count=20,centres=grid]"] {
        let (a, b) = (family_on(spec, &target), family_on(spec, &shuffled));
        assert_eq!(a.features(&x), b.features(&x), "{spec}");
        assert_eq!(a.num_basis(2), if spec.contains("grid") { 16 } else { 20 });
    }
    // Three distinct points cannot give four centres.
    let few = Points::from_rows(&[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 0.0]]).unwrap();
    assert_eq!(family_on("rbf[count=4]", &few).num_basis(2), 3);
}

#[test]
fn a_concatenation_is_its_parts() {
    let registry = Registry::default();
    let sum = "2*trig18 + 1e+0 * fourier[k=2, damping=0.3] +0.5*hermite[degree=2]";
    let parts = [("trig18", 2.0), ("fourier[k=2,damping=0.3]", 1.0), ("hermite[degree=2]", 0.5)];
    for model in ["rigid3", "bearing3"] {
        let sample = Sample::draw(&registry, model, 150, 0.5, 3).unwrap();
        let evaluate = |spec: &str| {
            let problem = sample.problem(&registry, spec, &Execution::default()).unwrap().unwrap();
            problem.evaluate(&sample.theta)
        };
        let whole = evaluate(sum);
        let (mut residual, mut jacobian) = (Vec::new(), Vec::new());
        for (spec, weight) in parts {
            let part = evaluate(spec);
            residual.extend(part.residual.iter().map(|r| weight * r));
            jacobian.extend(part.jacobian.iter().map(|j| weight * j));
        }
        assert_eq!(whole.residual.len(), residual.len());
        for (a, b) in whole.residual.iter().zip(&residual).chain(whole.jacobian.iter().zip(&jacobian)) {
            assert!((a - b).abs() < 1e-14 * b.abs().max(1.0), "{a} {b}");
        }
    }
}

#[test]
fn errors_in_sums_and_nested_names_are_one_clear_line() {
    let registry = Registry::default();
    let context = BuildContext { dim: 2, ..BuildContext::default() };
    let message = |spec: &str| registry.family(spec, &context).err().unwrap().to_string();
    assert!(message("trig18 + fouriers").contains("unknown family `fouriers`; did you mean fourier?"));
    assert!(message("trig18 + ").contains("a family is missing beside `+`"));
    assert!(message("two*trig18").contains("the weight `two` before `*` is not a number"));
    assert!(message("-1*trig18").contains("the weight -1 is not a positive number"));
    assert!(message("orthonormalised[basis=trig19]").contains("trig18?"));
    assert!(message("orthonormalised[weight=empirical]").contains("needs the target points"));
    assert!(message("rbf").contains("target points"));
    assert!(message("quadrature-blur[family=trig18,nodes=4]").contains("odd number"));
    let deep = "orthonormalised[basis=".repeat(5000);
    assert!(message(&deep).contains("nested more than"));
    let context = BuildContext { dim: 3, ..BuildContext::default() };
    let error = registry.family("trig18 + angular", &context).err().unwrap().to_string();
    assert_eq!(error, "angular: the family does not exist in 3 dimension(s)");
    for text in ["", "+", "*", "[", "]", "a[", "1*", "1e+", "trig18[]+", "é*b", "trig18++trig18"] {
        assert_eq!(message(text).lines().count(), 1, "{text}");
    }
}

/// E exp(-|x + e - c|^2 / (2 s^2)) for Gaussian e: a wider Gaussian with covariance s^2 I + cov.
fn blurred_gaussian(x: [f64; 2], c: [f64; 3], s: f64, cov: [f64; 3]) -> f64 {
    let (a, b, d) = (s * s + cov[0], cov[1], s * s + cov[2]);
    let det = a * d - b * b;
    let y = [x[0] - c[0], x[1] - c[1]];
    let square = (d * y[0] * y[0] - 2.0 * b * y[0] * y[1] + a * y[1] * y[1]) / det;
    s * s / det.sqrt() * (-0.5 * square).exp()
}

#[test]
fn the_quadrature_blur_serves_families_without_a_closed_form() {
    let target = cloud(2, 40, 6);
    let x = [0.15, -0.2];
    let blurred = |family: &dyn DynFamily, cov: [f64; 3]| -> Vec<f64> {
        let mut values = vec![0.0; family.num_basis(2)];
        family.values(&x, &mut values);
        let mut means: Vec<HyperDual64> = values.into_iter().map(HyperDual64::from).collect();
        assert!(family.blur_hyper(2, &cov.map(HyperDual64::from), &mut means));
        means.iter().map(|dual| dual.re).collect()
    };
    // Radial functions: exact convolution of Gaussians. Isotropic at the chosen spread, smaller, larger, correlated.
    let rbf = family_on("rbf[count=6,width=0.5]", &target);
    assert!(!rbf.blur_hyper(2, &[HyperDual64::from(0.0); 3], &mut [HyperDual64::from(0.0); 6]));
    let wrapped = family_on("quadrature-blur[family=rbf[count=6,width=0.5],spread=0.1]", &target);
    let centres = centres_of(rbf.as_ref());
    for (cov, bound) in [([0.01, 0.0, 0.01], 2e-6), ([0.001, 0.0, 0.002], 2e-5), ([0.02, 0.004, 0.01], 1e-4)] {
        for (i, value) in blurred(wrapped.as_ref(), cov)[..6].iter().enumerate() {
            let exact = blurred_gaussian(x, centres[i], 0.5, cov);
            assert!((value - exact).abs() < bound, "{cov:?}: {value} {exact}");
        }
    }
    // Polynomials below the number of nodes in each coordinate: exact for any covariance, negative ones included.
    let closed = family("hermite[degree=4]");
    let wrapped = QuadratureBlur::new(Arc::from(family("hermite[degree=4]")), 5, 0.2);
    for cov in [[0.03, 0.01, 0.05], [-0.01, 0.02, -0.02], [0.0; 3]] {
        let (exact, value) = (blurred(closed.as_ref(), cov), blurred(&wrapped, cov));
        for (a, b) in exact.iter().zip(&value) {
            assert!((a - b).abs() < 1e-12, "{cov:?}: {a} {b}");
        }
    }
}

/// Find the centres of radial functions: the gradient of log f is -(x - c) / s^2.
fn centres_of(rbf: &dyn DynFamily) -> Vec<[f64; 3]> {
    let (values, gradients) = features_with_gradients(rbf, &[0.0, 0.0]);
    (0..values.len())
        .map(|i| [0, 1].map(|q| 0.25 * gradients[2 * i + q] / values[i]))
        .map(|c| [c[0], c[1], 0.0])
        .collect()
}

#[test]
fn problems_model_noise_with_any_family() {
    let registry = Registry::default();
    for (family, noise, nuisance) in
        [("rbf[count=12]", Noise::Isotropic, vec![0.004]), ("trig18 + rbf[count=4]", Noise::Full, vec![0.0; 6])]
    {
        let sample = Sample::draw(&registry, "rigid3", 80, 0.4, 5).unwrap();
        let problem = sample.problem(&registry, family, &Execution::default()).unwrap().unwrap();
        let mut theta = sample.theta.clone();
        let plain = problem.evaluate(&theta);
        let problem = problem.with_noise(noise);
        theta.extend(vec![0.0; nuisance.len()]);
        let without = problem.evaluate(&theta);
        for (a, b) in plain.residual.iter().zip(&without.residual) {
            assert!((a - b).abs() < 1e-12, "no noise changes nothing: {a} {b}");
        }
        let start = sample.theta.len();
        theta[start..].copy_from_slice(&nuisance);
        let report = derivatives(&problem, &theta);
        assert!(report.finite_difference < 1e-6 && report.oracle < 1e-12 && report.lanes < 1e-12, "{report:?}");
    }
}

#[test]
fn gram_reports_reproduce_the_erratum() {
    // The printed functions under the paper's weight: values orthonormal, gradients correlated up to .76.
    let nodes = gaussian(1);
    let (x, w): (Vec<f64>, Vec<f64>) = nodes.iter().map(|(x, w)| (x[0], *w)).unzip();
    let points = Points::weighted(vec![x], w).unwrap();
    let report = gram(family("trig18").as_ref(), &points);
    assert!(report.values.condition < 1.002, "{report}");
    let (worst, _, _) = report.gradients.worst_correlation.unwrap();
    assert!((worst - 0.76).abs() < 0.005, "{report}");
    assert_eq!(report.to_string().lines().count(), 3);
    // Dependent functions have infinite condition.
    let report = gram(family("trig18 + trig18").as_ref(), &points);
    assert_eq!((report.values.rank, report.values.condition), (6, f64::INFINITY));
}
