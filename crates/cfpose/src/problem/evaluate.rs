//! The fast path: means of both sides, their difference, coefficients, weighting.

use cfpose_kernel::isa::Isa;
use cfpose_kernel::map::{DynMap, LiftedPoints, PreparedMap, seed_theta};
use cfpose_kernel::means::{Execution, Means, Side};
use cfpose_optim::manifold::Manifold;
use num_dual::DualSVec64;

use super::{DynRows, Evaluation, Group, MomentProblem};

/// Feature means of both sides, collected on request.
#[derive(Default)]
pub(super) struct FeatureMeans {
    source: Vec<f64>,
    target: Vec<f64>,
}

impl MomentProblem {
    /// Evaluate means, residual and Jacobian at theta.
    ///
    /// # Panics
    /// When theta has another length; [`MomentProblem::try_evaluate`] looks.
    pub fn evaluate(&self, theta: &[f64]) -> Evaluation {
        self.evaluate_with(theta, &self.execution)
    }

    /// Evaluate as [`MomentProblem::evaluate`] on another instruction set.
    pub fn evaluate_on(&self, theta: &[f64], isa: Isa) -> Evaluation {
        self.evaluate_with(theta, &Execution { isa, ..self.execution.clone() })
    }

    fn evaluate_with(&self, theta: &[f64], execution: &Execution) -> Evaluation {
        let mut means = FeatureMeans::default();
        let (residual, jacobian) = self.rows(theta, true, execution, Some(&mut means));
        let cost = cfpose_optim::problem::half_squared_norm(&residual);
        Evaluation { source_means: means.source, target_means: means.target, residual, jacobian, cost }
    }

    /// Sum one side over its points and divide.
    pub(super) fn sums(
        &self,
        map: &dyn DynMap,
        points: &LiftedPoints,
        prepared: PreparedMap,
        execution: &Execution,
    ) -> Means {
        let (family, closure) = (self.family.as_ref(), self.closure.as_deref());
        Side { map, prepared, transform: &self.transform, points, family, closure }.sums(execution).means()
    }

    /// Return the means of the source side, from moments where there are any.
    fn source_means(&self, group: &Group, prepared: PreparedMap, execution: &Execution) -> Means {
        match &group.moments {
            Some(path) => path.means(&prepared, &self.transform, execution.isa),
            None => self.sums(self.model.source.as_ref(), &group.source, prepared, execution),
        }
    }

    /// Return the residual and, where wanted, the Jacobian (empty otherwise).
    pub(super) fn rows(
        &self,
        theta: &[f64],
        derivatives: bool,
        execution: &Execution,
        means: Option<&mut FeatureMeans>,
    ) -> (Vec<f64>, Vec<f64>) {
        self.rows_with(theta, derivatives, execution, means, self.whitening.as_deref())
    }

    /// Return residual and Jacobian under a weighting.
    fn rows_with(
        &self,
        theta: &[f64],
        derivatives: bool,
        execution: &Execution,
        mut means: Option<&mut FeatureMeans>,
        whitening: Option<&[f64]>,
    ) -> (Vec<f64>, Vec<f64>) {
        let tangent = if derivatives { self.manifold.tangent() } else { 0 };
        let mut basis = vec![0.0; self.manifold.ambient() * tangent];
        if derivatives {
            self.manifold.basis(theta, &mut basis);
        }
        let (model_theta, nuisance) = self.split(theta);
        let model_basis = &basis[..model_theta.len() * tangent];
        let num_rows = self.num_feature_rows();
        let (mut residual, mut jacobian) = (Vec::with_capacity(num_rows), Vec::with_capacity(num_rows * tangent));
        for group in &self.groups {
            let prepared = self.model.source.prepare(model_theta, model_basis, tangent);
            let mut source = self.source_means(group, prepared, execution);
            self.noise.blur(self.family.as_ref(), self.model.dim(), &self.transform, nuisance, &mut source);
            let moving = group.fixed_target.is_none().then(|| {
                let map = self.model.target.map();
                let prepared = map.prepare(model_theta, model_basis, tangent);
                self.sums(map, &group.target, prepared, execution)
            });
            if let Some(target) = &moving {
                source.jacobian.iter_mut().zip(&target.jacobian).for_each(|(a, b)| *a -= b);
            }
            let target = moving.as_ref().map(|means| &means.values).or(group.fixed_target.as_deref());
            let target = target.map_or(&[][..], Vec::as_slice);
            if let Some(means) = means.as_deref_mut() {
                self.to_features(execution.isa, &source.values, 1, &mut means.source);
                self.to_features(execution.isa, target, 1, &mut means.target);
            }
            // C is applied to the difference of the basis means: once, not once a side.
            source.values.iter_mut().zip(target).for_each(|(a, b)| *a -= b);
            self.to_features(execution.isa, &source.values, 1, &mut residual);
            self.to_features(execution.isa, &source.jacobian, tangent, &mut jacobian);
        }
        if let Some(whitening) = whitening {
            let num_rows = residual.len();
            jacobian = multiply(whitening, &jacobian, num_rows, tangent);
            residual = multiply(whitening, &residual, num_rows, 1);
        }
        self.extra_rows(model_theta, model_basis, tangent, &mut residual, &mut jacobian);
        (residual, jacobian)
    }

    /// Return the residual without weighting and, where wanted, its Jacobian.
    pub(crate) fn unweighted(&self, theta: &[f64], derivatives: bool) -> (Vec<f64>, Vec<f64>) {
        self.rows_with(theta, derivatives, &self.execution, None, None)
    }

    /// Append the extra rows.
    fn extra_rows(
        &self,
        theta: &[f64],
        basis: &[f64],
        tangent: usize,
        residual: &mut Vec<f64>,
        jacobian: &mut Vec<f64>,
    ) {
        for rows in &self.extra {
            append_rows(rows.as_ref(), theta, basis, tangent, residual, jacobian);
        }
    }

    /// Append C times basis rows of `width` columns.
    pub(crate) fn to_features(&self, isa: Isa, rows: &[f64], width: usize, out: &mut Vec<f64>) {
        match &self.coefficients {
            None => out.extend_from_slice(rows),
            Some(c) => c.apply(isa, rows, width, out),
        }
    }
}

/// Append values of rows that depend on theta alone and their derivatives along `tangent` directions.
pub(super) fn append_rows(
    rows: &dyn DynRows,
    theta: &[f64],
    basis: &[f64],
    tangent: usize,
    values: &mut Vec<f64>,
    jacobian: &mut Vec<f64>,
) {
    let first_value = values.len();
    values.resize(first_value + rows.num_rows(), 0.0);
    rows.values(theta, &mut values[first_value..]);
    let start = jacobian.len();
    jacobian.resize(start + rows.num_rows() * tangent, 0.0);
    for first in (0..tangent).step_by(8) {
        let mut duals = vec![DualSVec64::from(0.0); rows.num_rows()];
        rows.duals(&seed_theta(theta, basis, tangent, first), &mut duals);
        for (i, dual) in duals.iter().enumerate() {
            for c in 0..8.min(tangent - first) {
                jacobian[start + i * tangent + first + c] = dual.eps.0.as_ref().map_or(0.0, |eps| eps[c]);
            }
        }
    }
}

/// Return a (rows x inner) times b (inner x width), both row by row.
fn multiply(a: &[f64], b: &[f64], inner: usize, width: usize) -> Vec<f64> {
    let mut out = vec![0.0; a.len() / inner * width];
    for (row, target) in a.chunks_exact(inner).zip(out.chunks_exact_mut(width.max(1))) {
        for (k, factor) in row.iter().enumerate() {
            for j in 0..width {
                target[j] += factor * b[k * width + j];
            }
        }
    }
    out
}
