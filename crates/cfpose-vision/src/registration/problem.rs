//! Distances of mapped places from edges along fixed normals, as a least-squares problem.

use std::sync::Arc;

use cfpose_optim::{LeastSquares, Manifold};

use super::mapper::Mapper;

/// r_i = w_i f n_i . (h(p_i, theta) - e_i): the distance of the mapped place from its edge along the normal, pixels, times the square
/// root of its weight. Edges and normals are fixed: one round of an iteratively reweighted fit.
pub(super) struct EdgeProblem<'a> {
    pub mapper: &'a Mapper,
    pub manifold: Arc<dyn Manifold>,
    /// Edges on the plane z = 1 of the frame.
    pub edges: Vec<[f64; 2]>,
    /// Normals there, norm 1.
    pub normals: Vec<[f64; 2]>,
    /// Square roots of the weights times the focal length; 0 where there is no edge.
    pub factors: Vec<f64>,
    /// Whether a shift of all edges alike is an unknown too.
    pub shift: bool,
}

/// Weight of the square of the common shift beside that of one edge: where theta explains it as well, theta does.
const HELD: f64 = 1.0;

impl EdgeProblem<'_> {
    /// Eliminate the common shift s from columns of rows: with c the factors, the least of |r - c s|^2 + HELD s^2 over s is |r - b c (c . r)|^2,
    /// b = (1 - sqrt(1 - c . c / (c . c + HELD))) / (c . c). The same for each column of the Jacobian.
    fn without_shift(&self, rows: &mut [f64], width: usize) {
        // In units of an edge: factors hold the focal length.
        let most = self.factors.iter().fold(0.0_f64, |a, b| a.max(*b));
        if !self.shift || most == 0.0 {
            return;
        }
        let square = self.factors.iter().map(|c| (c / most).powi(2)).sum::<f64>();
        let b = (1.0 - (1.0 - square / (square + HELD)).sqrt()) / square;
        for j in 0..width {
            let along = self.factors.iter().enumerate().filter(|(_, c)| **c > 0.0);
            let sum: f64 = along.clone().map(|(i, c)| c / most * rows[i * width + j]).sum();
            along.for_each(|(i, c)| rows[i * width + j] -= b * sum * c / most);
        }
    }

    fn write(&self, mapped: &super::mapper::Mapped, residual: &mut [f64]) {
        for (i, r) in residual.iter_mut().enumerate() {
            let (x, e, n) = (mapped.x[i], self.edges[i], self.normals[i]);
            *r = match (self.factors[i] > 0.0, mapped.ahead[i]) {
                (false, _) => 0.0,
                (true, false) => f64::NAN,
                (true, true) => self.factors[i] * (n[0] * (x[0] - e[0]) + n[1] * (x[1] - e[1])),
            };
        }
    }
}

impl LeastSquares for EdgeProblem<'_> {
    fn manifold(&self) -> &dyn Manifold {
        self.manifold.as_ref()
    }

    fn num_residuals(&self) -> usize {
        self.edges.len()
    }

    fn residual(&self, theta: &[f64], residual: &mut [f64]) {
        self.write(&self.mapper.at(theta, None), residual);
        self.without_shift(residual, 1);
    }

    fn jacobian(&self, theta: &[f64], residual: &mut [f64], jacobian: &mut [f64]) {
        let mapped = self.mapper.at(theta, Some(self.manifold.as_ref()));
        self.write(&mapped, residual);
        let m = self.manifold.tangent();
        for (i, row) in jacobian.chunks_exact_mut(m).enumerate() {
            let dx = &mapped.dx[i * 2 * m..(i + 1) * 2 * m];
            let n = self.normals[i].map(|v| v * self.factors[i]);
            row.iter_mut().enumerate().for_each(|(j, d)| *d = n[0] * dx[j] + n[1] * dx[m + j]);
        }
        self.without_shift(residual, 1);
        self.without_shift(jacobian, m);
    }
}
