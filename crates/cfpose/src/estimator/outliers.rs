//! What is done with a fit that the statistics refuse: outliers of the target are found and left out.

use super::Watch;
use super::candidate::{Candidate, PointFit};
use super::pipeline::{NoiseModel, Outliers, Pipeline};
use super::search::{Search, Stages};
use crate::distances::neighbours::Neighbours;
use crate::distances::support::Support;
use crate::error::Error;

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
    /// Look for outliers: hypotheses, rejection, the last stages again on what is left.
    pub fn repair(&mut self, watch: &mut Watch<'_>) -> Result<Option<Repaired>, Error> {
        let fitted = match self.pipeline.outliers {
            Outliers::None => None,
            Outliers::Ransac => self.by_clusters(watch)?,
        };
        match fitted {
            Some(fit) => self.without_outliers(fit, watch),
            None => Ok(None),
        }
    }

    /// Leave the outliers of a robust fit out and run the last stages on the rest.
    fn without_outliers(&mut self, fit: PointFit, watch: &mut Watch<'_>) -> Result<Option<Repaired>, Error> {
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
        let candidate = self.on_part(data, first, &fit.theta, watch)?;
        Ok(candidate.map(|candidate| Repaired { fit, clutter, candidate, support }))
    }

    /// Run the stages from `first` on, on a part of the points, from theta.
    pub fn on_part(
        &mut self,
        data: super::workbench::Data,
        first: usize,
        theta: &[f64],
        watch: &mut Watch<'_>,
    ) -> Result<Option<Candidate>, Error> {
        let stages = Stages::new(self.parts, data, self.pipeline, first)?;
        let pipeline = Pipeline { stages: self.pipeline.stages[first..].to_vec(), ..self.pipeline.clone() };
        let mut search = Search::new(self.parts, &pipeline, &stages, self.interrupt);
        let candidate = search.climb(theta, watch)?;
        self.absorb(first, &search);
        Ok(candidate)
    }

    /// Return the first of the stages at the end that model the noise: what is run again with other points.
    pub fn first_on_final_model(&self) -> usize {
        let stages = &self.pipeline.stages;
        stages.iter().position(|stage| stage.noise != NoiseModel::None).unwrap_or(stages.len() - 1)
    }
}
