//! The last word: the likelihood of the points chooses among the modes, and says how sure one may be
//! (docs/method.md, *The likelihood of the points*).

use super::Supervision;
use super::candidate::{Candidate, PointFit};
use super::modes::{Mode, Modes, ONE_MODE};
use super::search::Search;
use crate::distances::likelihood::{Fit, Kernel, Mixture, Placed, PointsLikelihood};
use crate::distances::sampling::Sampling;
use crate::error::Error;
use serde::{Deserialize, Serialize};

/// What the likelihood of the points says about a theta.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Evidence {
    /// Logarithm (base 10) of the expected number of thetas as good as this one among all that the data can tell apart, if the
    /// target were uniform on its bounding region (an a-contrario number of false alarms). Far below 0: no chance.
    pub log10_false_alarms: f64,
    /// Nats by which the mode that is hardest to tell from this one is less likely; infinite where there is none.
    pub second_mode_nats: f64,
    /// The same in standard deviations of a sum of as many differences (Vuong's test).
    pub second_mode_deviations: f64,
    /// Share of the source that the target does not explain.
    pub unseen_source: f64,
    /// Share of the target that the source does not explain: clutter.
    pub unseen_target: f64,
    /// Noise in sizes of the target (the median distance from its middle).
    pub noise: f64,
    /// Root of the trace of the covariance of theta: radians, lengths in sizes of the source.
    pub deviation: f64,
    /// Whether the target holds copies of source points rather than new draws from the shape.
    pub copies: bool,
}

impl Search<'_> {
    /// Choose a mode, polish it on all points and make it a candidate, with what is known about it.
    pub fn settle(
        &mut self,
        modes: &Modes,
        given: &[Vec<f64>],
        supervision: &mut Supervision<'_>,
    ) -> Result<Option<Candidate>, Error> {
        let chosen = self.chosen(modes, given);
        let Some((point_fit, fit, evidence)) = self.polished(modes, chosen)? else { return Ok(None) };
        let Some(mut candidate) = self.means_at(&fit, supervision)? else { return Ok(None) };
        if !self.means_agree(&candidate, &fit, &evidence) {
            candidate.take(&point_fit);
            candidate.plausible = self.is_plausible(&candidate.theta);
            let copies = fit.mixture.kernel == Kernel::Copies;
            if self.parts.settings.sampling.is_none() && copies && candidate.sampling == Some(Sampling::Independent) {
                candidate.sampling = Some(Sampling::Thinned);
            }
        }
        candidate.support = Some(self.last().support(&candidate.theta)?);
        let is_other = |mode: &&Mode| self.apart(&mode.fit.theta, &fit.theta) > ONE_MODE;
        candidate.modes = modes.all.iter().filter(is_other).cloned().collect();
        candidate.undetermined = match (self.comparison()?, evidence.copies) {
            (Some(fine), false) => {
                let several = modes.all[1..].iter().any(|mode| mode.behind.is_equal(&self.parts.criteria));
                self.undetermined(&fine, &chosen.fit, several)
            }
            // The pattern of the points determines theta where they are copies.
            _ => Vec::new(),
        };
        candidate.evidence = Some(evidence);
        Ok(Some(candidate))
    }

    /// Polish a mode on all points; `None` where the likelihood cannot be computed.
    fn polished(&self, modes: &Modes, chosen: &Mode) -> Result<Option<(PointFit, Fit, Evidence)>, Error> {
        let Some(full) = self.wide_enough(&chosen.fit)? else { return Ok(None) };
        // All points say better than some whether they are copies.
        let kernel = full.likely_kernel(&chosen.fit.theta).unwrap_or(chosen.fit.mixture.kernel);
        let Some(fit) = full.ascend(&chosen.fit.theta, kernel, 15, f64::NEG_INFINITY) else { return Ok(None) };
        let Some(mut placed) = full.place(&fit.theta, true) else { return Ok(None) };
        full.reweigh(&mut placed, &fit.mixture);
        let covariance = full.covariance(&placed, &fit.mixture);
        let evidence = self.evidence(modes, &full, &placed, &fit, covariance.as_deref());
        let n = placed.mapped.tangent;
        let point_fit = PointFit {
            message: format!("likelihood of the points, {} iterations", fit.iterations),
            converged: fit.converged,
            theta: fit.theta.clone(),
            sigma: fit.mixture.sigma,
            covariance: covariance.unwrap_or_else(|| vec![f64::NAN; n * n]),
        };
        Ok(Some((point_fit, fit, evidence)))
    }

    /// Return the mode to report: the most likely one; among modes that the data cannot tell apart the one next to a given start.
    fn chosen<'m>(&self, modes: &'m Modes, given: &[Vec<f64>]) -> &'m Mode {
        let best = &modes.all[0];
        let Some(start) = given.first() else { return best };
        let far = |mode: &Mode| self.apart(start, &mode.fit.theta);
        let equal = modes.all.iter().filter(|mode| mode.behind.is_equal(&self.parts.criteria));
        equal.min_by(|a, b| far(a).total_cmp(&far(b))).unwrap_or(best)
    }

    fn evidence(
        &self,
        modes: &Modes,
        full: &PointsLikelihood<'_>,
        placed: &Placed,
        fit: &Fit,
        covariance: Option<&[f64]>,
    ) -> Evidence {
        let second = modes.all[1..].iter().min_by(|a, b| a.behind.deviations.total_cmp(&b.behind.deviations));
        let deviation = covariance.map_or(f64::INFINITY, |covariance| self.deviation(&fit.theta, covariance));
        // The number of tests: the volume of the searched thetas in units of what the data can tell apart, a deviation each.
        let n = placed.mapped.tangent as f64;
        let tests = n * (std::f64::consts::TAU / deviation.clamp(1e-6, 1.0)).ln() / std::f64::consts::LN_10;
        Evidence {
            log10_false_alarms: tests - modes.gain / std::f64::consts::LN_10,
            second_mode_nats: second.map_or(f64::INFINITY, |mode| mode.behind.nats),
            second_mode_deviations: second.map_or(f64::INFINITY, |mode| mode.behind.deviations),
            unseen_source: full.unseen(placed, &fit.mixture),
            unseen_target: fit.mixture.clutter,
            noise: fit.mixture.sigma / full.size,
            deviation,
            copies: fit.mixture.kernel == Kernel::Copies,
        }
    }

    /// Return the root of the trace of a covariance, each coordinate in its unit: radians, sizes of the source.
    pub fn deviation(&self, theta: &[f64], covariance: &[f64]) -> f64 {
        let scales = self.scales(theta);
        let n = scales.len();
        (0..n).map(|j| covariance[j * n + j] / (scales[j] * scales[j])).sum::<f64>().sqrt()
    }

    /// Run the last stages on the points that are no clutter, from the fit.
    fn means_at(&mut self, fit: &Fit, supervision: &mut Supervision<'_>) -> Result<Option<Candidate>, Error> {
        let inliers = self.inliers(&fit.theta, &fit.mixture)?;
        let share = inliers.as_ref().map(|rows| 1.0 - rows.len() as f64 / self.stages.data.target.len() as f64);
        let data = match &inliers {
            Some(rows) => self.stages.data.keep(None, Some(rows))?,
            None => self.stages.data.clone(),
        };
        let first = self.first_on_final_model();
        let mut candidate = self.on_part(data, first, &fit.theta, supervision)?;
        if let Some(candidate) = &mut candidate {
            candidate.clutter = share;
        }
        Ok(candidate)
    }

    /// Say whether the means may have the last word: the same points on both sides, all of the source seen, and the statistics agree
    /// with the fit at the theta that the points chose.
    fn means_agree(&self, candidate: &Candidate, fit: &Fit, evidence: &Evidence) -> bool {
        let criteria = &self.parts.criteria;
        let accepts = candidate.statistics.as_ref().is_some_and(|s| s.p_value > criteria.p_suspect);
        candidate.accepted
            && accepts
            && candidate.sampling == Some(Sampling::Same)
            && evidence.unseen_source < 0.05
            && self.apart(&candidate.theta, &fit.theta) < ONE_MODE
    }

    /// Prepare the likelihood of as many points as the noise lets take part: the neighbours of a target point have to reach over
    /// the noise.
    fn wide_enough(&self, fit: &Fit) -> Result<Option<PointsLikelihood<'_>>, Error> {
        let Some(points) = &self.pipeline.points else { return Ok(None) };
        let mut count = self.last().all_source.len().min(points.source_points);
        loop {
            let Some(full) = self.likelihood([count, points.target_points], 32, "points")? else { return Ok(None) };
            let reach = full.place(&fit.theta, false).map_or(0.0, |placed| full.reach(&placed));
            if reach >= 2.5 * fit.mixture.sigma || count <= 300 {
                return Ok(Some(full));
            }
            count = (count * 3 / 5).max(300);
        }
    }

    /// Return the target rows that are no clutter at theta; `None` where nearly all are.
    fn inliers(&self, theta: &[f64], mixture: &Mixture) -> Result<Option<Vec<usize>>, Error> {
        let target = &self.last().sides.mapped_target;
        if mixture.clutter < 0.01 || target.len() != self.stages.data.target.len() {
            return Ok(None);
        }
        let Some(all) = self.likelihood([1000, 0], 12, "inliers")? else { return Ok(None) };
        let Some(placed) = all.place(theta, false) else { return Ok(None) };
        let shares = all.responsibilities(&placed, mixture);
        let rows: Vec<usize> = (0..shares.len()).filter(|k| shares[*k] > 0.5).collect();
        // The tails of the noise alone look like a few outliers, and the means of the same points need them.
        let few = rows.len() as f64 > 0.97 * shares.len() as f64;
        Ok((rows.len() > 10 && !few).then_some(rows))
    }
}
