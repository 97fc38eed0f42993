//! The covariance of feature means from moments of twice their degree: exact, no point is drawn.

use cfpose_kernel::moments::{Moments, mapped_means, monomials};
use faer::Mat;

use crate::problem::MomentProblem;
use crate::statistics::gram::coefficient_matrix;

/// Return kappa Cov(f) over the mapped source at ambient theta (features x features, row by row); `source` holds moments to twice the
/// degree of the features.
///
/// With f = C phi and monomials phi, mean(phi_i phi_j) is the mean of the monomial of exponent e_i + e_j.
pub(super) fn sampling_covariance(problem: &MomentProblem, source: &Moments, theta: &[f64], kappa: f64) -> Vec<f64> {
    let (model, transform) = (problem.model(), problem.transform());
    let (dim, len) = (model.dim(), source.dim());
    let prepared = model.source.prepare(theta, &[], 0);
    // x = T (A p + b - mean).
    let (mean, matrix) = (transform.mean(), transform.matrix());
    let (mut a, mut b) = (vec![0.0; dim * len], vec![0.0; dim]);
    for q in 0..dim {
        for c in 0..dim {
            b[q] += matrix[q][c] * (prepared.b[c] - mean[c]);
            (0..len).for_each(|k| a[q * len + k] += matrix[q][c] * prepared.a[c * len + k]);
        }
    }
    let means = mapped_means(source, &a, &b);
    let all = monomials(dim, source.degree());
    let at = |e: [usize; 3]| all.iter().position(|other| *other == e).map_or(0.0, |i| means[i]);
    let basis = problem.family().monomials(dim).unwrap_or_default();
    let first: Vec<f64> = basis.iter().map(|e| at(*e)).collect();
    let second = Mat::from_fn(basis.len(), basis.len(), |i, j| {
        at(std::array::from_fn(|q| basis[i][q] + basis[j][q])) - first[i] * first[j]
    });
    let covariance = match coefficient_matrix(problem.family(), dim) {
        Some(c) => &c * second * c.transpose(),
        None => second,
    };
    let n = covariance.nrows();
    (0..n * n).map(|index| kappa * covariance[(index / n, index % n)]).collect()
}
