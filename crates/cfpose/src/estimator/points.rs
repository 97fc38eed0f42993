//! The last word: modes of the points' likelihood, wherever the means led, ranked in nats (docs/method.md, *The likelihood of the points*).

use super::Supervision;
use super::candidate::{Candidate, PointFit};
use super::search::Search;
use super::workbench::of_side;
use crate::criteria::Criteria;
use crate::distances::likelihood::{Fit, Kernel, Mixture, PointsLikelihood};
use crate::distances::sampling::{Sampling, even, thin};
use crate::error::{Error, Side};
use crate::streams::stream;
use cfpose_kernel::points::Points;
use serde::{Deserialize, Serialize};

/// What the likelihood of the points says about a theta.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Evidence {
    /// Logarithm (base 10) of the expected number of poses as good as this one among all that the search can tell apart, if the target
    /// were uniform on its bounding region. Far below 0: no chance.
    pub log10_false_alarms: f64,
    /// Nats by which the mode that is hardest to tell from this one is less likely; infinite where there is none.
    pub second_mode_nats: f64,
    /// The same in standard deviations of the sum of differences over the points (Vuong 1989).
    pub second_mode_deviations: f64,
    /// Share of the source that the target does not explain.
    pub unseen_source: f64,
    /// Share of the target that the source does not explain.
    pub unseen_target: f64,
    /// Noise in sizes of the target (the median distance from its middle).
    pub noise: f64,
    /// Root of the covariance's trace, each coordinate in its own unit: radians, sizes of the source.
    pub deviation: f64,
    /// Whether the target holds copies of source points rather than new draws from the shape.
    pub copies: bool,
    /// Neighbouring residuals' correlation in standard deviations of chance.
    pub coherence: f64,
}

/// A mode of the likelihood.
#[derive(Debug, Clone)]
pub(super) struct Mode {
    pub fit: Fit,
    /// Nats behind the most likely mode, and the same in standard deviations.
    pub behind: [f64; 2],
}

impl Mode {
    /// Say whether the data cannot tell the mode from the most likely one.
    pub fn is_equal(&self, criteria: &Criteria) -> bool {
        self.behind[0] < criteria.mode_nats || self.behind[1] < criteria.mode_deviations
    }
}

/// What the search for modes found, most likely first.
pub(super) struct Modes {
    pub modes: Vec<Mode>,
    /// Gain over a target that is all clutter, in nats.
    pub gain: f64,
}

impl Search<'_> {
    /// Thin both sides of the last stage and prepare their likelihood.
    pub fn likelihood(
        &self,
        [num_source, num_target]: [usize; 2],
        neighbours: usize,
        name: &str,
    ) -> Result<Option<PointsLikelihood<'_>>, Error> {
        let stage = self.last();
        let mut rng = stream(self.parts.settings.seed, name);
        let source = thin(&stage.all_source, num_source, &mut rng).map_err(of_side(Side::Source))?;
        let target = thin(&stage.sides.mapped_target, num_target, &mut rng).map_err(of_side(Side::Target))?;
        Ok(PointsLikelihood::new(&stage.problem, &source, target.rows(), neighbours))
    }

    /// Cover both sides of the last stage evenly with so many points and prepare their likelihood.
    fn evenly(&self, [num_source, num_target]: [usize; 2]) -> Result<Option<PointsLikelihood<'_>>, Error> {
        let stage = self.last();
        let source = even(&stage.all_source, num_source).map_err(of_side(Side::Source))?;
        let mut rng = stream(self.parts.settings.seed, "coarse");
        let target = &stage.sides.mapped_target;
        let covering = even(target, num_target / 2).map_err(of_side(Side::Target))?;
        let random = thin(target, num_target / 2, &mut rng).map_err(of_side(Side::Target))?;
        let rows = [covering.rows(), random.rows()].concat();
        Ok(PointsLikelihood::new(&stage.problem, &source, rows, 8))
    }

    /// Look for all modes of the likelihood: from the candidates so far, given thetas, and everywhere.
    pub fn modes(&mut self, found: &[Candidate], given: &[Vec<f64>]) -> Result<Option<Modes>, Error> {
        let criteria = &self.parts.criteria;
        let (Some(coarse), Some(fine)) = (self.evenly([300, 150])?, self.likelihood([500, 400], 12, "modes-fine")?)
        else {
            return Ok(None);
        };
        let adopt = |theta: &Vec<f64>| self.last().adopt(theta, self.parts);
        let near: Vec<Vec<f64>> = found.iter().map(|c| adopt(&c.theta)).chain(given.iter().map(adopt)).collect();
        let mut scored: Vec<(f64, Vec<f64>)> = Vec::new();
        // Candidates are tried as they are and aligned; the others have to be aligned.
        for theta in &near {
            scored.extend(score(&coarse, theta.clone()));
            scored.extend(coarse.align(theta, &[0.25, 0.13, 0.07], 4).and_then(|(_, theta)| score(&coarse, theta)));
        }
        let mut rough: Vec<(f64, Vec<f64>)> = Vec::new();
        for theta in self.everywhere()? {
            rough.extend(coarse.align(&adopt(&theta), &[0.25], 4));
        }
        rough.sort_by(|a, b| b.0.total_cmp(&a.0));
        for (_, theta) in rough.into_iter().take(criteria.aligned) {
            scored.extend(coarse.align(&theta, &[0.13, 0.07], 4).and_then(|(_, theta)| score(&coarse, theta)));
        }
        scored.retain(|(value, theta)| value.is_finite() && self.is_plausible(theta));
        let kept = self.distinct(scored, criteria.polished);
        let mut fits: Vec<Fit> = Vec::new();
        let mut most = f64::NEG_INFINITY;
        for theta in kept {
            let Some(fit) = fine.ascend(&theta, Kernel::Shape, 12, most) else { continue };
            most = most.max(fit.log_likelihood);
            // Copies are tried from where the shape lies.
            let copies = fine.ascend(&fit.theta, Kernel::Copies, 8, most);
            most = copies.as_ref().map_or(most, |copies| most.max(copies.log_likelihood));
            fits.extend([Some(fit), copies].into_iter().flatten().filter(|fit| self.is_plausible(&fit.theta)));
        }
        fits.sort_by(|a, b| b.log_likelihood.total_cmp(&a.log_likelihood));
        let mut modes: Vec<Mode> = Vec::new();
        for fit in fits {
            if fit.log_likelihood.is_finite() && modes.iter().all(|mode| self.apart(&mode.fit.theta, &fit.theta) > 0.1)
            {
                let behind = modes.first().map_or([0.0; 2], |best| behind(&fine, &best.fit, &fit));
                modes.push(Mode { fit, behind });
            }
        }
        let gain = modes.first().map_or(0.0, |mode| mode.fit.log_likelihood - fine.chance());
        Ok((!modes.is_empty()).then_some(Modes { modes, gain }))
    }

    /// Keep the best that differ.
    fn distinct(&self, mut scored: Vec<(f64, Vec<f64>)>, most: usize) -> Vec<Vec<f64>> {
        scored.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut kept: Vec<Vec<f64>> = Vec::new();
        for (_, theta) in scored {
            if kept.len() < most && kept.iter().all(|other| self.apart(other, &theta) > 0.15) {
                kept.push(theta);
            }
        }
        kept
    }

    /// Return thetas all over the model's manifold, from the target without what lies far outside.
    fn everywhere(&self) -> Result<Vec<Vec<f64>>, Error> {
        let Some(name) = &self.pipeline.points_start else { return Ok(Vec::new()) };
        let stage = self.last();
        // An even part of the target is not moved by dense clutter, a random part not by thin clutter.
        let mut rng = stream(self.parts.settings.seed, "everywhere");
        let on_target = of_side(Side::Target);
        let parts = [even(&stage.sides.mapped_target, 300), thin(&stage.sides.mapped_target, 300, &mut rng)];
        let source = even(&stage.sides.source, 300).map_err(of_side(Side::Source))?;
        let mut thetas = Vec::new();
        for part in parts {
            let target = part.and_then(|part| central(&part)).map_err(&on_target)?;
            thetas.extend(self.proposals_for(name, stage, &source, &target)?);
        }
        Ok(thetas)
    }

    /// Return how far two thetas are apart: radians, and lengths in sizes of the source.
    pub fn apart(&self, a: &[f64], b: &[f64]) -> f64 {
        self.distance(a, b)
    }

    /// Polish a mode on all points and make it a candidate, with what is known about it.
    pub fn settle(&mut self, modes: &Modes, supervision: &mut Supervision<'_>) -> Result<Option<Candidate>, Error> {
        let best = &modes.modes[0].fit;
        let Some(full) = self.wide_enough(&best.theta, &best.mixture)? else { return Ok(None) };
        let Some(fit) = full.ascend(&best.theta, best.mixture.kernel, 15, f64::NEG_INFINITY) else { return Ok(None) };
        let Some(mut placed) = full.place(&fit.theta, true) else { return Ok(None) };
        full.reweigh(&mut placed, &fit.mixture);
        let covariance = full.covariance(&placed, &fit.mixture);
        let unseen_target = fit.mixture.clutter;
        let second = modes.modes[1..].iter().min_by(|a, b| a.behind[1].total_cmp(&b.behind[1]));
        let evidence = Evidence {
            log10_false_alarms: -modes.gain / std::f64::consts::LN_10,
            second_mode_nats: second.map_or(f64::INFINITY, |mode| mode.behind[0]),
            second_mode_deviations: second.map_or(f64::INFINITY, |mode| mode.behind[1]),
            unseen_source: full.unseen(&placed, &fit.mixture),
            unseen_target,
            noise: fit.mixture.sigma / full.size,
            deviation: covariance.as_ref().map_or(f64::INFINITY, |c| {
                let n = placed.mapped.tangent;
                (0..n).map(|j| c[j * n + j]).sum::<f64>().sqrt()
            }),
            copies: fit.mixture.kernel == Kernel::Copies,
            coherence: full.coherence(&placed, &fit.mixture),
        };
        let inliers = self.inliers(&fit.theta, &fit.mixture)?;
        let data = match &inliers {
            Some(rows) => self.stages.data.keep(None, Some(rows))?,
            None => self.stages.data.clone(),
        };
        let first = self.first_on_final_model();
        let Some(mut candidate) = self.on_part(data, first, &fit.theta, supervision)? else { return Ok(None) };
        let n = placed.mapped.tangent;
        let fit = PointFit {
            message: format!("likelihood of the points, {} iterations", fit.iterations),
            converged: fit.converged,
            theta: fit.theta,
            sigma: fit.mixture.sigma,
            covariance: covariance.unwrap_or_else(|| vec![f64::NAN; n * n]),
        };
        let same_mode = self.apart(&candidate.theta, &fit.theta) < 0.1;
        let by_means = candidate.accepted
            && same_mode
            && candidate.sampling == Some(Sampling::Same)
            && evidence.unseen_source < 0.05
            && candidate.statistics.as_ref().is_some_and(|s| s.p_value > self.parts.criteria.p_suspect);
        if !by_means {
            candidate.take(&fit);
            candidate.plausible = self.is_plausible(&candidate.theta);
            candidate.support = Some(self.last().support(&candidate.theta)?);
        }
        candidate.clutter = inliers.is_some().then_some(unseen_target);
        candidate.evidence = Some(evidence);
        Ok(Some(candidate))
    }

    /// Prepare the likelihood of as many points as the noise lets take part: the neighbours of a target point have to reach over
    /// the noise.
    fn wide_enough(&self, theta: &[f64], mixture: &Mixture) -> Result<Option<PointsLikelihood<'_>>, Error> {
        let mut count = self.last().all_source.len().min(4000);
        loop {
            let Some(full) = self.likelihood([count, 2000], 32, "points")? else { return Ok(None) };
            let reach = full.place(theta, false).map_or(0.0, |placed| full.reach(&placed));
            if reach >= 2.5 * mixture.sigma || count <= 300 {
                return Ok(Some(full));
            }
            count = (count * 3 / 5).max(300);
        }
    }

    /// Return the target rows that are no clutter at theta; `None` where nearly all are.
    fn inliers(&self, theta: &[f64], mixture: &Mixture) -> Result<Option<Vec<usize>>, Error> {
        let stage = self.last();
        let target = &stage.sides.mapped_target;
        if mixture.clutter < 0.01 || target.len() != self.stages.data.target.len() {
            return Ok(None);
        }
        let Some(all) = self.likelihood([1000, 0], 12, "inliers")? else { return Ok(None) };
        let Some(placed) = all.place(theta, false) else { return Ok(None) };
        let shares = all.responsibilities(&placed, mixture);
        let rows: Vec<usize> = (0..shares.len()).filter(|k| shares[*k] > 0.5).collect();
        Ok((rows.len() > 10 && rows.len() < shares.len()).then_some(rows))
    }
}

/// Return by how many nats a fit is behind another, and that in standard deviations of a sum of as many independent differences: Vuong's
/// test (1989) of two models that do not contain each other. Where the target is a new sample of a symmetric shape, one of the equal
/// poses is ahead by chance, by more nats the more points there are.
fn behind(likelihood: &PointsLikelihood<'_>, best: &Fit, other: &Fit) -> [f64; 2] {
    let each = |fit: &Fit| {
        let mut placed = likelihood.place(&fit.theta, false)?;
        likelihood.reweigh(&mut placed, &fit.mixture);
        Some(likelihood.log_each(&placed, &fit.mixture))
    };
    let nats = best.log_likelihood - other.log_likelihood;
    let (Some(a), Some(b)) = (each(best), each(other)) else { return [nats, 0.0] };
    let differences: Vec<f64> = a.iter().zip(&b).map(|(a, b)| a - b).collect();
    let mean = differences.iter().sum::<f64>() / differences.len() as f64;
    let square: f64 = differences.iter().map(|d| (d - mean).powi(2)).sum();
    [nats, if square > 0.0 { nats / square.sqrt() } else { 0.0 }]
}

/// Score a theta by the likelihood of its best mixture.
fn score(likelihood: &PointsLikelihood<'_>, theta: Vec<f64>) -> Option<(f64, Vec<f64>)> {
    let mut placed = likelihood.place(&theta, false)?;
    Some((likelihood.best_mixture(&mut placed, Kernel::Shape, 5).1, theta))
}

/// Leave out what is farther from the middle than three times the median distance.
fn central(points: &Points) -> Result<Points, cfpose_kernel::points::PointsError> {
    let dim = points.dim();
    let middle: Vec<f64> = (0..dim)
        .map(|d| {
            let mut column = points.column(d).to_vec();
            column.sort_by(f64::total_cmp);
            column[column.len() / 2]
        })
        .collect();
    let distance = |k: usize| (0..dim).map(|d| (points.column(d)[k] - middle[d]).powi(2)).sum::<f64>().sqrt();
    let distances: Vec<f64> = (0..points.len()).map(distance).collect();
    let mut sorted = distances.clone();
    sorted.sort_by(f64::total_cmp);
    let limit = 3.0 * sorted[sorted.len() / 2];
    let rows: Vec<usize> = (0..points.len()).filter(|k| distances[*k] <= limit).collect();
    if rows.len() < 3 { Ok(points.clone()) } else { points.select(&rows) }
}
