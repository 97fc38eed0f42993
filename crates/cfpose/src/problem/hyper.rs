//! The slow, exact path: the whole residual over second-order duals, point by point.
//!
//! It serves exact Hessians and, as one long derivative through everything, the oracle that the fast path is tested against.

use cfpose_kernel::family::DynFamily;
use cfpose_kernel::map::{DynMap, LiftedPoints};
use cfpose_optim::manifold::Manifold;
use num_dual::HyperDual64;

use super::MomentProblem;

impl MomentProblem {
    /// Return the residual with first derivatives along tangent directions u and v and the second derivative d2/du dv.
    pub fn hyper_residual(&self, theta: &[f64], u: usize, v: usize) -> Vec<HyperDual64> {
        let zero = HyperDual64::from(0.0);
        let mut step = vec![zero; self.manifold.tangent()];
        step[u].eps1 = 1.0;
        step[v].eps2 = 1.0;
        let mut lifted = vec![zero; self.manifold.ambient()];
        self.manifold.lift2(theta, &step, &mut lifted);
        let (model_theta, nuisance) = self.split(&lifted);
        let mut rows = Vec::with_capacity(self.num_feature_rows());
        for group in &self.groups {
            let mut source = match &group.summed {
                Some(moments) => self.hyper_of_moments(moments, model_theta),
                None => self.hyper_means(self.model.source.as_ref(), &group.source, model_theta),
            };
            self.noise.blur_hyper(self.family.as_ref(), self.model.dim(), &self.transform, nuisance, &mut source);
            let target = match &group.fixed_target {
                Some(values) => values.iter().map(|value| HyperDual64::from(*value)).collect(),
                None => self.hyper_means(self.model.target.map(), &group.target, model_theta),
            };
            let difference: Vec<HyperDual64> = source.iter().zip(&target).map(|(a, b)| *a - *b).collect();
            match &self.coefficients {
                None => rows.extend(difference),
                Some(c) => rows.extend(
                    c.rows().map(|row| row.iter().fold(zero, |sum, (k, factor)| sum + difference[*k] * *factor)),
                ),
            }
        }
        if let Some(whitening) = &self.whitening {
            rows = apply(whitening, &rows);
        }
        for extra in &self.extra {
            let start = rows.len();
            rows.resize(start + extra.num_rows(), zero);
            extra.hyper(model_theta, &mut rows[start..]);
        }
        rows
    }

    /// Return the means of the basis over one side.
    fn hyper_means(&self, map: &dyn DynMap, points: &LiftedPoints, theta: &[HyperDual64]) -> Vec<HyperDual64> {
        let zero = HyperDual64::from(0.0);
        let (dim, family): (usize, &dyn DynFamily) = (map.dim(), self.family.as_ref());
        let mut x = vec![zero; dim];
        let mut normalised = vec![zero; dim];
        let mut basis = vec![zero; family.num_basis(dim)];
        let mut sums = vec![zero; basis.len()];
        let mut total = zero;
        let (mean, matrix) = (self.transform.mean(), self.transform.matrix());
        for k in 0..points.len {
            let weight = map.hyper(theta, &points.point(k), &mut x) * points.weights[k];
            for q in 0..dim {
                normalised[q] = zero;
                for c in 0..dim {
                    normalised[q] += (x[c] - mean[c]) * matrix[q][c];
                }
            }
            family.hyper(&normalised, &mut basis);
            for (sum, value) in sums.iter_mut().zip(&basis) {
                *sum += *value * weight;
            }
            total += weight;
        }
        sums.iter().map(|sum| *sum / total).collect()
    }
}

/// Return a matrix (row by row) times a vector of duals.
fn apply(matrix: &[f64], vector: &[HyperDual64]) -> Vec<HyperDual64> {
    matrix
        .chunks_exact(vector.len())
        .map(|row| row.iter().zip(vector).fold(HyperDual64::from(0.0), |sum, (a, b)| sum + *b * *a))
        .collect()
}
