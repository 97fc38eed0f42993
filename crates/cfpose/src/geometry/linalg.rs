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

/// Return the eigenvalues (descending) of a symmetric 3 x 3 matrix and the unit eigenvector of the least one: for many small
/// matrices, where the set-up of a general routine costs more than the work.
///
/// Trigonometric solution of the characteristic equation (Smith 1961); the vector is the largest cross product of two rows
/// of A - value I. Accurate where the least eigenvalue stands apart from the others.
pub(crate) fn least_axis3(a: &[[f64; 3]; 3]) -> ([f64; 3], [f64; 3]) {
    let mean = (a[0][0] + a[1][1] + a[2][2]) / 3.0;
    let off = a[0][1].powi(2) + a[0][2].powi(2) + a[1][2].powi(2);
    let spread = ((0..3).map(|i| (a[i][i] - mean).powi(2)).sum::<f64>() + 2.0 * off) / 6.0;
    let radius = spread.sqrt();
    if radius <= 0.0 || !radius.is_finite() {
        return ([mean; 3], [1.0, 0.0, 0.0]);
    }
    let b: [[f64; 3]; 3] =
        std::array::from_fn(|i| std::array::from_fn(|j| (a[i][j] - if i == j { mean } else { 0.0 }) / radius));
    let determinant = b[0][0] * (b[1][1] * b[2][2] - b[1][2] * b[2][1])
        - b[0][1] * (b[1][0] * b[2][2] - b[1][2] * b[2][0])
        + b[0][2] * (b[1][0] * b[2][1] - b[1][1] * b[2][0]);
    let angle = (0.5 * determinant).clamp(-1.0, 1.0).acos() / 3.0;
    let largest = mean + 2.0 * radius * angle.cos();
    let least = mean + 2.0 * radius * (angle + std::f64::consts::TAU / 3.0).cos();
    let values = [largest, 3.0 * mean - largest - least, least];
    let rows: [[f64; 3]; 3] =
        std::array::from_fn(|i| std::array::from_fn(|j| a[i][j] - if i == j { least } else { 0.0 }));
    let cross =
        |u: [f64; 3], v: [f64; 3]| [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    let mut axis = [1.0, 0.0, 0.0];
    let mut longest = 0.0;
    for (i, j) in [(0, 1), (0, 2), (1, 2)] {
        let c = cross(rows[i], rows[j]);
        let length = cfpose_optim::manifold::norm3(&c);
        if length > longest {
            longest = length;
            axis = c.map(|v| v / length);
        }
    }
    (values, axis)
}

/// Solve (H + damping diag H) x = g for a symmetric positive semi-definite H (n x n).
pub(crate) fn solve_normal(n: usize, h: &[f64], g: &[f64], damping: f64) -> Option<Vec<f64>> {
    use faer::linalg::solvers::Solve;
    let trace: f64 = (0..n).map(|i| h[i * n + i]).sum();
    let matrix = faer::Mat::from_fn(n, n, |i, j| {
        // Each unknown by its own entry: angles and lengths have other units. A direction without any information has none.
        let own = if h[i * n + i] > 0.0 { h[i * n + i] } else { trace };
        let ridge = if i == j { (damping + 1e-14) * own } else { 0.0 };
        h[i * n + j] + ridge
    });
    let factor = matrix.llt(faer::Side::Lower).ok()?;
    let solution = factor.solve(faer::Mat::from_fn(n, 1, |i, _| g[i]));
    let x: Vec<f64> = (0..n).map(|i| solution[(i, 0)]).collect();
    x.iter().all(|v| v.is_finite()).then_some(x)
}

/// Add the outer product scale v v' to h, of which the lower triangle counts.
#[inline]
pub(crate) fn add_outer(h: &mut [f64], v: &[f64], scale: f64) {
    // Numbers of unknowns that are common: loops of fixed length stay in registers.
    match v.len() {
        3 => add_outer_of::<3>(h, v, scale),
        6 => add_outer_of::<6>(h, v, scale),
        7 => add_outer_of::<7>(h, v, scale),
        n => {
            for (i, row) in h.chunks_exact_mut(n.max(1)).enumerate() {
                let factor = scale * v[i];
                row.iter_mut().zip(&v[..=i]).for_each(|(h, v)| *h += factor * v);
            }
        }
    }
}

#[inline(always)]
fn add_outer_of<const N: usize>(h: &mut [f64], v: &[f64], scale: f64) {
    let (Some(v), (rows, _)) = (v.first_chunk::<N>(), h.as_chunks_mut::<N>()) else { return };
    for (row, a) in rows.iter_mut().zip(v) {
        let factor = scale * a;
        for j in 0..N {
            row[j] += factor * v[j];
        }
    }
}

/// Copy the lower triangle to the upper.
pub(crate) fn symmetrise(n: usize, h: &mut [f64]) {
    for i in 0..n {
        for j in 0..i {
            h[j * n + i] = h[i * n + j];
        }
    }
}

/// Return A C A' for matrices of n x n.
pub(crate) fn congruent(n: usize, a: &[f64], c: &[f64]) -> Vec<f64> {
    let product: Vec<f64> = (0..n * n).map(|at| (0..n).map(|k| a[at / n * n + k] * c[k * n + at % n]).sum()).collect();
    (0..n * n).map(|at| (0..n).map(|k| product[at / n * n + k] * a[at % n * n + k]).sum()).collect()
}

/// Return the inverse of a symmetric positive definite matrix.
pub(crate) fn invert(n: usize, h: &[f64]) -> Option<Vec<f64>> {
    let mut out = vec![0.0; n * n];
    for j in 0..n {
        let unit: Vec<f64> = (0..n).map(|i| f64::from(u8::from(i == j))).collect();
        let column = solve_normal(n, h, &unit, 0.0)?;
        (0..n).for_each(|i| out[i * n + j] = column[i]);
    }
    Some(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_least_axis_agrees_with_the_general_routine() {
        let mut state = 7_u64;
        let mut draw = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
        for _ in 0..200 {
            // A flat neighbourhood: the third direction has a hundredth of the others' spread.
            let basis: [[f64; 3]; 3] = std::array::from_fn(|_| std::array::from_fn(|_| draw()));
            let scale = [1.0, 0.6, 0.01];
            let matrix: [[f64; 3]; 3] = std::array::from_fn(|i| {
                std::array::from_fn(|j| (0..3).map(|k| scale[k] * scale[k] * basis[k][i] * basis[k][j]).sum())
            });
            let (values, axes) = symmetric_eigen(&matrix, 3);
            let (fast, axis) = least_axis3(&matrix);
            for k in 0..3 {
                assert!((values[k] - fast[k]).abs() < 1e-12 * values[0].max(1.0), "{values:?} {fast:?}");
            }
            let cosine: f64 = (0..3).map(|d| axis[d] * axes[2][d]).sum();
            assert!(values[2] > 0.05 * values[1] || 1.0 - cosine.abs() < 1e-9, "{cosine} {values:?}");
        }
    }
}
