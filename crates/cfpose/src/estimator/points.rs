//! The last word: the likelihood of the points chooses among the modes, and says how sure one may be
//! (docs/method.md, *The likelihood of the points*).

use super::Watch;
use super::candidate::{By, Candidate, PointFit};
use super::modes::{Mode, Modes, ONE_MODE};
use super::search::Search;
use crate::criteria::Criteria;
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
    /// Share of the variance of the distances along normals that neighbouring target points have in common: about 0 for noise; large where
    /// the noise that fits best has swallowed a misfit.
    pub coherence: f64,
    /// Whether the target holds copies of source points rather than new draws from the shape.
    pub copies: bool,
}

impl Evidence {
    /// Say whether the part of the source that is seen is enough to know theta: no other theta explains as much, and the noise is too small
    /// to make one part look like another.
    pub(super) fn is_part_enough(&self, criteria: &Criteria) -> bool {
        let is_clear = self.second_mode_deviations >= criteria.clear_deviations && self.noise <= criteria.clear_noise;
        is_clear && self.unseen_source <= criteria.unseen_clear && self.unseen_target <= criteria.unseen_clear
    }
}

/// Target points that the mixture of all is taken from, where outliers are looked for.
const MIXED: usize = 20_000;
/// Points that are asked about the theta of the means: what is seen (source, target), whether they are copies (target).
const ASKED: ([usize; 2], usize) = ([800, 2000], 600);

impl Search<'_> {
    /// Choose a mode and make it a candidate with what is known about it: by the means where they agree with it, else by the
    /// likelihood of all points.
    pub fn settle(
        &mut self,
        modes: &Modes,
        found: &[Candidate],
        given: &[Vec<f64>],
        watch: &mut Watch<'_>,
    ) -> Result<Option<Candidate>, Error> {
        let chosen = self.chosen(modes, given);
        let Some(mut candidate) = self.means_at(&chosen.fit, found, watch)? else { return Ok(None) };
        let evidence = match self.agreed(modes, chosen, &candidate)? {
            Some(evidence) => evidence,
            None => {
                let Some((fit, evidence)) = self.polished(modes, chosen)? else { return Ok(None) };
                candidate.take(&fit);
                candidate.plausible = self.is_plausible(&candidate.theta);
                let hides = candidate.sampling == Some(Sampling::Independent) && evidence.copies;
                if self.parts.settings.sampling.is_none() && hides {
                    candidate.sampling = Some(Sampling::Thinned);
                }
                evidence
            }
        };
        // What was found on a part of the target, or at another theta, does not hold for all at this one.
        let is_weighed = self.pipeline.support && candidate.outcome.usable() && candidate.clutter.is_none();
        if !is_weighed || candidate.by == By::Points {
            candidate.support = Some(self.last().support(&candidate.theta)?);
        }
        let is_other = |mode: &&Mode| self.apart(&mode.fit.theta, &candidate.theta) > ONE_MODE;
        candidate.modes = modes.all.iter().filter(is_other).cloned().collect();
        let fine = self.comparison(modes.source_points)?;
        candidate.unexplained = fine.as_ref().and_then(|fine| self.unexplained(fine, chosen, &candidate.modes));
        // The pattern of the points determines theta where they are copies, and the noise does not hide it.
        let shows_pattern = candidate.support.as_ref().is_some_and(|support| {
            let noise = evidence.noise * fine.as_ref().map_or(0.0, |fine| fine.size);
            evidence.copies && noise.powi(2) < self.parts.criteria.visible * support.source_spacing.powi(2)
        });
        candidate.undetermined = match (fine, shows_pattern) {
            (Some(fine), false) => {
                let several = modes.all[1..].iter().any(|mode| mode.behind.is_equal(&self.parts.criteria));
                self.undetermined(&fine, &chosen.fit, several)
            }
            _ => Vec::new(),
        };
        candidate.evidence = Some(evidence);
        Ok(Some(candidate))
    }

    /// Return the evidence at the theta of the means, where they may have the last word: the same points on both sides, all of
    /// the source seen, the statistics accept, and the mode is the one that the points chose.
    fn agreed(&self, modes: &Modes, chosen: &Mode, candidate: &Candidate) -> Result<Option<Evidence>, Error> {
        let criteria = &self.parts.criteria;
        let Some(statistics) = candidate.statistics.as_ref() else { return Ok(None) };
        let agrees = candidate.accepted
            && statistics.p_value > criteria.p_agrees
            && candidate.sampling == Some(Sampling::Same)
            && self.apart(&candidate.theta, &chosen.fit.theta) < ONE_MODE;
        if !agrees {
            return Ok(None);
        }
        let theta = &candidate.theta;
        // Copies show on all of the source and few target points; what is seen, on few of the source and many of the target.
        let (seeing, copying) = ASKED;
        let (seeing, copying) = (self.seeing(&chosen.fit, seeing)?, self.wide_enough(&chosen.fit, copying)?);
        let (Some(seeing), Some(copying)) = (seeing, copying) else { return Ok(None) };
        let Some(mut placed) = seeing.place(theta, false) else { return Ok(None) };
        let (mixture, log_likelihood) = seeing.best_mixture(&mut placed, Kernel::Shape, 10);
        let fit = Fit { theta: theta.clone(), mixture, log_likelihood, iterations: 0, converged: true };
        let mut evidence = self.evidence(modes, &seeing, &placed, &fit, Some(&statistics.covariance));
        evidence.copies = copying.likely_kernel(theta, criteria.mode_nats) == Some(Kernel::Copies);
        Ok(Some(evidence).filter(|evidence| evidence.unseen_source < 0.05))
    }

    /// Polish a mode on all points; `None` where the likelihood cannot be computed.
    fn polished(&self, modes: &Modes, chosen: &Mode) -> Result<Option<(PointFit, Evidence)>, Error> {
        let target_points = self.pipeline.points.as_ref().map_or(0, |points| points.target_points);
        let Some(mut full) = self.wide_enough(&chosen.fit, target_points)? else { return Ok(None) };
        if let Some(most) = modes.most_noise {
            full = full.with_noise_below(most);
        }
        // All points say better than some whether they are copies.
        let kernel =
            full.likely_kernel(&chosen.fit.theta, self.parts.criteria.mode_nats).unwrap_or(chosen.fit.mixture.kernel);
        let Some(fit) = full.ascend_fully(&chosen.fit.theta, kernel, 25) else { return Ok(None) };
        let Some(mut placed) = full.place(&fit.theta, true) else { return Ok(None) };
        full.reweigh(&mut placed, &fit.mixture);
        let covariance = full.covariance(&placed, &fit.mixture);
        let evidence = self.evidence(modes, &full, &placed, &fit, covariance.as_deref());
        let n = placed.mapped.tangent;
        let point_fit = PointFit {
            message: format!("likelihood of the points, {} iterations", fit.iterations),
            converged: fit.converged,
            theta: fit.theta,
            sigma: fit.mixture.sigma,
            covariance: covariance.unwrap_or_else(|| vec![f64::NAN; n * n]),
        };
        Ok(Some((point_fit, evidence)))
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
            coherence: full.coherence(placed, &fit.mixture),
            copies: fit.mixture.kernel == Kernel::Copies,
        }
    }

    /// Return the root of the trace of a covariance, each coordinate in its unit: radians, sizes of the source.
    pub fn deviation(&self, theta: &[f64], covariance: &[f64]) -> f64 {
        let scales = self.scales(theta);
        let n = scales.len();
        (0..n).map(|j| covariance[j * n + j] / (scales[j] * scales[j])).sum::<f64>().sqrt()
    }

    /// Run the last stages on the points that are no clutter, from the fit; what the means found there already is taken.
    fn means_at(&mut self, fit: &Fit, found: &[Candidate], watch: &mut Watch<'_>) -> Result<Option<Candidate>, Error> {
        let inliers = self.inliers(fit)?;
        let Some(rows) = inliers else {
            let is_here = |known: &&Candidate| known.accepted && self.apart(&known.theta, &fit.theta) < ONE_MODE;
            if let Some(known) = found.iter().find(is_here) {
                return Ok(Some(known.clone()));
            }
            return self.climb_from(self.first_on_final_model(), &fit.theta, watch);
        };
        let share = 1.0 - rows.len() as f64 / self.stages.data.target.len() as f64;
        let data = self.stages.data.keep(None, Some(&rows))?;
        let first = self.first_on_final_model();
        let candidate = self.on_part(data, first, &fit.theta, watch)?;
        Ok(candidate.map(|candidate| Candidate { clutter: Some(share), ..candidate }))
    }

    /// Return the target rows that are no clutter at theta; `None` where nearly all are.
    fn inliers(&self, fit: &Fit) -> Result<Option<Vec<usize>>, Error> {
        let target = &self.last().sides.mapped_target;
        if fit.mixture.clutter < 0.01 || target.len() != self.stages.data.target.len() {
            return Ok(None);
        }
        // A part of a large target says what the mixture is, and often that nothing is to be left out.
        let Some(part) = self.wide_enough(fit, MIXED)? else { return Ok(None) };
        let Some(mut placed) = part.place(&fit.theta, false) else { return Ok(None) };
        let shape = Mixture { kernel: Kernel::Shape, ..fit.mixture };
        let (mixture, _) = part.mixture_from(&mut placed, &shape);
        let inlying = |shares: &[f64]| (0..shares.len()).filter(|k| shares[*k] > 0.5).collect::<Vec<usize>>();
        // The tails of the noise alone look like a few outliers, and the means of the same points need them.
        let few = |rows: &[usize], all: usize| rows.len() as f64 > 0.97 * all as f64;
        let asked = part.responsibilities(&placed, &mixture);
        if few(&inlying(&asked), asked.len()) {
            return Ok(None);
        }
        let rows = inlying(&part.responsibilities_of(&placed, &mixture, &target.rows()));
        Ok((rows.len() > 10).then_some(rows))
    }
}
