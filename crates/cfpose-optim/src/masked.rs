//! Fixed and free parameters: a manifold, and a problem, of which only chosen tangent coordinates may move.

use std::sync::Arc;

use num_dual::HyperDual64;

use crate::constraint::{Bounds, Constraints};
use crate::manifold::Manifold;
use crate::problem::{Capabilities, LeastSquares};

/// A manifold whose steps move the chosen tangent coordinates only; ambient coordinates are those of the whole.
///
/// Of a rotation with one free axis this is the group of turns about that axis; with two free axes the points reached
/// depend on the path, as for any restriction of that kind.
///
/// ```
/// use std::sync::Arc;
/// use cfpose_optim::manifold::{Euclidean, Manifold};
/// use cfpose_optim::masked::Masked;
/// let plane = Masked::new(Arc::new(Euclidean(3)), &[true, false, true]);
/// let mut out = [0.0; 3];
/// plane.retract(&[1.0, 2.0, 3.0], &[0.5, -0.5], &mut out);
/// assert_eq!(out, [1.5, 2.0, 2.5]);
/// ```
#[derive(Debug, Clone)]
pub struct Masked {
    inner: Arc<dyn Manifold>,
    free: Vec<usize>,
}

impl Masked {
    /// Free the tangent coordinates whose mask is true; coordinates beyond the mask are fixed.
    pub fn new(inner: Arc<dyn Manifold>, mask: &[bool]) -> Self {
        let free = (0..inner.tangent()).filter(|j| mask.get(*j).copied().unwrap_or(false)).collect();
        Self { inner, free }
    }

    /// Return the indices of the free tangent coordinates.
    pub fn free(&self) -> &[usize] {
        &self.free
    }

    fn spread<T: Copy>(&self, step: &[T], zero: T) -> Vec<T> {
        let mut whole = vec![zero; self.inner.tangent()];
        for (value, j) in step.iter().zip(&self.free) {
            whole[*j] = *value;
        }
        whole
    }

    /// Copy the free columns (and of a square matrix the free rows) of a matrix with the tangent size of the whole.
    fn select(&self, rows: impl Iterator<Item = usize>, matrix: &[f64], out: &mut [f64]) {
        let (m, f) = (self.inner.tangent(), self.free.len());
        for (i, row) in rows.enumerate() {
            for (c, j) in self.free.iter().enumerate() {
                out[i * f + c] = matrix[row * m + j];
            }
        }
    }
}

impl Manifold for Masked {
    fn ambient(&self) -> usize {
        self.inner.ambient()
    }
    fn tangent(&self) -> usize {
        self.free.len()
    }
    fn retract(&self, theta: &[f64], step: &[f64], out: &mut [f64]) {
        self.inner.retract(theta, &self.spread(step, 0.0), out);
    }
    fn local(&self, from: &[f64], to: &[f64], step: &mut [f64]) {
        let mut whole = vec![0.0; self.inner.tangent()];
        self.inner.local(from, to, &mut whole);
        for (value, j) in step.iter_mut().zip(&self.free) {
            *value = whole[*j];
        }
    }
    fn lift2(&self, theta: &[f64], step: &[HyperDual64], out: &mut [HyperDual64]) {
        self.inner.lift2(theta, &self.spread(step, HyperDual64::from(0.0)), out);
    }
    fn basis(&self, theta: &[f64], out: &mut [f64]) {
        let mut whole = vec![0.0; self.inner.ambient() * self.inner.tangent()];
        self.inner.basis(theta, &mut whole);
        self.select(0..self.inner.ambient(), &whole, out);
    }
    fn differential(&self, theta: &[f64], step: &[f64], out: &mut [f64]) {
        let m = self.inner.tangent();
        let mut whole = vec![0.0; m * m];
        self.inner.differential(theta, &self.spread(step, 0.0), &mut whole);
        self.select(self.free.iter().copied(), &whole, out);
    }
    fn extent(&self, theta: &[f64], out: &mut [f64]) {
        let mut whole = vec![0.0; self.inner.tangent()];
        self.inner.extent(theta, &mut whole);
        for (value, j) in out.iter_mut().zip(&self.free) {
            *value = whole[*j];
        }
    }
    fn project(&self, theta: &mut [f64]) {
        self.inner.project(theta);
    }
}

/// A problem with some tangent coordinates held fixed: any problem, any solver.
///
/// ```
/// use std::sync::Arc;
/// use cfpose_optim::manifold::Euclidean;
/// use cfpose_optim::masked::Restricted;
/// use cfpose_optim::testproblems::Rosenbrock;
/// use cfpose_optim::{Control, solvers};
/// let fixed_first = Restricted::new(&Rosenbrock, Arc::new(Euclidean(2)), &[false, true]);
/// let solver = solvers::build("levenberg-marquardt").unwrap();
/// let outcome = solver.solve(&fixed_first, &[-1.2, 1.0], &mut Control::default()).unwrap();
/// assert_eq!(outcome.theta[0], -1.2);
/// assert!((outcome.theta[1] - 1.44).abs() < 1e-12);
/// ```
pub struct Restricted<'p> {
    inner: &'p dyn LeastSquares,
    manifold: Masked,
}

impl<'p> Restricted<'p> {
    /// Hold the tangent coordinates whose mask is false; `manifold` is that of the inner problem.
    pub fn new(inner: &'p dyn LeastSquares, manifold: Arc<dyn Manifold>, mask: &[bool]) -> Self {
        Self { inner, manifold: Masked::new(manifold, mask) }
    }
}

impl LeastSquares for Restricted<'_> {
    fn manifold(&self) -> &dyn Manifold {
        &self.manifold
    }
    fn num_residuals(&self) -> usize {
        self.inner.num_residuals()
    }
    fn residual(&self, theta: &[f64], residual: &mut [f64]) {
        self.inner.residual(theta, residual);
    }
    fn jacobian(&self, theta: &[f64], residual: &mut [f64], jacobian: &mut [f64]) {
        let rows = self.inner.num_residuals();
        let mut whole = vec![0.0; rows * self.inner.manifold().tangent()];
        self.inner.jacobian(theta, residual, &mut whole);
        self.manifold.select(0..rows, &whole, jacobian);
    }
    fn curvature(&self, theta: &[f64], weights: &[f64], hessian: &mut [f64]) {
        let m = self.inner.manifold().tangent();
        let mut whole = vec![0.0; m * m];
        self.inner.curvature(theta, weights, &mut whole);
        self.manifold.select(self.manifold.free.iter().copied(), &whole, hessian);
    }
    fn capabilities(&self) -> Capabilities {
        self.inner.capabilities()
    }
    fn bounds(&self) -> Option<&Bounds> {
        self.inner.bounds()
    }
    fn constraints(&self) -> Option<&dyn Constraints> {
        // Their Jacobian has the columns of the whole: restrict the constraints themselves where there are any.
        self.inner.constraints().map(|_| self as &dyn Constraints)
    }
}

impl Constraints for Restricted<'_> {
    fn num_equalities(&self) -> usize {
        self.inner.constraints().map_or(0, |c| c.num_equalities())
    }
    fn num_inequalities(&self) -> usize {
        self.inner.constraints().map_or(0, |c| c.num_inequalities())
    }
    fn values(&self, theta: &[f64], values: &mut [f64]) {
        if let Some(constraints) = self.inner.constraints() {
            constraints.values(theta, values);
        }
    }
    fn jacobian(&self, theta: &[f64], values: &mut [f64], jacobian: &mut [f64]) {
        if let Some(constraints) = self.inner.constraints() {
            let rows = constraints.num_equalities() + constraints.num_inequalities();
            let mut whole = vec![0.0; rows * self.inner.manifold().tangent()];
            constraints.jacobian(theta, values, &mut whole);
            self.manifold.select(0..rows, &whole, jacobian);
        }
    }
    fn curvature(&self, theta: &[f64], weights: &[f64], hessian: &mut [f64]) {
        if let Some(constraints) = self.inner.constraints() {
            let m = self.inner.manifold().tangent();
            let mut whole = vec![0.0; m * m];
            constraints.curvature(theta, weights, &mut whole);
            self.manifold.select(self.manifold.free.iter().copied(), &whole, hessian);
        }
    }
    fn has_curvature(&self) -> bool {
        self.inner.constraints().is_some_and(|c| c.has_curvature())
    }
}
