//! Small dense algebra on slices for the inner steps: problems of this crate have some 1 to 20 columns, where a call into a
//! blocked library costs more than the arithmetic. Rank decisions go through faer's SVD.

/// The triangular factor of a QR decomposition and the rotated right-hand side: all that a least-squares step needs.
///
/// ```
/// use cfpose_optim::linear::Qr;
/// let mut qr = Qr::default();
/// qr.factorise(3, 2, &[1.0, 0.0, 1.0, 1.0, 1.0, 2.0], &[1.0, 2.0, 3.0]);
/// let mut x = [0.0; 2];
/// assert!(qr.solve_damped(0.0, &[1.0, 1.0], &mut x));
/// assert!((x[0] - 1.0).abs() < 1e-14 && (x[1] - 1.0).abs() < 1e-14); // the line 1 + t
/// ```
#[derive(Debug, Clone, Default)]
pub struct Qr {
    cols: usize,
    /// Working copy of the matrix, column by column, then of the reflectors.
    work: Vec<f64>,
    rhs: Vec<f64>,
    /// Upper triangle R, row by row, cols x cols; rows beyond the matrix are 0.
    upper: Vec<f64>,
    /// First entries of Q'b.
    rotated: Vec<f64>,
    /// Working copies for the damped solve.
    damped: Vec<f64>,
    tail: Vec<f64>,
}

impl Qr {
    /// Factorise `matrix` (rows x cols, row by row) with right-hand side `rhs` (rows) by Householder reflections.
    ///
    /// Source: Golub and Van Loan, Matrix Computations, algorithm 5.2.1.
    pub fn factorise(&mut self, rows: usize, cols: usize, matrix: &[f64], rhs: &[f64]) {
        self.cols = cols;
        self.work.resize(rows * cols, 0.0);
        for k in 0..rows {
            for j in 0..cols {
                self.work[j * rows + k] = matrix[k * cols + j];
            }
        }
        self.rhs.clear();
        self.rhs.extend_from_slice(&rhs[..rows]);
        self.upper.clear();
        self.upper.resize(cols * cols, 0.0);
        for j in 0..cols.min(rows) {
            let (head, tail) = self.work.split_at_mut((j + 1) * rows);
            let column = &mut head[j * rows + j..];
            let (diagonal, factor) = reflector(column);
            self.upper[j * cols + j] = diagonal;
            if factor == 0.0 {
                continue;
            }
            for other in tail.chunks_exact_mut(rows) {
                reflect(column, factor, &mut other[j..]);
            }
            reflect(column, factor, &mut self.rhs[j..]);
        }
        self.rotated.clear();
        self.rotated.resize(cols, 0.0);
        for i in 0..cols.min(rows) {
            for j in i + 1..cols {
                self.upper[i * cols + j] = self.work[j * rows + i];
            }
            self.rotated[i] = self.rhs[i];
        }
    }

    /// Return R, cols x cols, row by row.
    pub fn upper(&self) -> &[f64] {
        &self.upper
    }

    /// Return the first cols entries of Q'b.
    pub fn rotated(&self) -> &[f64] {
        &self.rotated
    }

    /// Return the squared norm of R v, which is that of the factorised matrix times v.
    pub fn image_squared(&self, v: &[f64]) -> f64 {
        let m = self.cols;
        (0..m).map(|i| (i..m).map(|j| self.upper[i * m + j] * v[j]).sum::<f64>().powi(2)).sum()
    }

    /// Write R'R v, the product of the normal matrix and v.
    pub fn normal_product(&self, v: &[f64], out: &mut [f64]) {
        let m = self.cols;
        out[..m].fill(0.0);
        for i in 0..m {
            let row = &self.upper[i * m + i..(i + 1) * m];
            let value: f64 = row.iter().zip(&v[i..m]).map(|(r, a)| r * a).sum();
            for (o, r) in out[i..m].iter_mut().zip(row) {
                *o += r * value;
            }
        }
    }

    /// Say whether no diagonal entry of R is small against its column's scale: then a solve by R is safe.
    pub fn rank_is_clear(&self, scaling: &[f64]) -> bool {
        (0..self.cols).all(|j| self.upper[j * self.cols + j].abs() > RANK_TOLERANCE * scaling[j])
    }

    /// Return half the squared norm of the part of the right-hand side that the columns can explain: the decrease of the cost
    /// that an unrestricted step would bring. Columns without a clear rank do not count.
    pub fn attainable(&self, scaling: &[f64]) -> f64 {
        let clear = |j: &usize| self.upper[j * self.cols + j].abs() > RANK_TOLERANCE * scaling[*j];
        0.5 * (0..self.cols).filter(clear).map(|j| self.rotated[j] * self.rotated[j]).sum::<f64>()
    }

    /// Replace v by the solution of R_d' x = v with the triangle R_d of the last damped solve; return norm(x)^2.
    pub fn solve_transposed_damped(&self, v: &mut [f64]) -> f64 {
        let m = self.cols;
        for i in 0..m {
            let sum: f64 = (0..i).map(|k| self.damped[k * m + i] * v[k]).sum();
            v[i] = (v[i] - sum) / self.damped[i * m + i];
        }
        v[..m].iter().map(|x| x * x).sum()
    }

    /// Write the minimiser of `norm(A x - b)^2 + damping * norm(D x)^2` with D = diag(`scaling`); false when it is not unique
    /// or not finite.
    ///
    /// Eliminates the rows `sqrt(damping) D` below R by reflections (as MINPACK's `qrsolv` does by rotations), so that the
    /// condition of A is not squared.
    pub fn solve_damped(&mut self, damping: f64, scaling: &[f64], x: &mut [f64]) -> bool {
        let m = self.cols;
        self.damped.clone_from(&self.upper);
        self.tail.clear();
        self.tail.resize(m * m + m, 0.0);
        x[..m].copy_from_slice(&self.rotated);
        let (lower, lower_rhs) = self.tail.split_at_mut(m * m);
        if damping > 0.0 {
            let root = damping.sqrt();
            for j in 0..m {
                lower[j * m + j] = root * scaling[j];
            }
            for j in 0..m {
                eliminate(m, j, &mut self.damped, lower, x, lower_rhs);
            }
        }
        for i in (0..m).rev() {
            let sum: f64 = (i + 1..m).map(|j| self.damped[i * m + j] * x[j]).sum();
            x[i] = (x[i] - sum) / self.damped[i * m + i];
        }
        x[..m].iter().all(|v| v.is_finite())
    }
}

/// Columns whose part independent of the others is smaller than this, relative to their norm, count as dependent.
pub const RANK_TOLERANCE: f64 = 1e-13;

/// A thin singular value decomposition A = U S V' with its numerical rank.
#[derive(Debug, Clone)]
pub struct Svd {
    /// U, rows x k, row by row, with k = min(rows, cols).
    pub left: Vec<f64>,
    /// Singular values, largest first, length k.
    pub values: Vec<f64>,
    /// V, cols x k, row by row.
    pub right: Vec<f64>,
    /// Number of singular values above `max(rows, cols) * epsilon * largest`.
    pub rank: usize,
}

/// Decompose a matrix (rows x cols, row by row); nothing when it is empty, not finite or the iteration fails.
pub fn svd(rows: usize, cols: usize, matrix: &[f64]) -> Option<Svd> {
    if rows == 0 || cols == 0 || matrix.iter().any(|v| !v.is_finite()) {
        return None;
    }
    let a = faer::Mat::<f64>::from_fn(rows, cols, |i, j| matrix[i * cols + j]);
    let decomposition = a.thin_svd().ok()?;
    let k = rows.min(cols);
    let (u, s, v) = (decomposition.U(), decomposition.S().column_vector(), decomposition.V());
    let gather = |m: faer::MatRef<'_, f64>, n: usize| (0..n * k).map(|at| m[(at / k, at % k)]).collect::<Vec<f64>>();
    let values: Vec<f64> = (0..k).map(|i| s[i]).collect();
    let limit = rows.max(cols) as f64 * f64::EPSILON * values[0];
    let rank = values.iter().filter(|value| **value > limit && **value > 0.0).count();
    Some(Svd { left: gather(u, rows), right: gather(v, cols), values, rank })
}

/// Write the x of least norm(D x) among the minimisers of norm(A x - b), zero when A cannot be decomposed.
pub fn minimum_norm(rows: usize, cols: usize, matrix: &[f64], rhs: &[f64], scaling: &[f64], x: &mut [f64]) {
    x[..cols].fill(0.0);
    let scaled: Vec<f64> = (0..rows * cols).map(|at| matrix[at] / scaling[at % cols]).collect();
    let Some(svd) = svd(rows, cols, &scaled) else { return };
    let k = svd.values.len();
    for i in 0..svd.rank {
        let along: f64 = (0..rows).map(|row| svd.left[row * k + i] * rhs[row]).sum::<f64>() / svd.values[i];
        for j in 0..cols {
            x[j] += svd.right[j * k + i] * along / scaling[j];
        }
    }
}

/// Return eigenvalues (smallest first) and eigenvectors (n x n, row by row, in columns) of a symmetric matrix (n x n);
/// nothing when it is not finite or the iteration fails.
pub fn symmetric_eigen(n: usize, matrix: &[f64]) -> Option<(Vec<f64>, Vec<f64>)> {
    if n == 0 || matrix.iter().any(|v| !v.is_finite()) {
        return None;
    }
    let a = faer::Mat::<f64>::from_fn(n, n, |i, j| 0.5 * (matrix[i * n + j] + matrix[j * n + i]));
    let decomposition = a.self_adjoint_eigen(faer::Side::Lower).ok()?;
    let (s, u) = (decomposition.S().column_vector(), decomposition.U());
    Some(((0..n).map(|i| s[i]).collect(), (0..n * n).map(|at| u[(at / n, at % n)]).collect()))
}

/// An equality-constrained least-squares problem reduced to the null space of its constraints.
///
/// ```
/// use cfpose_optim::linear::null_space_step;
/// // Nearest point to (1, 0) on the line d1 + d2 = 2.
/// let mut step = [0.0; 2];
/// assert!(null_space_step(2, 2, &[1.0, 0.0, 0.0, 1.0], &[-1.0, 0.0], 1, &[1.0, 1.0], &[-2.0], &mut step));
/// assert!((step[0] - 1.5).abs() < 1e-14 && (step[1] - 0.5).abs() < 1e-14);
/// ```
#[derive(Debug, Clone, Default)]
pub struct NullSpace {
    cols: usize,
    rank: usize,
    /// Householder vectors of A', one row of length cols each, with their factors.
    vectors: Vec<f64>,
    factors: Vec<f64>,
    /// Coordinates of the particular solution in the range of A'.
    range: Vec<f64>,
    /// J Z, rows x (cols - rank), row by row, and r + J Y y.
    jacobian: Vec<f64>,
    residual: Vec<f64>,
    row: Vec<f64>,
}

impl NullSpace {
    /// Reduce `min norm(r + J d)` subject to `c + A d = 0`, J rows x cols, A num x cols, both row by row. Constraints that
    /// depend on earlier ones are dropped.
    #[allow(clippy::too_many_arguments)]
    pub fn reduce(
        &mut self,
        rows: usize,
        cols: usize,
        jacobian: &[f64],
        residual: &[f64],
        num: usize,
        constraints: &[f64],
        values: &[f64],
    ) {
        self.cols = cols;
        self.rank = 0;
        self.vectors.clear();
        self.factors.clear();
        self.range.clear();
        for i in 0..num {
            self.add_constraint(&constraints[i * cols..(i + 1) * cols], values[i]);
        }
        let (rank, free) = (self.rank, cols - self.rank);
        self.jacobian.resize(rows * free, 0.0);
        self.residual.resize(rows, 0.0);
        for k in 0..rows {
            self.row.clear();
            self.row.extend_from_slice(&jacobian[k * cols..(k + 1) * cols]);
            for i in 0..rank {
                let v = &self.vectors[i * cols + i..(i + 1) * cols];
                reflect(v, self.factors[i], &mut self.row[i..]);
            }
            let moved: f64 = self.row[..rank].iter().zip(&self.range).map(|(a, y)| a * y).sum();
            self.residual[k] = residual[k] + moved;
            self.jacobian[k * free..(k + 1) * free].copy_from_slice(&self.row[rank..]);
        }
    }

    /// Rotate one more row of A, make it triangular, and solve for its coordinate: `row . (Q y) = -value`.
    fn add_constraint(&mut self, constraint: &[f64], value: f64) {
        let (cols, rank) = (self.cols, self.rank);
        if rank == cols {
            return;
        }
        self.row.clear();
        self.row.extend_from_slice(constraint);
        let size = crate::manifold::norm(constraint);
        for i in 0..rank {
            let v = &self.vectors[i * cols + i..(i + 1) * cols];
            reflect(v, self.factors[i], &mut self.row[i..]);
        }
        if crate::manifold::norm(&self.row[rank..]) <= 1e-10 * size {
            return;
        }
        let known: f64 = self.row[..rank].iter().zip(&self.range).map(|(a, y)| a * y).sum();
        let (diagonal, factor) = reflector(&mut self.row[rank..]);
        self.row[..rank].fill(0.0);
        self.vectors.extend_from_slice(&self.row);
        self.factors.push(factor);
        self.range.push((-value - known) / diagonal);
        self.rank += 1;
    }

    /// Return the number of independent constraints.
    pub fn rank(&self) -> usize {
        self.rank
    }

    /// Return J Z, rows x (cols - rank), row by row.
    pub fn jacobian(&self) -> &[f64] {
        &self.jacobian
    }

    /// Return the residual after the particular step.
    pub fn residual(&self) -> &[f64] {
        &self.residual
    }

    /// Return the squared norm of the particular step, the shortest one that satisfies the constraints.
    pub fn particular_squared(&self) -> f64 {
        self.range.iter().map(|y| y * y).sum()
    }

    /// Write the step `Q (y, z)` of null-space coordinates z.
    pub fn expand(&self, z: &[f64], step: &mut [f64]) {
        let (cols, rank) = (self.cols, self.rank);
        step[..rank].copy_from_slice(&self.range);
        step[rank..cols].copy_from_slice(&z[..cols - rank]);
        for i in (0..rank).rev() {
            reflect(&self.vectors[i * cols + i..(i + 1) * cols], self.factors[i], &mut step[i..cols]);
        }
    }
}

/// Write `d = argmin norm(r + J d)` subject to `c + A d = 0` (J rows x cols, A num x cols, row by row) by the null-space
/// method; false when it is not unique or not finite.
///
/// Source: Bjorck, Numerical Methods for Least Squares Problems (1996), section 5.1.
#[allow(clippy::too_many_arguments)]
pub fn null_space_step(
    rows: usize,
    cols: usize,
    jacobian: &[f64],
    residual: &[f64],
    num: usize,
    constraints: &[f64],
    values: &[f64],
    step: &mut [f64],
) -> bool {
    let mut space = NullSpace::default();
    space.reduce(rows, cols, jacobian, residual, num, constraints, values);
    let free = cols - space.rank();
    let (mut qr, mut z) = (Qr::default(), vec![0.0; free]);
    qr.factorise(rows, free, &space.jacobian, &space.residual);
    let unique = qr.solve_damped(0.0, &z.clone(), &mut z);
    z.iter_mut().for_each(|v| *v = -*v);
    space.expand(&z, step);
    unique
}

/// Eliminate column `j` of `lower` (filled in rows 0..=j) against row `j` of `upper`, right-hand sides along.
fn eliminate(m: usize, j: usize, upper: &mut [f64], lower: &mut [f64], rhs: &mut [f64], lower_rhs: &mut [f64]) {
    let below: f64 = (0..=j).map(|i| lower[i * m + j].powi(2)).sum();
    if below == 0.0 {
        return;
    }
    let head = upper[j * m + j];
    let length = (head * head + below).sqrt();
    let diagonal = -length.copysign(head);
    let pivot = head - diagonal;
    let factor = 1.0 / (length * pivot.abs());
    for c in j + 1..m {
        let dot = pivot * upper[j * m + c] + (0..=j).map(|i| lower[i * m + j] * lower[i * m + c]).sum::<f64>();
        upper[j * m + c] -= factor * dot * pivot;
        for i in 0..=j {
            lower[i * m + c] -= factor * dot * lower[i * m + j];
        }
    }
    let dot = pivot * rhs[j] + (0..=j).map(|i| lower[i * m + j] * lower_rhs[i]).sum::<f64>();
    rhs[j] -= factor * dot * pivot;
    for i in 0..=j {
        lower_rhs[i] -= factor * dot * lower[i * m + j];
    }
    upper[j * m + j] = diagonal;
}

/// Turn a column into its Householder vector; return the diagonal entry of R and the factor 2 / v'v (0 for no reflection).
fn reflector(column: &mut [f64]) -> (f64, f64) {
    let length = crate::manifold::norm(column);
    if length == 0.0 {
        return (0.0, 0.0);
    }
    let diagonal = -length.copysign(column[0]);
    column[0] -= diagonal;
    (diagonal, 1.0 / (length * column[0].abs()))
}

/// Apply I - factor v v' to a vector.
fn reflect(v: &[f64], factor: f64, target: &mut [f64]) {
    let dot: f64 = v.iter().zip(target.iter()).map(|(a, b)| a * b).sum();
    for (t, a) in target.iter_mut().zip(v) {
        *t -= factor * dot * a;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The normal equations of the damped problem hold at the solution, also for a wide or rank-deficient matrix.
    #[test]
    fn damped_solution_has_zero_gradient() {
        for (rows, cols, matrix) in [
            (4, 3, vec![1.0, 2.0, -1.0, 0.5, 0.0, 3.0, -2.0, 1.0, 1.0, 4.0, -1.0, 0.2]),
            (2, 3, vec![1.0, 2.0, 3.0, -1.0, 0.5, 2.0]),
            (3, 2, vec![1.0, 2.0, 2.0, 4.0, -1.0, -2.0]),
        ] {
            let rhs: Vec<f64> = (0..rows).map(|k| 1.0 + k as f64).collect();
            let scaling = [1.0, 2.0, 0.5];
            let (mut qr, mut x) = (Qr::default(), vec![0.0; cols]);
            qr.factorise(rows, cols, &matrix, &rhs);
            assert!(qr.solve_damped(0.3, &scaling[..cols], &mut x));
            for j in 0..cols {
                let mut gradient = 0.3 * scaling[j].powi(2) * x[j];
                for k in 0..rows {
                    let row = &matrix[k * cols..(k + 1) * cols];
                    let fit: f64 = row.iter().zip(&x).map(|(a, b)| a * b).sum();
                    gradient += row[j] * (fit - rhs[k]);
                }
                assert!(gradient.abs() < 1e-13, "{gradient}");
            }
        }
    }
}
