//! Whitening of trained functions by the target: a matrix that is trained, and weights that follow the data.

use cfpose_kernel::family::DynFamily;
use cfpose_kernel::points::Points;
use faer::{Mat, Side};

use crate::statistics::gram::{coefficient_matrix, feature_gram};

/// Return the covariance of a family's features over weighted points, row by row.
///
/// ```
/// use cfpose::families::learned::feature_covariance;
/// use cfpose::{BuildContext, Points, Registry};
/// let family = Registry::default().family("monomial[degree=1]", &BuildContext { dim: 1, ..BuildContext::default() }).unwrap();
/// let points = Points::from_rows(&[[1.0], [3.0]]).unwrap();
/// let covariance = feature_covariance(family.as_ref(), &points);
/// assert!(covariance.len() == 1 && (covariance[0] - 1.0).abs() < 1e-12);
/// ```
pub fn feature_covariance(family: &dyn DynFamily, points: &Points) -> Vec<f64> {
    let gram = feature_gram(family, points).values;
    let mean = means(family, points);
    let n = gram.nrows();
    (0..n * n).map(|at| gram[(at / n, at % n)] - mean[at / n] * mean[at % n]).collect()
}

/// Return the means of the features.
fn means(family: &dyn DynFamily, points: &Points) -> Vec<f64> {
    let num = family.num_basis(points.dim());
    let (mut sums, mut basis) = (vec![0.0; num], vec![0.0; num]);
    let total: f64 = points.weights().iter().sum();
    for (k, weight) in points.weights().iter().enumerate() {
        family.values(&points.point(k)[..points.dim()], &mut basis);
        sums.iter_mut().zip(&basis).for_each(|(sum, value)| *sum += weight / total * value);
    }
    match coefficient_matrix(family, points.dim()) {
        None => sums,
        Some(c) => (0..c.nrows()).map(|i| (0..num).map(|j| c[(i, j)] * sums[j]).sum()).collect(),
    }
}

/// Return (K + ridge tr(K) / n I)^(-1/2) for the covariance K of n features, row by row: the symmetric root; `None` where K vanishes
/// or is not finite.
///
/// With ridge 0 means are weighted by the inverse of their sampling covariance, as well as two samples of one shape can be compared,
/// but the basin shrinks; a large ridge leaves the functions as they were trained.
pub fn whitening_root(covariance: &[f64], n: usize, ridge: f64) -> Option<Vec<f64>> {
    let trace: f64 = (0..n).map(|i| covariance[i * n + i]).sum();
    if !(trace > 0.0 && trace.is_finite()) {
        return None;
    }
    let speck = ridge * trace / n as f64;
    let matrix = Mat::from_fn(n, n, |i, j| 0.5 * (covariance[i * n + j] + covariance[j * n + i]));
    let eigen = matrix.self_adjoint_eigen(Side::Lower).ok()?;
    // Rounding leaves eigenvalues of dependent features a little below 0.
    let roots: Vec<f64> =
        (0..n).map(|k| (eigen.S()[k].max(0.0) + speck).max(f64::MIN_POSITIVE).sqrt().recip()).collect();
    let entry = |i: usize, j: usize| (0..n).map(|k| eigen.U()[(i, k)] * roots[k] * eigen.U()[(j, k)]).sum();
    Some((0..n * n).map(|at| entry(at / n, at % n)).collect())
}
