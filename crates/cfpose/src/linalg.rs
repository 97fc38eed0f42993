//! Small dense algebra on 3x3 symmetric matrices.

use faer::{Mat, Side};

/// Return eigenvalues (descending) and unit eigenvectors of the leading `dim` x `dim` part of a symmetric matrix.
///
/// Signs: the component of largest magnitude of each vector is positive. Missing entries are 0.
pub(crate) fn symmetric_eigen(matrix: &[[f64; 3]; 3], dim: usize) -> ([f64; 3], [[f64; 3]; 3]) {
    let (mut values, mut vectors) = ([0.0; 3], [[0.0; 3]; 3]);
    let m = Mat::from_fn(dim, dim, |i, j| matrix[i][j]);
    if let Ok(eigen) = m.self_adjoint_eigen(Side::Lower) {
        for k in 0..dim {
            let column = dim - 1 - k;
            values[k] = eigen.S()[column];
            let mut largest = 0.0_f64;
            for i in 0..dim {
                vectors[k][i] = eigen.U()[(i, column)];
                if vectors[k][i].abs() > largest.abs() {
                    largest = vectors[k][i];
                }
            }
            for entry in &mut vectors[k] {
                *entry *= 1.0_f64.copysign(largest);
            }
        }
    }
    (values, vectors)
}

/// Return eigenvalues (descending) and unit eigenvectors of a symmetric n x n matrix; nothing where the iteration fails.
pub(crate) fn symmetric_eigen_any(n: usize, entry: impl Fn(usize, usize) -> f64) -> (Vec<f64>, Vec<Vec<f64>>) {
    let m = Mat::from_fn(n, n, |i, k| 0.5 * (entry(i, k) + entry(k, i)));
    let Ok(eigen) = m.self_adjoint_eigen(Side::Lower) else { return (Vec::new(), Vec::new()) };
    let order = (0..n).rev();
    order.map(|column| (eigen.S()[column], (0..n).map(|i| eigen.U()[(i, column)]).collect())).unzip()
}

/// Return eigenvalues (descending) and unit eigenvectors of a symmetric 3 x 3 matrix: for many small ones, where the set-up
/// of a general routine costs more than the work.
pub(crate) fn symmetric_eigen3(matrix: &[[f64; 3]; 3]) -> ([f64; 3], [[f64; 3]; 3]) {
    let eigen = nalgebra::Matrix3::from_fn(|i, j| matrix[i][j]).symmetric_eigen();
    let mut order = [0, 1, 2];
    order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
    let column = |k: usize| std::array::from_fn(|i| eigen.eigenvectors[(i, k)]);
    (order.map(|k| eigen.eigenvalues[k]), order.map(column))
}
