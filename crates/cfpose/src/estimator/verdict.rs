//! How sure one may be of a candidate, and why not more.

use cfpose_optim::problem::LeastSquares;
use serde::{Deserialize, Serialize};

use super::Parts;
use super::candidate::Candidate;
use super::stage::ReadyStage;
use crate::statistics::{self, Statistics};

/// How sure one may be of an estimate.
///
/// ```
/// use cfpose::Verdict;
/// assert_eq!(Verdict::Suspect.name(), "suspect");
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Verdict {
    /// The statistics agree with the fit.
    Good,
    /// Usable, but the statistics do not agree.
    Suspect,
    /// Not usable.
    Failed,
}

impl Verdict {
    /// Return the name used in JSON.
    pub fn name(self) -> &'static str {
        match self {
            Verdict::Good => "good",
            Verdict::Suspect => "suspect",
            Verdict::Failed => "failed",
        }
    }
}

/// Judge a candidate; `None` where the weighting has no statistic, except for a failure.
pub(super) fn verdict(candidate: &Candidate, stage: &ReadyStage, parts: &Parts) -> Option<Verdict> {
    if !candidate.outcome.usable() {
        return Some(Verdict::Failed);
    }
    candidate.statistics.as_ref()?;
    let good = candidate.accepted && candidate.plausible && reasons(candidate, stage, parts).iter().all(|r| !r.1);
    Some(if good { Verdict::Good } else { Verdict::Suspect })
}

/// Say in words what stands against a candidate; the second of a pair says whether it forbids `good`.
pub(super) fn reasons(candidate: &Candidate, stage: &ReadyStage, parts: &Parts) -> Vec<(String, bool)> {
    let (criteria, mut reasons) = (&parts.criteria, Vec::new());
    if let Some(statistics) = &candidate.statistics {
        let few = stage.fewest_points();
        if !is_informative(few, stage, statistics, criteria.informative) {
            reasons.push((format!("{few} points are too few for the statistics of so many feature means"), true));
        }
        if statistics.p_value < criteria.p_suspect {
            let (j, dof) = (statistics.j_statistic, statistics.degrees_of_freedom);
            reasons.push((format!("the statistics refuse the fit: J = {j:.0} with {dof} degrees of freedom"), true));
        }
        if noise_is_negative(candidate, stage, criteria.noise_negative) {
            reasons
                .push(("the noise that fits best has a negative variance: the misfit is of another kind".into(), true));
        }
    }
    if let Some(support) = &candidate.support {
        if support.coherence > criteria.coherent {
            let share = 100.0 * support.coherence;
            reasons.push((format!("neighbouring points miss the shape together ({share:.0} % of the variance)"), true));
        }
        if support.unexplained_source > criteria.partial {
            let share = 100.0 * support.unexplained_source;
            reasons.push((format!("partial overlap: {share:.0} % of the source has no target near it"), true));
        }
    }
    if let Some(share) = candidate.clutter.filter(|share| *share > 0.0) {
        let text = format!("{:.1} % of the target points are outliers", 100.0 * share);
        reasons.push((text, share > criteria.max_clutter));
    }
    reasons
}

/// Say whether the points outnumber the feature means by far: a handful of points can match any means.
fn is_informative(few: usize, stage: &ReadyStage, statistics: &Statistics, least: f64) -> bool {
    let means = statistics.degrees_of_freedom + stage.problem.manifold().tangent();
    (few * stage.model().dim()) as f64 >= least * means as f64
}

/// Say whether the modelled noise has a variance below zero by more than so many of its standard deviations, along any
/// direction: such a noise is none, it absorbs a misfit.
fn noise_is_negative(candidate: &Candidate, stage: &ReadyStage, deviations: f64) -> bool {
    let (dim, own) = (stage.model().dim(), stage.own());
    let Some(covariance) = candidate.problem.noise().covariance(dim, &candidate.theta[own..]) else { return false };
    let flat: Vec<f64> = (0..dim * dim).map(|at| covariance[at / dim][at % dim]).collect();
    let Some((values, vectors)) = cfpose_optim::linear::symmetric_eigen(dim, &flat) else { return true };
    let least = values.first().copied().unwrap_or(0.0);
    // Along a unit vector v the variance is v'Sv: linear in the nuisance parameters.
    let direction: Vec<f64> = (0..dim).map(|i| vectors[i * dim]).collect();
    let weights = candidate.problem.noise().weights_along(&direction);
    match statistics::deviation_of(&candidate.problem, &candidate.theta, stage.own_tangent(), &weights) {
        Some(deviation) => least < -deviations * deviation,
        None => least < 0.0,
    }
}
