//! The printed feature functions: values, the orthonormality that holds, and the one that the text claims but does not.

use cfpose::family::DynFamily;
use cfpose::{BuildContext, Points, Registry};
use gauss_quad::GaussHermite;
use num_dual::HyperDual64;
use std::f64::consts::PI;

/// The six printed functions of one coordinate, written out from section IV.B.2.
fn printed(x: f64) -> [f64; 6] {
    let (s, c) = ((PI * x).sin(), (PI * x).cos());
    [
        -0.6578 * x - 1.058 * s + 0.123 * x * c,
        -0.2567 * x * x + 0.3437 * s * s + 1.286 * c,
        -0.7620 * x * x - 1.288 * s * s + 0.1921 * c,
        1.245 * x - 0.9539 * s - 1.540 * x * c,
        2.998 * x * x - 1.620 * s * s + 1.032 * c,
        -4.656 * x + 2.290 * s - 5.183 * x * c,
    ]
}

fn family(spec: &str) -> Box<dyn DynFamily> {
    Registry::default().family(spec, &BuildContext::default()).unwrap()
}

/// Expectation of g under p(x) = 2 / sqrt(2 pi) exp(-2 x^2): x = t / sqrt(2) with Gauss-Hermite nodes t.
fn expectation(g: impl Fn(f64) -> f64) -> f64 {
    let rule = GaussHermite::new(80.try_into().unwrap());
    rule.integrate(|t| g(t * 0.5_f64.sqrt())) / PI.sqrt()
}

/// First derivative of each feature of one coordinate, by the second-order path.
fn gradients(family: &dyn DynFamily, x: f64) -> Vec<f64> {
    let num_basis = family.num_basis(1);
    let mut basis = vec![HyperDual64::from(0.0); num_basis];
    family.hyper(&[HyperDual64::new(x, 1.0, 0.0, 0.0)], &mut basis);
    let c = family.coefficients(1).unwrap();
    c.chunks_exact(num_basis).map(|row| row.iter().zip(&basis).map(|(a, b)| a * b.eps1).sum()).collect()
}

#[test]
fn trig18_equals_the_print_with_the_coordinate_index_fastest() {
    let family = family("trig18");
    for point in [[0.3, -0.7, 0.05], [-1.2, 0.0, 2.4], [0.5, 0.25, -0.125]] {
        let features = family.features(&point);
        assert_eq!(features.len(), 18);
        for (i, value) in features.iter().enumerate() {
            let expected = printed(point[i % 3])[i / 3];
            assert!((value - expected).abs() < 1e-12, "f_{}({}) = {value}, printed {expected}", i + 1, point[i % 3]);
        }
    }
}

#[test]
fn printed_functions_are_orthonormal_within_the_digits_of_the_print() {
    // Odd set f_1, f_10, f_16 and even set f_4, f_7, f_13 of one coordinate; odd times even vanishes by symmetry.
    let gram = |i: usize, j: usize| expectation(|x| printed(x)[i] * printed(x)[j]);
    for i in 0..6 {
        assert!((gram(i, i) - 1.0).abs() < 1e-3, "E f_{i}^2 = {}", gram(i, i));
        for j in 0..i {
            assert!(gram(i, j).abs() < 3e-4, "E f_{i} f_{j} = {}", gram(i, j));
        }
    }
}

#[test]
fn erratum_gradients_of_the_printed_functions_are_not_orthogonal() {
    let family = family("trig18");
    let gram =
        |i: usize, j: usize| expectation(|x| gradients(family.as_ref(), x)[i] * gradients(family.as_ref(), x)[j]);
    let mut worst = 0.0_f64;
    for i in 0..6 {
        for j in 0..i {
            worst = worst.max((gram(i, j) / (gram(i, i) * gram(j, j)).sqrt()).abs());
        }
    }
    assert!((worst - 0.76).abs() < 0.005, "largest correlation between gradients {worst}");
}

#[test]
fn the_print_is_the_eigenbasis_of_its_gram_matrix() {
    // K = E[phi phi'] for {x, sin, x cos} and {x^2, sin^2, cos}: eigenvalues of method.md.
    let odd = |x: f64| [x, (PI * x).sin(), x * (PI * x).cos()];
    let even = |x: f64| [x * x, (PI * x).sin().powi(2), (PI * x).cos()];
    type Basis<'a> = &'a dyn Fn(f64) -> [f64; 3];
    let sets: [(Basis<'_>, [f64; 3]); 2] =
        [(&odd, [0.637_939, 0.206_918, 0.018_574]), (&even, [0.544_394, 0.439_211, 0.078_895])];
    for (basis, expected) in sets {
        let k: [[f64; 3]; 3] =
            std::array::from_fn(|i| std::array::from_fn(|j| expectation(|x| basis(x)[i] * basis(x)[j])));
        let matrix = faer::Mat::from_fn(3, 3, |i, j| k[i][j]);
        let eigen = matrix.self_adjoint_eigen(faer::Side::Lower).unwrap();
        for (n, value) in expected.iter().enumerate() {
            assert!((eigen.S()[2 - n] - value).abs() < 1e-6, "{} {value}", eigen.S()[2 - n]);
        }
    }
}

#[test]
fn hermite_functions_are_orthonormal_and_their_gradients_orthogonal() {
    let values = family("hermite[degree=6]");
    let raw = family("hermite[degree=6,scale=raw]");
    let gradient = family("hermite[degree=6,scale=gradient]");
    let factorial = |n: usize| (1..=n).map(|k| k as f64).product::<f64>();
    for i in 0..6 {
        for j in 0..6 {
            let delta = f64::from(u8::from(i == j));
            let product = expectation(|x| values.features(&[x])[i] * values.features(&[x])[j]);
            assert!((product - delta).abs() < 1e-10);
            let product = expectation(|x| gradients(raw.as_ref(), x)[i] * gradients(raw.as_ref(), x)[j]);
            let n = i + 1;
            let expected = delta * 4.0 * (n * n) as f64 * factorial(n - 1); // 4, 16, 72, 384, 2400, 17280
            assert!((product - expected).abs() < 1e-8 * expected.max(100.0), "{product} {expected}");
            let product = expectation(|x| gradients(gradient.as_ref(), x)[i] * gradients(gradient.as_ref(), x)[j]);
            assert!((product - delta).abs() < 1e-9);
        }
    }
}

#[test]
fn polynomial_features_are_ordered_by_degree_then_lexicographically() {
    let x = [2.0, 3.0];
    let family = family("monomial[degree=2]");
    assert_eq!(family.features(&x), vec![3.0, 2.0, 9.0, 6.0, 4.0]);
}

/// Expectation of the basis of a family around a point with correlated Gaussian noise, by quadrature.
fn blurred_by_quadrature(family: &dyn DynFamily, x: [f64; 2], factor: [[f64; 2]; 2]) -> Vec<f64> {
    let rule = GaussHermite::new(60.try_into().unwrap());
    let nodes: Vec<(f64, f64)> = rule.iter().map(|(node, weight)| (*node, *weight)).collect();
    let mut sum = vec![0.0; family.num_basis(2)];
    let mut basis = sum.clone();
    for (u, wu) in &nodes {
        for (v, wv) in &nodes {
            let (u, v) = (u * 2.0_f64.sqrt(), v * 2.0_f64.sqrt());
            let moved = [x[0] + factor[0][0] * u + factor[0][1] * v, x[1] + factor[1][0] * u + factor[1][1] * v];
            family.values(&moved, &mut basis);
            sum.iter_mut().zip(&basis).for_each(|(s, b)| *s += wu * wv / PI * b);
        }
    }
    sum
}

#[test]
fn closed_form_blurs_equal_quadrature() {
    let factor = [[0.2, 0.0], [0.07, 0.15]];
    let covariance = [0.04, 0.2 * 0.07, 0.07 * 0.07 + 0.15 * 0.15].map(HyperDual64::from);
    let x = [0.4, -0.3];
    let registry = Registry::default();
    let target = Points::from_rows(&[[0.1, 0.5], [0.9, -0.2], [-0.4, 0.3], [-0.7, -0.6], [0.2, 0.8]]).unwrap();
    let context = BuildContext { dim: 2, target: Some(&target), ..BuildContext::default() };
    let variants =
        ["hermite[degree=6]", "monomial[kind=separable]", "angular[harmonics=32]", "2*trig18 + fourier[k=2]"];
    // The blur of `quadrature-blur` is no closed form; tests/families.rs checks it.
    let names = registry.families.iter().map(|entry| entry.name).filter(|name| *name != "quadrature-blur");
    for spec in names.chain(variants) {
        let family = registry.family(spec, &context).unwrap();
        let mut values = vec![0.0; family.num_basis(2)];
        family.values(&x, &mut values);
        let mut means: Vec<HyperDual64> = values.iter().map(|v| HyperDual64::from(*v)).collect();
        if !family.blur_hyper(2, &covariance, &mut means) {
            continue;
        }
        for (closed, exact) in means.iter().zip(blurred_by_quadrature(family.as_ref(), x, factor)) {
            assert!((closed.re - exact).abs() < 1e-10 * exact.abs().max(1.0), "{spec}: {} {exact}", closed.re);
        }
    }
}
