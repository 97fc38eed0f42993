//! What is done with a fit that the statistics refuse: outliers of the target are found and left out.

use super::Supervision;
use super::candidate::{Candidate, PointFit};
use super::pipeline::{NoiseModel, Outliers, Pipeline};
use super::search::{Search, Stages};
use super::workbench::of_side;
use crate::distances::neighbours::Neighbours;
use crate::distances::sampling::thin;
use crate::distances::support::Support;
use crate::distances::{Mover, closest_point, mixture};
use crate::error::{Error, Side};
use crate::streams::stream;
use cfpose_kernel::points::Points;

/// What came out of leaving outliers out.
pub(super) struct Repaired {
    pub fit: PointFit,
    /// Share of the target points that were left out.
    pub clutter: f64,
    /// The last stages on the remaining target points.
    pub candidate: Candidate,
    /// Support of the fitted theta among all points.
    pub support: Support,
}

impl Search<'_> {
    /// Look for outliers: robust fits from several thetas, rejection, the last stages again on what is left.
    pub fn repair(
        &mut self,
        found: &[Candidate],
        starts: &[Vec<f64>],
        supervision: &mut Supervision<'_>,
    ) -> Result<Option<Repaired>, Error> {
        let (mut origins, questioned): (Vec<Vec<f64>>, usize) = (Vec::new(), self.parts.criteria.questioned);
        for theta in found.iter().take(questioned).map(|c| &c.theta).chain(starts) {
            let theta = self.last().adopt(theta, self.parts);
            if origins.iter().all(|other| !self.is_same(other, &theta)) && self.is_plausible(&theta) {
                origins.push(theta);
            }
        }
        let fitted = match self.pipeline.outliers {
            Outliers::None => None,
            Outliers::Mixture => self.by_mixture(&origins)?,
            Outliers::Trimmed => self.by_trimming(&origins)?,
            Outliers::Ransac => self.by_clusters(supervision)?,
        };
        match fitted {
            Some(fit) => self.without_outliers(fit, supervision),
            None => Ok(None),
        }
    }

    /// Thin both sides of the last stage for a robust fit.
    fn coarse(&self, [num_source, num_target]: [usize; 2]) -> Result<(Points, Vec<[f64; 3]>), Error> {
        let stage = self.last();
        let mut rng = stream(self.parts.settings.seed, "robust");
        let source = thin(&stage.all_source, num_source, &mut rng).map_err(of_side(Side::Source))?;
        let target = thin(&stage.sides.mapped_target, num_target, &mut rng).map_err(of_side(Side::Target))?;
        Ok((source, target.rows()))
    }

    /// The most likely of the mixtures of the mapped source with uniform outliers, from several thetas.
    fn by_mixture(&self, origins: &[Vec<f64>]) -> Result<Option<PointFit>, Error> {
        let criteria = &self.parts.criteria;
        let (source, target) = self.coarse(criteria.mixture_points)?;
        let stage = self.last();
        let mover = Mover::new(&stage.problem, &source);
        let sigma = criteria.mixture_sigma * stage.unit();
        let options = mixture::Options { sigma, ..mixture::Options::default() };
        let fits = origins.iter().filter_map(|theta| mixture::fit(&mover, &target, theta, &options));
        let best = fits
            .filter(|fit| self.is_plausible(&fit.theta))
            .max_by(|a, b| a.log_likelihood.total_cmp(&b.log_likelihood));
        // The fit saw a part of the target, and its covariance is that of the part.
        Ok(best.map(|fit| PointFit {
            message: format!("mixture with outliers, {} iterations", fit.iterations),
            converged: fit.iterations < options.max_iterations + options.annealing,
            theta: fit.theta,
            sigma: fit.sigma,
            covariance: fit.covariance,
        }))
    }

    /// The closest of the trimmed closest-point fits from several thetas.
    fn by_trimming(&self, origins: &[Vec<f64>]) -> Result<Option<PointFit>, Error> {
        let stage = self.last();
        let (source, coarse) = self.coarse(self.parts.criteria.trimmed_points)?;
        let mover = Mover::new(&stage.problem, &source);
        let options = closest_point::Options { tolerance: 1e-3, max_iterations: 20, ..Default::default() };
        let mut best: Option<(f64, Vec<f64>)> = None;
        for theta in origins {
            let Some(fit) = closest_point::refine(&mover, &coarse, theta, &options) else { continue };
            let distance = stage.support(&fit.theta)?.distance();
            if best.as_ref().is_none_or(|(least, _)| distance.total_cmp(least).is_lt()) {
                best = Some((distance, fit.theta));
            }
        }
        let fit = best.and_then(|(_, theta)| stage.by_closest_points(&theta, self.parts));
        Ok(fit.map(|fit| PointFit::of(fit, "trimmed closest points")))
    }

    /// Leave the outliers of a robust fit out and run the last stages on the rest.
    fn without_outliers(
        &mut self,
        fit: PointFit,
        supervision: &mut Supervision<'_>,
    ) -> Result<Option<Repaired>, Error> {
        let (stage, criteria) = (self.last(), &self.parts.criteria);
        let support = stage.support(&fit.theta)?;
        let mapped = stage.mapped_source(&fit.theta)?;
        let tree = Neighbours::new(mapped.rows(), mapped.dim());
        let least = 3.0 * criteria.least_noise * stage.unit();
        let limit = criteria.reject * fit.sigma.max(least).max(support.source_spacing);
        let target = &stage.sides.mapped_target;
        let near = |k: &usize| tree.nearest(&target.point(*k)).squared <= limit * limit;
        let kept: Vec<usize> = (0..target.len()).filter(near).collect();
        // Rows of the stage must be those of the file, and what is left must be more than a few points.
        if kept.len() < 3 || target.len() != self.stages.data.target.len() {
            return Ok(None);
        }
        let clutter = 1.0 - kept.len() as f64 / target.len() as f64;
        let data = self.stages.data.keep(None, Some(&kept))?;
        let first = self.first_on_final_model();
        let candidate = self.on_part(data, first, &fit.theta, supervision)?;
        Ok(candidate.map(|candidate| Repaired { fit, clutter, candidate, support }))
    }

    /// Run the stages from `first` on, on a part of the points, from theta.
    pub fn on_part(
        &mut self,
        data: super::workbench::Data,
        first: usize,
        theta: &[f64],
        supervision: &mut Supervision<'_>,
    ) -> Result<Option<Candidate>, Error> {
        let stages = Stages::new(self.parts, data, self.pipeline, first)?;
        let pipeline = Pipeline { stages: self.pipeline.stages[first..].to_vec(), ..self.pipeline.clone() };
        let mut search = Search::new(self.parts, &pipeline, &stages);
        let candidate = search.climb(theta, supervision)?;
        self.absorb(first, &search);
        Ok(candidate)
    }

    /// Return the first of the stages at the end that model the noise: what is run again with other points.
    pub fn first_on_final_model(&self) -> usize {
        let stages = &self.pipeline.stages;
        stages.iter().position(|stage| stage.noise != NoiseModel::None).unwrap_or(stages.len() - 1)
    }
}

impl PointFit {
    /// Take over a fit of closest points.
    pub fn of(fit: closest_point::ClosestPoint, method: &str) -> Self {
        Self {
            message: format!("{method}, {} iterations", fit.iterations),
            converged: fit.converged,
            theta: fit.theta,
            sigma: fit.rms,
            covariance: fit.covariance,
        }
    }
}
