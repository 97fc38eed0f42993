//! The equalities of a model, as constraints that solvers see.

use cfpose_optim::constraint::Constraints;
use cfpose_optim::manifold::Manifold;

use super::MomentProblem;
use super::evaluate::append_rows;

impl Constraints for MomentProblem {
    fn num_equalities(&self) -> usize {
        self.model.equality.as_ref().map_or(0, |rows| rows.num_rows())
    }

    fn num_inequalities(&self) -> usize {
        0
    }

    fn values(&self, theta: &[f64], values: &mut [f64]) {
        if let Some(rows) = &self.model.equality {
            rows.values(self.split(theta).0, values);
        }
    }

    fn jacobian(&self, theta: &[f64], values: &mut [f64], jacobian: &mut [f64]) {
        let Some(rows) = &self.model.equality else { return };
        let tangent = self.manifold.tangent();
        let mut basis = vec![0.0; self.manifold.ambient() * tangent];
        self.manifold.basis(theta, &mut basis);
        let own = self.split(theta).0;
        let (mut all, mut slopes) = (Vec::new(), Vec::new());
        append_rows(rows.as_ref(), own, &basis[..own.len() * tangent], tangent, &mut all, &mut slopes);
        values.copy_from_slice(&all);
        jacobian.copy_from_slice(&slopes);
    }
}
