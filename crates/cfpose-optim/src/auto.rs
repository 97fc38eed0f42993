//! Problems without a hand-written derivative: write the residual once over dual numbers, get first and second derivatives
//! along the tangent of any manifold.

use std::sync::Arc;

use nalgebra::SVector;
use num_dual::{Derivative, DualNum, DualSVec64, HyperDual64};

use crate::constraint::{Bounds, Constraints};
use crate::manifold::Manifold;
use crate::problem::{Capabilities, LeastSquares};

/// Number of tangent directions that one pass of dual numbers carries: any tangent size, no heap duals.
const CHUNK: usize = 8;

type Chunk = DualSVec64<CHUNK>;

/// A vector function of the ambient coordinates, written once for every number type.
///
/// Branches must compare real parts only; values that cannot be computed are NaN.
pub trait AutoFunction: Send + Sync {
    /// Return the number of values.
    fn num_values(&self) -> usize;

    /// Write the values at `theta` (length ambient).
    fn values<T: DualNum<Primitive = f64> + Copy>(&self, theta: &[T], values: &mut [T]);
}

/// A least-squares problem whose derivatives come from automatic differentiation.
///
/// First derivatives: static dual numbers in chunks of 8 tangent directions; second derivatives: second-order dual
/// numbers through the manifold's second-order lift.
///
/// ```
/// use std::sync::Arc;
/// use cfpose_optim::auto::{AutoFunction, AutoProblem};
/// use cfpose_optim::manifold::Euclidean;
/// use cfpose_optim::{Control, solvers};
/// use num_dual::DualNum;
///
/// struct Decay;
/// impl AutoFunction for Decay {
///     fn num_values(&self) -> usize { 3 }
///     fn values<T: DualNum<Primitive = f64> + Copy>(&self, theta: &[T], values: &mut [T]) {
///         for (k, y) in [2.0, 1.0, 0.5].into_iter().enumerate() {
///             values[k] = theta[0] * (-theta[1] * k as f64).exp() - y;
///         }
///     }
/// }
/// let problem = AutoProblem::new(Decay, Arc::new(Euclidean(2)));
/// let solver = solvers::build("levenberg-marquardt").unwrap();
/// let outcome = solver.solve(&problem, &[1.0, 1.0], &mut Control::default()).unwrap();
/// assert!((outcome.theta[1] - 2.0_f64.ln()).abs() < 1e-12);
/// ```
pub struct AutoProblem<F> {
    function: F,
    manifold: Arc<dyn Manifold>,
    bounds: Option<Bounds>,
    constraints: Option<Box<dyn Constraints + Send>>,
}

impl<F: AutoFunction> AutoProblem<F> {
    /// Join a residual function and its manifold.
    pub fn new(function: F, manifold: Arc<dyn Manifold>) -> Self {
        Self { function, manifold, bounds: None, constraints: None }
    }

    /// Add bounds on ambient coordinates.
    pub fn with_bounds(mut self, lower: &[f64], upper: &[f64]) -> Self {
        self.bounds = Some(Bounds { lower: lower.to_vec(), upper: upper.to_vec() });
        self
    }

    /// Add general constraints: the first `num_equalities` values of the function are to be 0, the others at least 0.
    pub fn with_constraints<C: AutoFunction + 'static>(mut self, function: C, num_equalities: usize) -> Self {
        let manifold = Arc::clone(&self.manifold);
        self.constraints = Some(Box::new(AutoConstraints { function, num_equalities, manifold }));
        self
    }

    /// Return the residual function.
    pub fn function(&self) -> &F {
        &self.function
    }
}

impl<F: AutoFunction> LeastSquares for AutoProblem<F> {
    fn manifold(&self) -> &dyn Manifold {
        self.manifold.as_ref()
    }
    fn num_residuals(&self) -> usize {
        self.function.num_values()
    }
    fn residual(&self, theta: &[f64], residual: &mut [f64]) {
        self.function.values(theta, residual);
    }
    fn jacobian(&self, theta: &[f64], residual: &mut [f64], jacobian: &mut [f64]) {
        first_derivatives(&self.function, self.manifold.as_ref(), theta, residual, jacobian);
    }
    fn curvature(&self, theta: &[f64], weights: &[f64], hessian: &mut [f64]) {
        second_derivatives(&self.function, self.manifold.as_ref(), theta, weights, hessian);
    }
    fn capabilities(&self) -> Capabilities {
        Capabilities { jacobian: true, curvature: true }
    }
    fn bounds(&self) -> Option<&Bounds> {
        self.bounds.as_ref()
    }
    fn constraints(&self) -> Option<&dyn Constraints> {
        self.constraints.as_ref().map(|c| c.as_ref() as &dyn Constraints)
    }
}

/// Constraints whose Jacobian comes from automatic differentiation: `num_equalities` values that are to be 0, then values
/// that are to be at least 0.
pub struct AutoConstraints<C> {
    /// All values, equalities first.
    pub function: C,
    /// Number of equalities.
    pub num_equalities: usize,
    /// Manifold of the problem.
    pub manifold: Arc<dyn Manifold>,
}

impl<C: AutoFunction> Constraints for AutoConstraints<C> {
    fn num_equalities(&self) -> usize {
        self.num_equalities
    }
    fn num_inequalities(&self) -> usize {
        self.function.num_values().saturating_sub(self.num_equalities)
    }
    fn values(&self, theta: &[f64], values: &mut [f64]) {
        self.function.values(theta, values);
    }
    fn jacobian(&self, theta: &[f64], values: &mut [f64], jacobian: &mut [f64]) {
        first_derivatives(&self.function, self.manifold.as_ref(), theta, values, jacobian);
    }
    fn curvature(&self, theta: &[f64], weights: &[f64], hessian: &mut [f64]) {
        second_derivatives(&self.function, self.manifold.as_ref(), theta, weights, hessian);
    }
    fn has_curvature(&self) -> bool {
        true
    }
}

/// Write values and Jacobian (values x tangent, row by row) of a function along the tangent at `theta`.
pub fn first_derivatives<F: AutoFunction>(
    function: &F,
    manifold: &dyn Manifold,
    theta: &[f64],
    values: &mut [f64],
    jacobian: &mut [f64],
) {
    let (n, m, rows) = (manifold.ambient(), manifold.tangent(), function.num_values());
    if m == 0 {
        return function.values(theta, values);
    }
    let mut basis = vec![0.0; n * m];
    manifold.basis(theta, &mut basis);
    let mut seeded = vec![Chunk::from(0.0); n];
    let mut result = vec![Chunk::from(0.0); rows];
    for begin in (0..m).step_by(CHUNK) {
        let width = CHUNK.min(m - begin);
        for i in 0..n {
            let mut eps = SVector::<f64, CHUNK>::zeros();
            for j in 0..width {
                eps[j] = basis[i * m + begin + j];
            }
            seeded[i] = Chunk::new(theta[i], Derivative::some(eps));
        }
        function.values(&seeded, &mut result);
        for (k, value) in result.iter().enumerate() {
            values[k] = value.re;
            for j in 0..width {
                jacobian[k * m + begin + j] = value.eps.0.map_or(0.0, |eps| eps[j]);
            }
        }
    }
}

/// Write `sum_i weights_i * Hess(f_i)` (tangent x tangent) along the retraction at `theta`.
pub fn second_derivatives<F: AutoFunction>(
    function: &F,
    manifold: &dyn Manifold,
    theta: &[f64],
    weights: &[f64],
    hessian: &mut [f64],
) {
    let m = manifold.tangent();
    let zero = HyperDual64::from(0.0);
    let (mut step, mut lifted) = (vec![zero; m], vec![zero; manifold.ambient()]);
    let mut result = vec![zero; function.num_values()];
    for j in 0..m {
        for l in j..m {
            step.fill(zero);
            step[j].eps1 = 1.0;
            step[l].eps2 = 1.0;
            manifold.lift2(theta, &step, &mut lifted);
            function.values(&lifted, &mut result);
            let sum: f64 = result.iter().zip(weights).map(|(value, w)| w * value.eps1eps2).sum();
            hessian[j * m + l] = sum;
            hessian[l * m + j] = sum;
        }
    }
}
