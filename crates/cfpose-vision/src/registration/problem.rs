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
}

impl EdgeProblem<'_> {
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
    }
}
