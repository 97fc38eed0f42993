//! A stage made ready: its problem on its points, its solver, its weighting. How it is solved: `solve.rs`.

use std::sync::{Arc, OnceLock};

use cfpose_optim::Solver;
use cfpose_optim::manifold::Manifold;
use cfpose_optim::problem::LeastSquares;

use super::Parts;
use super::pipeline::{NoiseModel, Stage};
use super::workbench::of_side;
use crate::distances::neighbours::Neighbours;
use crate::distances::sampling::Sampling;
use crate::distances::support::Support;
use crate::error::{Error, Side};
use crate::model::Model;
use crate::problem::{MomentProblem, Sides, map_points};
use crate::statistics::weighting::Weighting;
use crate::statistics::{self, Randomness};
use cfpose_kernel::family::DynFamily;
use cfpose_kernel::map::LiftedPoints;
use cfpose_kernel::points::Points;

/// A stage, ready to be solved from many starts; every choice of its `stage` is filled in.
pub(super) struct ReadyStage {
    pub stage: Stage,
    pub sides: Sides,
    /// The problem, not weighted.
    pub problem: MomentProblem,
    pub solver: Box<dyn Solver>,
    pub weighting: Box<dyn Weighting>,
    pub family: Arc<dyn DynFamily>,
    /// All source points: distances are to the whole shape, not to what a quadrature keeps of it.
    pub all_source: Arc<Points>,
    pub all_lifted: OnceLock<Arc<LiftedPoints>>,
    /// The target's search structure, built when it is first asked.
    pub target_tree: OnceLock<Neighbours>,
    pub num_source: f64,
    pub num_target: f64,
    pub counts: [usize; 2],
}

impl ReadyStage {
    /// Return the model.
    pub fn model(&self) -> &Model {
        &self.sides.model
    }

    /// Return the problem of the stage on other points.
    pub fn problem_on(&self, parts: &Parts, source: &Points, target: &Points) -> MomentProblem {
        self.sides.problem_on(&self.family, self.stage.noise.into(), parts.manifold.as_ref(), source, target)
    }

    /// Return all source points, lifted.
    fn lifted(&self) -> &Arc<LiftedPoints> {
        self.all_lifted.get_or_init(|| match Arc::ptr_eq(&self.all_source, &self.sides.source) {
            true => self.sides.lifted_source(),
            false => Arc::new(self.model().source.lift(&self.all_source)),
        })
    }

    /// Map all source points into the feature space at theta, not normalised.
    pub fn mapped_source(&self, theta: &[f64]) -> Result<Points, Error> {
        map_points(self.model().source.as_ref(), self.lifted(), &theta[..self.own()], self.problem.execution())
            .map_err(of_side(Side::Source))
    }

    /// Return the ambient length of the model's own theta.
    pub fn own(&self) -> usize {
        self.model().layout.manifold().ambient()
    }

    /// Return the number of points of the smaller set.
    pub fn fewest_points(&self) -> usize {
        self.counts[0].min(self.counts[1])
    }

    /// Return the number of the model's own free tangent coordinates.
    pub fn own_tangent(&self) -> usize {
        self.problem.manifold().tangent() - self.num_nuisance()
    }

    fn num_nuisance(&self) -> usize {
        self.problem.noise().num_parameters(self.model().dim())
    }

    /// Return kappa of a sampling for the effective numbers of points.
    pub fn kappa(&self, sampling: Sampling) -> f64 {
        sampling.kappa(self.num_target, self.num_source)
    }

    /// Choose the sampling by distances between the points.
    pub fn detect(&self, support: &Support, parts: &Parts) -> Sampling {
        Sampling::detect(support, self.model().dim(), self.counts, &parts.criteria)
    }

    /// Return the size of a normalised unit in the feature space.
    pub fn unit(&self) -> f64 {
        let matrix = self.sides.transform.matrix();
        let trace: f64 = (0..self.model().dim()).map(|d| matrix[d][d].abs()).sum();
        self.model().dim() as f64 / trace
    }

    /// Take theta from another stage: its nuisance parameters serve where the numbers agree.
    pub fn adopt(&self, theta: &[f64], parts: &Parts) -> Vec<f64> {
        let mut own = theta[..self.own()].to_vec();
        let (needed, dim) = (self.num_nuisance(), self.model().dim());
        let first = (parts.criteria.first_noise * self.unit()).powi(2);
        let carried = &theta[self.own()..];
        if carried.len() == needed {
            own.extend_from_slice(carried);
        } else if needed == 1 {
            own.push(first);
        } else if needed > 1 {
            let variance = carried.first().copied().unwrap_or(first);
            for a in 0..dim {
                own.extend((a..dim).map(|b| if a == b { variance } else { 0.0 }));
            }
        }
        own
    }

    /// Return the noise covariance at theta (nuisance parameters included), at least the floor; `None` where not modelled.
    pub fn noise(&self, theta: &[f64], parts: &Parts) -> Option<[[f64; 3]; 3]> {
        let dim = self.model().dim();
        let floor = (parts.criteria.least_noise * self.unit()).powi(2);
        let mut covariance = self.problem.noise().covariance(dim, &theta[self.own()..])?;
        (0..dim).for_each(|d| covariance[d][d] = covariance[d][d].max(floor));
        Some(covariance)
    }

    /// Return the standard deviation of the noise in one coordinate, 0 where its variance is negative.
    pub fn noise_sigma(&self, theta: &[f64]) -> Option<f64> {
        let dim = self.model().dim();
        let covariance = self.problem.noise().covariance(dim, &theta[self.own()..])?;
        let mean = (0..dim).map(|d| covariance[d][d]).sum::<f64>() / dim as f64;
        Some(mean.max(0.0).sqrt())
    }

    /// Return the standard deviation of the noise as [`ReadyStage::noise_sigma`], `None` where the weighted fit does not
    /// determine a full covariance: a variance of many parameters may be far off, or negative, and still fit.
    pub fn known_noise_sigma(&self, weighted: &MomentProblem, theta: &[f64], parts: &Parts) -> Option<f64> {
        let sigma = self.noise_sigma(theta)?;
        if self.stage.noise != NoiseModel::Full {
            return Some(sigma);
        }
        let dim = self.model().dim();
        let diagonal = |at: usize| (0..dim).any(|d| at == d * dim - d * d.saturating_sub(1) / 2);
        let weights: Vec<f64> =
            (0..self.num_nuisance()).map(|at| if diagonal(at) { (dim as f64).recip() } else { 0.0 }).collect();
        let deviation = statistics::deviation_of(weighted, theta, self.own_tangent(), &weights)?;
        (deviation <= parts.criteria.noise_reported * sigma * sigma).then_some(sigma)
    }

    /// Compare the points at theta.
    pub fn support(&self, theta: &[f64]) -> Result<Support, Error> {
        let source = self.mapped_source(theta)?;
        if self.model().target.is_moving() {
            let target = self.sides.mapped_target_at(&theta[..self.own()])?;
            return Ok(Support::of(&source, &target, self.noise_sigma(theta)));
        }
        Ok(Support::against(&source, self.target_tree(), self.noise_sigma(theta)))
    }

    /// Return the search structure of a target that does not move.
    pub fn target_tree(&self) -> &Neighbours {
        self.target_tree.get_or_init(|| Neighbours::new(self.sides.mapped_target.rows(), self.model().dim()))
    }

    /// Return where the randomness of the residual comes from at theta; `weighted` is the weighted problem so far.
    ///
    /// The noise is the nuisance parameter where the weighted fit so far determines it; else, and before any weighting, it is
    /// what the distances along the normals say.
    pub fn randomness(
        &self,
        theta: &[f64],
        weighted: Option<&MomentProblem>,
        support: &Support,
        kappa: f64,
        parts: &Parts,
    ) -> Randomness {
        let floor = parts.criteria.least_noise * self.unit();
        let determined = weighted.is_some_and(|problem| self.noise_is_determined(problem, theta, parts));
        let noise = self.noise(theta, parts).filter(|_| determined).unwrap_or_else(|| {
            let variance = support.normal_sigma.max(floor).powi(2);
            let mut covariance = [[0.0; 3]; 3];
            (0..self.model().dim()).for_each(|d| covariance[d][d] = variance);
            covariance
        });
        Randomness { noise, kappa, num_target: self.num_target }
    }

    /// Say whether the weighted fit at theta determines the variance of the noise.
    fn noise_is_determined(&self, weighted: &MomentProblem, theta: &[f64], parts: &Parts) -> bool {
        let own = self.own_tangent();
        let Some(sigma) = self.noise_sigma(theta) else { return false };
        statistics::deviation(weighted, theta, own)
            .is_some_and(|deviation| deviation < parts.criteria.noise_known * sigma * sigma)
    }

    /// Weight the problem by the covariance of the means at theta.
    ///
    /// # Errors
    /// [`Error`] where a mapped point is not finite or the weighted rows are fewer than the unknowns.
    pub fn weighted_at(&self, theta: &[f64], randomness: &Randomness, seed: u64) -> Result<MomentProblem, Error> {
        let covariance =
            statistics::feature_covariance(&self.problem, theta, randomness, seed).map_err(of_side(Side::Source))?;
        let whitening = self.weighting.whitening(&covariance, self.problem.num_features());
        let effective = whitening.as_ref().map(|whitening| whitening.effective);
        let whitened = self.problem.clone().with_whitening(whitening.map(|whitening| whitening.matrix));
        let problem = whitened.with_effective_rows(effective);
        problem.require_enough_features()?;
        Ok(problem)
    }
}
