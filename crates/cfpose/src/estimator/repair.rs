//! What is done with a fit that the statistics refuse: outliers are found and left out. And with one of small noise: it is
//! refined.

use cfpose_kernel::points::Points;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::Supervision;
use super::engine::{Engine, Hypothesis};
use super::level::{Ingredients, LEAST_NOISE};
use super::pipeline::{NoiseModel, Outliers, Pipeline};
use crate::distances::neighbours::Neighbours;
use crate::distances::sampling::thin;
use crate::distances::support::Support;
use crate::distances::{Mover, closest_point, mixture};
use crate::error::Error;

/// Hypotheses that are questioned for outliers, at most.
const MAX_CANDIDATES: usize = 3;
/// Points of the coarse robust fits: source, target.
const COARSE_MIXTURE: [usize; 2] = [400, 1000];
const COARSE_TRIM: [usize; 2] = [1000, 400];
/// A target point farther than this many standard deviations from the mapped source is an outlier.
const REJECT: f64 = 3.3;

/// A theta from a robust fit: what is known about it without the moments.
#[derive(Debug, Clone)]
pub(super) struct Robust {
    pub theta: Vec<f64>,
    /// Standard deviation of the noise in one coordinate.
    pub sigma: f64,
    /// Covariance of the model's tangent coordinates.
    pub covariance: Vec<f64>,
    /// Share of outliers.
    pub clutter: f64,
}

/// What came out of leaving outliers out.
pub(super) struct Repaired {
    pub robust: Robust,
    /// The last stages on the remaining target points, where they led anywhere.
    pub hypothesis: Option<Hypothesis>,
    /// Support of the robust theta among all points.
    pub support: Support,
}

impl Engine<'_> {
    /// Look for outliers: robust fits from several thetas, rejection, the last stages again.
    pub fn repair(
        &mut self,
        found: &[Hypothesis],
        starts: &[Vec<f64>],
        supervision: &mut Supervision<'_>,
    ) -> Result<Option<Repaired>, Error> {
        let mut candidates: Vec<Vec<f64>> = Vec::new();
        for theta in found.iter().take(MAX_CANDIDATES).map(|h| &h.solved.theta).chain(starts) {
            let theta = self.last().adopt(theta);
            if candidates.iter().all(|other| self.distance(other, &theta) > 0.02) && self.is_plausible(&theta) {
                candidates.push(theta);
            }
        }
        let fitted = match self.pipeline.outliers {
            Outliers::None => None,
            Outliers::Mixture => self.by_mixture(&candidates)?,
            Outliers::Trimmed => self.by_trimming(&candidates)?,
            Outliers::Ransac => self.by_clusters(supervision)?,
        };
        let Some(robust) = fitted else { return Ok(None) };
        self.without_outliers(robust, supervision).map(Some)
    }

    /// Thin both sides of the last stage for a robust fit.
    fn coarse(&self, [num_source, num_target]: [usize; 2]) -> Result<(Points, Vec<[f64; 3]>), Error> {
        let level = self.last();
        let mut rng = ChaCha8Rng::seed_from_u64(self.ingredients.settings.seed ^ 0x726f_6275_7374);
        let source = thin(&level.all_source, num_source, &mut rng)
            .map_err(|problem| Error::Points { side: "source", problem })?;
        let target = thin(&level.mapped_target, num_target, &mut rng)
            .map_err(|problem| Error::Points { side: "target", problem })?;
        Ok((source, target.rows()))
    }

    fn by_mixture(&self, candidates: &[Vec<f64>]) -> Result<Option<Robust>, Error> {
        let (source, target) = self.coarse(COARSE_MIXTURE)?;
        let level = self.last();
        let mover = Mover::new(&level.problem, &source);
        let options = mixture::Options { sigma: 0.15 * level.unit(), ..mixture::Options::default() };
        let fits = candidates.iter().filter_map(|theta| mixture::fit(&mover, &target, theta, &options));
        let best = fits
            .filter(|fit| self.is_plausible(&fit.theta))
            .max_by(|a, b| a.log_likelihood.total_cmp(&b.log_likelihood));
        let Some(best) = best else { return Ok(None) };
        Ok(Some(Robust {
            // The fit saw a part of the target, and its covariance is that of the part.
            covariance: best.covariance,
            theta: best.theta,
            sigma: best.sigma,
            clutter: best.share,
        }))
    }

    fn by_trimming(&self, candidates: &[Vec<f64>]) -> Result<Option<Robust>, Error> {
        let level = self.last();
        let (source, coarse) = self.coarse(COARSE_TRIM)?;
        let mover = Mover::new(&level.problem, &source);
        let options = closest_point::Options { tolerance: 1e-3, max_iterations: 20, ..Default::default() };
        let fits = candidates.iter().filter_map(|theta| closest_point::refine(&mover, &coarse, theta, &options));
        let mut scored: Vec<(f64, closest_point::ClosestPoint)> = Vec::new();
        for fit in fits {
            scored.push((level.support(&fit.theta)?.distance(), fit));
        }
        scored.sort_by(|a, b| a.0.total_cmp(&b.0));
        let Some((_, best)) = scored.into_iter().next() else { return Ok(None) };
        let Some(best) = level.refined(&best.theta) else { return Ok(None) };
        Ok(Some(Robust { clutter: 1.0 - best.share, theta: best.theta, sigma: best.rms, covariance: best.covariance }))
    }

    /// Leave the outliers of a robust fit out and run the last stages on the rest.
    fn without_outliers(&mut self, mut robust: Robust, supervision: &mut Supervision<'_>) -> Result<Repaired, Error> {
        let level = self.last();
        let support = level.support(&robust.theta)?;
        let mapped = level.mapped_source(&robust.theta)?;
        let tree = Neighbours::new(mapped.rows(), mapped.dim());
        let limit = REJECT * robust.sigma.max(3.0 * LEAST_NOISE * level.unit()).max(support.source_spacing);
        let near = |k: &usize| tree.nearest(&level.mapped_target.point(*k)).squared <= limit * limit;
        // The last stage sees all target points, so its indices are those of the file.
        let kept: Vec<usize> = (0..level.mapped_target.len()).filter(near).collect();
        let total = level.mapped_target.len();
        if kept.len() < 3 || level.mapped_target.len() != self.ingredients.target.len() {
            return Ok(Repaired { robust, hypothesis: None, support });
        }
        robust.clutter = 1.0 - kept.len() as f64 / total as f64;
        let target =
            self.ingredients.target.select(&kept).map_err(|problem| Error::Points { side: "target", problem })?;
        let ingredients = Ingredients { target: &target, ..self.ingredients };
        let first = self.first_on_final_model();
        let pipeline = Pipeline { stages: self.pipeline.stages[first..].to_vec(), ..self.pipeline.clone() };
        let mut engine = Engine::new(ingredients, &pipeline)?;
        let hypothesis = engine.climb(0, &robust.theta, supervision)?;
        self.absorb(first, &engine);
        Ok(Repaired { robust, hypothesis, support })
    }

    /// Return the first of the stages at the end that model the noise: what is run again with other points.
    pub fn first_on_final_model(&self) -> usize {
        let stages = &self.pipeline.stages;
        stages.iter().position(|stage| stage.noise != NoiseModel::None).unwrap_or(stages.len() - 1)
    }
}
