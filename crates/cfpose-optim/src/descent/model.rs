//! The quadratic model of the cost at a point.

use crate::problem::half_squared_norm;

/// The quadratic model of the cost at the current point, in tangent coordinates.
#[derive(Debug, Clone, Default)]
pub struct Model {
    /// Number of residuals L.
    pub rows: usize,
    /// Dimension of the tangent space m.
    pub cols: usize,
    /// Cost 1/2 r'r.
    pub cost: f64,
    /// Residual r, length L.
    pub residual: Vec<f64>,
    /// Jacobian J, L x m, row by row.
    pub jacobian: Vec<f64>,
    /// Gradient J'r, length m.
    pub gradient: Vec<f64>,
    /// Norms of the columns of J, length m.
    pub column_norms: Vec<f64>,
    /// Largest norms that the columns have had since the start, length m.
    pub largest_norms: Vec<f64>,
    /// Diagonal of the scaling D, length m.
    pub scaling: Vec<f64>,
    /// Curvature term `sum_i r_i Hess(r_i)`, m x m, empty unless the step rule asks for it.
    pub curvature: Vec<f64>,
}

impl Model {
    /// Make room for a problem of L residuals and m tangent coordinates.
    pub fn new(rows: usize, cols: usize) -> Self {
        Self {
            rows,
            cols,
            cost: f64::INFINITY,
            residual: vec![0.0; rows],
            jacobian: vec![0.0; rows * cols],
            gradient: vec![0.0; cols],
            column_norms: vec![0.0; cols],
            largest_norms: vec![0.0; cols],
            scaling: vec![1.0; cols],
            curvature: Vec::new(),
        }
    }

    /// Compute cost, gradient, column norms and the scaling from residual and Jacobian: D is the running maximum of the
    /// column norms, 1 for a column that was always 0 (as in MINPACK).
    pub fn update(&mut self) {
        self.update_gradient();
        for j in 0..self.cols {
            self.largest_norms[j] = self.largest_norms[j].max(self.column_norms[j]);
            self.scaling[j] = if self.largest_norms[j] > 0.0 { self.largest_norms[j] } else { 1.0 };
        }
    }

    /// Raise the scaling to a thousandth of the root of the diagonal of the exact Hessian, where that is larger: a column that
    /// vanishes at the minimum says nothing about the size of a step.
    pub fn scale_by_curvature(&mut self) {
        for j in 0..self.cols.min(self.curvature.len()) {
            let diagonal = self.column_norms[j].powi(2) + self.curvature[j * self.cols + j];
            self.largest_norms[j] = self.largest_norms[j].max(1e-3 * diagonal.abs().sqrt());
            self.scaling[j] = if self.largest_norms[j] > 0.0 { self.largest_norms[j] } else { 1.0 };
        }
    }

    /// Compute cost, gradient and column norms; leave the scaling.
    pub fn update_gradient(&mut self) {
        self.cost = half_squared_norm(&self.residual);
        self.gradient.fill(0.0);
        self.column_norms.fill(0.0);
        for (row, r) in self.jacobian.chunks_exact(self.cols.max(1)).zip(&self.residual) {
            for j in 0..self.cols {
                self.gradient[j] += row[j] * r;
                self.column_norms[j] += row[j] * row[j];
            }
        }
        self.column_norms.iter_mut().for_each(|c| *c = c.sqrt());
    }

    /// Return `max_j |(J'r)_j| / (norm(J_j) norm(r))` over the columns that `free` admits: the cosine of the gradient test.
    pub fn cosine(&self, free: impl Fn(usize) -> bool) -> f64 {
        let length = (2.0 * self.cost).sqrt();
        let cosine = |j: usize| {
            let denominator = self.column_norms[j] * length;
            if denominator > 0.0 { self.gradient[j].abs() / denominator } else { 0.0 }
        };
        (0..self.cols).filter(|j| free(*j)).map(cosine).fold(0.0, f64::max)
    }

    /// Return `max_j |(J'r)_j| / (D_j norm(r))` over the columns that `free` admits: as [`Model::cosine`], but small also where
    /// a column vanishes at the minimum.
    pub fn scaled_cosine(&self, free: impl Fn(usize) -> bool) -> f64 {
        let length = (2.0 * self.cost).sqrt();
        let cosine = |j: usize| if length > 0.0 { self.gradient[j].abs() / (self.scaling[j] * length) } else { 0.0 };
        (0..self.cols).filter(|j| free(*j)).map(cosine).fold(0.0, f64::max)
    }

    /// Return norm(D v).
    pub fn scaled_norm(&self, v: &[f64]) -> f64 {
        self.scaling.iter().zip(v).map(|(d, a)| (d * a) * (d * a)).sum::<f64>().sqrt()
    }

    /// Return the decrease of the cost that the model predicts: `-g'd - 1/2 norm(J d)^2 - 1/2 d'C d`.
    pub fn predicted(&self, step: &[f64]) -> f64 {
        let dot = |row: &[f64]| row.iter().zip(step).map(|(a, d)| a * d).sum::<f64>();
        let image: f64 = self.jacobian.chunks_exact(self.cols.max(1)).map(|row| dot(row).powi(2)).sum();
        -dot(&self.gradient) - 0.5 * (image + self.curvature_along(step))
    }

    /// Return d'C d, 0 without a curvature term.
    pub fn curvature_along(&self, step: &[f64]) -> f64 {
        let rows = self.curvature.chunks_exact(self.cols.max(1)).zip(step);
        rows.map(|(row, d)| d * row.iter().zip(step).map(|(c, e)| c * e).sum::<f64>()).sum()
    }
}
