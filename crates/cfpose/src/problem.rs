//! The moment problem: quotients of weighted sums on both sides, as a least-squares problem on a manifold.

use std::sync::Arc;

use cfpose_kernel::family::{DynFamily, QuadratureBlur};
use cfpose_kernel::map::{DynMap, LiftedPoints, MapBlock, Transform};
use cfpose_kernel::means::{Closure, Execution};
use cfpose_kernel::moments::{MomentPath, Moments};
use cfpose_kernel::points::{BLOCK, Points, PointsError};
use cfpose_optim::constraint::Constraints;
use cfpose_optim::manifold::{Euclidean, Manifold, Product};
use cfpose_optim::problem::{Capabilities, LeastSquares};
use num_dual::HyperDual64;

use crate::error::Error;
use crate::geometry::theta::ThetaError;
use crate::model::Model;

mod equality;
mod evaluate;
mod hyper;
mod noise;
pub mod normalise;
mod setup;
mod sparse;
mod summed;

pub use crate::model::{DynRows, ResidualRows};
pub use noise::Noise;
pub use setup::Sides;
pub(crate) use setup::{adapt, transformed};
use sparse::SparseMatrix;

/// Sources of at least this many points are replaced by their moments where model and family allow it.
const MOMENTS_FROM: usize = 256;

/// One pair of point sets that must match; groups share theta.
#[derive(Clone)]
struct Group {
    source: Arc<LiftedPoints>,
    target: Arc<LiftedPoints>,
    /// Moments of the source, where they replace the sums over its points.
    moments: Option<Arc<MomentPath>>,
    /// Means of the basis over the target, where they do not move with theta.
    fixed_target: Option<Arc<Vec<f64>>>,
    /// All that is known of a source whose points are not there.
    summed: Option<Arc<Moments>>,
}

/// r(theta) = C (F_p(theta) - F_q(theta)) for each group, weighted, followed by extra rows.
///
/// theta is the model's ambient theta followed by the nuisance parameters of [`Noise`]. A clone shares the points: it is how
/// one problem gets another weighting.
#[derive(Clone)]
pub struct MomentProblem {
    model: Arc<Model>,
    family: Arc<dyn DynFamily>,
    transform: Transform,
    groups: Vec<Group>,
    noise: Noise,
    extra: Vec<Arc<dyn DynRows>>,
    /// Square root of W: rows x all features of all groups.
    whitening: Option<Arc<[f64]>>,
    /// Expected squared norm of the whitened features, where it is not their number.
    effective_rows: Option<f64>,
    coefficients: Option<Arc<SparseMatrix>>,
    closure: Option<Arc<Closure>>,
    execution: Execution,
    manifold: Product,
}

/// Feature means and residual at one theta; features in their documented order, groups one after the other.
#[derive(Debug, Clone, PartialEq)]
pub struct Evaluation {
    /// F_p(theta), after the blur where noise is modelled.
    pub source_means: Vec<f64>,
    /// F_q(theta).
    pub target_means: Vec<f64>,
    /// Weighted residual and extra rows (length L).
    pub residual: Vec<f64>,
    /// Jacobian of the residual, L x tangent, row by row.
    pub jacobian: Vec<f64>,
    /// 1/2 r'r.
    pub cost: f64,
}

impl MomentProblem {
    /// Set up the problem for one pair of point sets.
    pub fn new(
        model: Arc<Model>,
        family: Arc<dyn DynFamily>,
        transform: Transform,
        source: &Points,
        target: &Points,
        execution: Execution,
    ) -> Self {
        Self::without_points(model, family, transform, execution).with_group(source, target)
    }

    /// Set up a problem that has no group yet.
    pub(crate) fn without_points(
        model: Arc<Model>,
        family: Arc<dyn DynFamily>,
        transform: Transform,
        execution: Execution,
    ) -> Self {
        let dim = model.dim();
        let manifold = Product::new(model.layout.manifold().factors().to_vec());
        Self {
            coefficients: sparse_coefficients(family.as_ref(), dim),
            closure: Closure::of(family.as_ref(), dim).map(Arc::new),
            extra: model.regulariser.iter().cloned().collect(),
            model,
            family,
            transform,
            groups: Vec::new(),
            noise: Noise::None,
            whitening: None,
            effective_rows: None,
            execution,
            manifold,
        }
    }

    /// Add another pair of point sets that shares theta.
    #[must_use]
    pub fn with_group(self, source: &Points, target: &Points) -> Self {
        let (source, target) = (self.model.source.lift(source), self.model.target.map().lift(target));
        self.with_lifted(Arc::new(source), Arc::new(target))
    }

    /// Add a pair of sets that the maps of the model have lifted already.
    #[must_use]
    pub(crate) fn with_lifted(mut self, source: Arc<LiftedPoints>, target: Arc<LiftedPoints>) -> Self {
        let moments = if source.len >= MOMENTS_FROM {
            let monomials = self.family.monomials(self.model.dim());
            MomentPath::new(self.model.source.as_ref(), monomials, &source, &self.execution).map(Arc::new)
        } else {
            None
        };
        let fixed_target = self.fixed_target(&target);
        self.groups.push(Group { source, target, moments, fixed_target, summed: None });
        self
    }

    /// Return the means of the basis over target points that do not move with theta.
    fn fixed_target(&self, target: &LiftedPoints) -> Option<Arc<Vec<f64>>> {
        if self.model.target.is_moving() {
            return None;
        }
        let prepared = self.model.target.map().prepare(&self.model.layout.neutral(), &[], 0);
        Some(Arc::new(self.sums(self.model.target.map(), target, prepared, &self.execution).values))
    }

    /// Sum over the points at every evaluation even where moments could replace them: for comparisons.
    #[must_use]
    pub fn with_direct_sums(mut self) -> Self {
        self.groups.iter_mut().filter(|group| group.summed.is_none()).for_each(|group| group.moments = None);
        self
    }

    /// Say whether every group is evaluated from moments, at a cost that does not depend on the number of points.
    pub fn uses_moments(&self) -> bool {
        self.groups.iter().all(|group| group.moments.is_some())
    }

    /// Model additive noise of the target as a nuisance parameter through the family's blur.
    ///
    /// A family without a closed form gets [`QuadratureBlur`] with 5 nodes and spread 0.1, which makes each evaluation 5^dim
    /// times as expensive.
    #[must_use]
    pub fn with_noise(mut self, noise: Noise) -> Self {
        let dim = self.model.dim();
        if noise != Noise::None && !has_blur(self.family.as_ref(), dim) {
            self.family = Arc::new(QuadratureBlur::new(self.family, 5, 0.1));
            self.coefficients = sparse_coefficients(self.family.as_ref(), dim);
            self.closure = Closure::of(self.family.as_ref(), dim).map(Arc::new);
            for index in 0..self.groups.len() {
                self.groups[index].moments = None;
                self.groups[index].fixed_target = self.fixed_target(&self.groups[index].target);
            }
        }
        self.noise = noise;
        let mut factors = self.model.layout.manifold().factors().to_vec();
        if noise.num_parameters(dim) > 0 {
            factors.push(Arc::new(Euclidean(noise.num_parameters(dim))));
        }
        self.manifold = Product::new(factors);
        self
    }

    /// Replace the manifold of the model's theta by one on the same ambient coordinates (fixed parameters have no column).
    #[must_use]
    pub fn with_model_manifold(mut self, manifold: Arc<dyn Manifold>) -> Self {
        let mut factors = vec![manifold];
        let nuisance = self.noise.num_parameters(self.model.dim());
        if nuisance > 0 {
            factors.push(Arc::new(Euclidean(nuisance)));
        }
        self.manifold = Product::new(factors);
        self
    }

    /// Append extra residual rows.
    #[must_use]
    pub fn with_rows(mut self, rows: Arc<dyn DynRows>) -> Self {
        self.extra.push(rows);
        self
    }

    /// Weight the feature rows by a square root of W (any rows x all features).
    #[must_use]
    pub fn with_whitening(mut self, whitening: Option<Vec<f64>>) -> Self {
        self.whitening = whitening.map(Arc::from);
        self
    }

    /// State the expected squared norm of the whitened features, where a ridge makes it less than their number.
    #[must_use]
    pub(crate) fn with_effective_rows(mut self, effective: Option<f64>) -> Self {
        self.effective_rows = effective;
        self
    }

    /// Return the expected squared norm of the residual where the model holds and nothing is fitted.
    pub(crate) fn effective_rows(&self) -> f64 {
        let rows = self.num_residuals() as f64;
        match (&self.whitening, self.effective_rows) {
            (Some(whitening), Some(effective)) => {
                rows + effective - (whitening.len() / self.num_feature_rows().max(1)) as f64
            }
            _ => rows,
        }
    }

    /// Return the square root of W that the residual was multiplied by, `None` for the identity.
    pub(crate) fn whitening(&self) -> Option<&[f64]> {
        self.whitening.as_deref()
    }

    /// Return the number of residuals before weighting, extra rows included.
    pub(crate) fn num_unweighted(&self) -> usize {
        self.num_feature_rows() + self.extra.iter().map(|rows| rows.num_rows()).sum::<usize>()
    }

    /// Return how the target's noise is modelled.
    pub fn noise(&self) -> Noise {
        self.noise
    }

    /// Return where sums are computed.
    pub(crate) fn execution(&self) -> &Execution {
        &self.execution
    }

    /// Return the instruction set of the sums.
    pub(crate) fn isa(&self) -> cfpose_kernel::isa::Isa {
        self.execution.isa
    }

    /// Check that there are at least as many residuals as unknowns, which a solve needs and an evaluation does not.
    ///
    /// # Errors
    /// [`Error::TooFewFeatures`].
    pub fn require_enough_features(&self) -> Result<(), Error> {
        let (features, unknowns) = (self.num_residuals(), self.manifold.tangent());
        if features < unknowns { Err(Error::TooFewFeatures { features, unknowns }) } else { Ok(()) }
    }

    /// Return the model.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// Return the feature family.
    pub fn family(&self) -> &dyn DynFamily {
        self.family.as_ref()
    }

    /// Return the normalising transform.
    pub fn transform(&self) -> &Transform {
        &self.transform
    }

    /// Return the number of features of one group.
    pub fn num_features(&self) -> usize {
        // The family would have to write its coefficient matrix to count its rows: solvers ask too often for that.
        match &self.coefficients {
            Some(matrix) => matrix.num_rows(),
            None => self.family.num_basis(self.model.dim()),
        }
    }

    /// Return the number of feature rows before weighting.
    fn num_feature_rows(&self) -> usize {
        self.groups.len() * self.num_features()
    }

    /// Split theta into the model's part and the nuisance part.
    fn split<'a, T>(&self, theta: &'a [T]) -> (&'a [T], &'a [T]) {
        theta.split_at(self.model.layout.manifold().ambient())
    }

    /// Evaluate as [`MomentProblem::evaluate`], after looking at theta: its length is that of the model's ambient theta and the nuisance
    /// parameters.
    ///
    /// # Errors
    /// [`Error::Theta`] for another length and numbers that are not finite.
    pub fn try_evaluate(&self, theta: &[f64]) -> Result<Evaluation, Error> {
        let expected = self.manifold.ambient();
        if theta.len() != expected {
            let layout = format!(
                "ambient: {} of model and {} of noise",
                self.model.layout.manifold().ambient(),
                self.noise.num_parameters(self.model.dim())
            );
            return Err(ThetaError::Count { expected, found: theta.len(), layout }.into());
        }
        match theta.iter().position(|value| !value.is_finite()) {
            Some(at) => Err(ThetaError::NotFinite { position: at + 1, value: theta[at] }.into()),
            None => Ok(self.evaluate(theta)),
        }
    }

    /// Map the target points of the first group into the feature space at theta, not normalised.
    ///
    /// # Errors
    /// [`PointsError`] when a mapped point is not finite.
    pub fn mapped_target(&self, theta: &[f64]) -> Result<Points, PointsError> {
        map_points(self.model.target.map(), &self.groups[0].target, self.split(theta).0, &self.execution)
    }

    /// Map the source points of the first group into the feature space at theta, not normalised.
    ///
    /// # Errors
    /// As [`MomentProblem::mapped_target`].
    pub fn mapped_source(&self, theta: &[f64]) -> Result<Points, PointsError> {
        map_points(self.model.source.as_ref(), &self.groups[0].source, self.split(theta).0, &self.execution)
    }
}

/// Return C as the sparse matrix that it usually is.
fn sparse_coefficients(family: &dyn DynFamily, dim: usize) -> Option<Arc<SparseMatrix>> {
    family.coefficients(dim).map(|c| Arc::new(SparseMatrix::new(&c, family.num_basis(dim))))
}

/// Say whether a family can blur its means.
fn has_blur(family: &dyn DynFamily, dim: usize) -> bool {
    let zero = HyperDual64::from(0.0);
    family.blur_hyper(dim, &vec![zero; dim * (dim + 1) / 2], &mut vec![zero; family.num_basis(dim)])
}

/// Map points into the feature space, not normalised, weights with the density.
///
/// # Errors
/// [`PointsError`] when a mapped point is not finite.
pub fn map_points(
    map: &dyn DynMap,
    lifted: &LiftedPoints,
    theta: &[f64],
    execution: &Execution,
) -> Result<Points, PointsError> {
    let dim = map.dim();
    let prepared = map.prepare(theta, &[], 0);
    let mut block = MapBlock::new(dim, 0);
    let mut columns = vec![Vec::with_capacity(lifted.len); dim];
    let mut weights = Vec::with_capacity(lifted.len);
    for start in (0..lifted.weights.len()).step_by(BLOCK) {
        map.block(execution.isa, &prepared, &Transform::identity(), lifted, start, &mut block);
        let count = BLOCK.min(lifted.len.saturating_sub(start));
        for (column, row) in columns.iter_mut().zip(&block.x) {
            column.extend(&row.0[..count]);
        }
        weights.extend(&block.weight.0[..count]);
    }
    if weights.iter().all(|w| *w == 1.0) { Points::from_columns(columns) } else { Points::weighted(columns, weights) }
}

impl LeastSquares for MomentProblem {
    fn manifold(&self) -> &dyn Manifold {
        &self.manifold
    }

    fn num_residuals(&self) -> usize {
        let features = match &self.whitening {
            Some(matrix) => matrix.len() / self.num_feature_rows(),
            None => self.num_feature_rows(),
        };
        features + self.extra.iter().map(|rows| rows.num_rows()).sum::<usize>()
    }

    fn residual(&self, theta: &[f64], residual: &mut [f64]) {
        residual.copy_from_slice(&self.rows(theta, false, &self.execution, None).0);
    }

    fn jacobian(&self, theta: &[f64], residual: &mut [f64], jacobian: &mut [f64]) {
        let (rows, derivatives) = self.rows(theta, true, &self.execution, None);
        residual.copy_from_slice(&rows);
        jacobian.copy_from_slice(&derivatives);
    }

    fn curvature(&self, theta: &[f64], weights: &[f64], hessian: &mut [f64]) {
        let m = self.manifold.tangent();
        for u in 0..m {
            for v in 0..=u {
                let rows = self.hyper_residual(theta, u, v);
                let sum = rows.iter().zip(weights).map(|(r, w)| r.eps1eps2 * w).sum();
                hessian[u * m + v] = sum;
                hessian[v * m + u] = sum;
            }
        }
    }

    fn capabilities(&self) -> Capabilities {
        Capabilities { jacobian: true, curvature: true }
    }

    fn constraints(&self) -> Option<&dyn Constraints> {
        self.model.equality.as_ref().map(|_| self as &dyn Constraints)
    }
}

/// Return the real part of each dual.
pub(crate) fn real_parts(values: &[HyperDual64]) -> Vec<f64> {
    values.iter().map(|dual| dual.re).collect()
}
