//! What is known of the best theta, as a result of its own: no test of single points is in it.

use cfpose_optim::LeastSquares;
use cfpose_optim::manifold::Manifold;

use super::{Found, MomentEstimator, ReadyStage, SAME};
use crate::criteria::Criteria;
use crate::estimator::{Alternative, By, Estimate, Minimised, StageReport, Verdict};
use crate::geometry::linalg::congruent;
use crate::geometry::pose::Pose;
use crate::statistics::conditioning::{Conditioning, observe};
use crate::statistics::{self, Statistics};

impl MomentEstimator {
    /// Say what is known of the best theta.
    pub(super) fn estimate(
        &self,
        best: Found,
        others: &[Found],
        starts: usize,
        iterations: usize,
        reports: Vec<StageReport>,
    ) -> Estimate {
        let (ready, theta) = (self.last(), best.outcome.theta.clone());
        let usable = best.outcome.usable();
        let statistics = self.statistics(&best, ready);
        let mut warnings = vec![
            "moments hold no points: overlap, outliers, other modes and chance are not tested, the verdict is suspect at most"
                .to_string(),
        ];
        if let Some(found) = statistics.as_ref().filter(|found| found.p_value < Criteria::default().p_suspect) {
            let (j, dof) = (found.j_statistic, found.degrees_of_freedom);
            warnings.push(format!("the statistics refuse the fit: J = {j:.0} with {dof} degrees of freedom"));
        }
        let tangent = best.problem.manifold().tangent();
        let conditioning = match usable {
            true => {
                let (jacobian, free) = (best.problem.evaluate(&theta).jacobian, self.settings.free.as_deref());
                observe(&jacobian, tangent, &self.model.layout, free, &theta)
            }
            false => Conditioning::unknown(tangent),
        };
        warnings.extend(conditioning.warnings());
        let verdict = match (usable, best.outcome.status.is_interruption(), &statistics) {
            (false, ..) => Some(Verdict::Failed),
            (true, true, _) | (true, _, Some(_)) => Some(Verdict::Suspect),
            _ => None,
        };
        Estimate {
            pose: Pose::of_theta(&self.model.layout, &theta),
            by: By::Moments,
            verdict,
            minimised: Minimised {
                stage: ready.stage.clone(),
                theta: theta.clone(),
                reference: self.base.clone(),
                weighted_at: best.weighted_at.clone(),
                left_out_source: Vec::new(),
                left_out_target: Vec::new(),
                free: self.settings.free.clone(),
                seed: self.settings.seed,
            },
            theta,
            starts,
            iterations,
            evaluations: reports.iter().map(|report| report.evaluations).sum(),
            alternatives: alternatives(&best, others),
            warnings,
            conditioning,
            sampling: statistics.as_ref().map(|_| self.sampling().name()),
            statistics,
            support: None,
            clutter: None,
            refined: false,
            evidence: None,
            undetermined: Vec::new(),
            prior: None,
            stray: [Vec::new(), Vec::new()],
            stages: reports,
            outcome: best.outcome,
        }
    }

    /// Return J, its p-value and the covariance of theta, where the weighting has them.
    fn statistics(&self, best: &Found, ready: &ReadyStage) -> Option<Statistics> {
        let weighted_at = best.weighted_at.as_ref().filter(|_| ready.weighting.has_statistic())?;
        if !best.outcome.usable() || best.problem.whitening().is_none() {
            return None;
        }
        let theta = &best.outcome.theta;
        let found = statistics::of_whitened(&best.problem, theta, best.problem.manifold().tangent())?;
        let mut found = Statistics { kappa: weighted_at.randomness.kappa, ..found };
        if let Some(centred) = &self.centred {
            let here = found.covariance.clone();
            found.covariance = congruent(centred.tangent(), &centred.to_own(theta), &here);
            found.covariance_at_centroid = Some(here);
        }
        Some(found)
    }
}

/// Return the other thetas that solves ended at, best first, each once.
fn alternatives(best: &Found, others: &[Found]) -> Vec<Alternative> {
    let is_new = |theta: &[f64], kept: &[&Found]| {
        let far = |other: &[f64]| theta.iter().zip(other).any(|(a, b)| (a - b).abs() > SAME * b.abs().max(1.0));
        far(&best.outcome.theta) && kept.iter().all(|other| far(&other.outcome.theta))
    };
    let mut kept: Vec<&Found> = Vec::new();
    for other in others.iter().filter(|other| other.outcome.usable()) {
        if is_new(&other.outcome.theta, &kept) {
            kept.push(other);
        }
    }
    let of = |other: &&Found| Alternative {
        theta: other.outcome.theta.clone(),
        cost: other.outcome.cost,
        verdict: other.weighted_at.as_ref().map(|_| Verdict::Suspect),
        relative_likelihood: None,
    };
    kept.iter().map(of).collect()
}
