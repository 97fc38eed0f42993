//! How sure one may be of a candidate, and why not more.

use cfpose_optim::problem::LeastSquares;
use serde::{Deserialize, Serialize};

use super::Parts;
use super::candidate::{By, Candidate};
use super::stage::ReadyStage;
use crate::criteria::Criteria;
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
    /// One theta explains the data, and what is reported about it can be relied on.
    Good,
    /// Usable, but several thetas, or a whole direction, explain the data equally well: see the alternatives and what is undetermined.
    Ambiguous,
    /// Usable, but the data do not support it as they should.
    Suspect,
    /// Not usable.
    Failed,
}

impl Verdict {
    /// Return the name used in JSON.
    pub fn name(self) -> &'static str {
        match self {
            Verdict::Good => "good",
            Verdict::Ambiguous => "ambiguous",
            Verdict::Suspect => "suspect",
            Verdict::Failed => "failed",
        }
    }
}

/// What a reason against a candidate forbids.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Weight {
    /// Nothing: it is said, no more.
    Note,
    /// `good`: the answer is one of several.
    Several,
    /// `good` and `ambiguous`.
    Doubt,
}

/// Judge a candidate; `None` where there is neither a statistic nor a likelihood, except for a failure.
pub(super) fn verdict(candidate: &Candidate, stage: &ReadyStage, parts: &Parts) -> Option<Verdict> {
    if !candidate.outcome.usable() {
        return Some(Verdict::Failed);
    }
    if candidate.outcome.status.is_interruption() {
        return Some(Verdict::Suspect);
    }
    if candidate.evidence.is_none() {
        candidate.statistics.as_ref()?;
    }
    let reasons = reasons(candidate, stage, parts);
    let has = |weight: Weight| reasons.iter().any(|reason| reason.1 == weight);
    let accepted = candidate.evidence.is_some() || candidate.accepted;
    Some(match () {
        () if !accepted || !candidate.plausible || has(Weight::Doubt) => Verdict::Suspect,
        () if has(Weight::Several) => Verdict::Ambiguous,
        () => Verdict::Good,
    })
}

/// Say in words what stands against a candidate, and what that forbids.
pub(super) fn reasons(candidate: &Candidate, stage: &ReadyStage, parts: &Parts) -> Vec<(String, Weight)> {
    let mut reasons = by_points(candidate, &parts.criteria);
    if candidate.by == By::Moments {
        reasons.extend(by_means(candidate, stage, &parts.criteria));
    }
    reasons.extend(beforehand(candidate, stage, parts));
    if let Some(share) = candidate.clutter.filter(|share| *share > 0.0) {
        let text = format!("{:.1} % of the target points are outliers", 100.0 * share);
        let unexplained = candidate.unexplained.unwrap_or(share);
        reasons.push((text, if unexplained > parts.criteria.max_clutter { Weight::Doubt } else { Weight::Note }));
    }
    reasons
}

/// What was known beforehand has against a candidate.
fn beforehand(candidate: &Candidate, stage: &ReadyStage, parts: &Parts) -> Vec<(String, Weight)> {
    let mut reasons = Vec::new();
    if let Some(report) = candidate.prior.filter(|report| !report.used) {
        let (square, dof) = (report.chi_square, report.degrees_of_freedom);
        let text = format!(
            "the prior disagrees with the data (chi-square {square:.0}, {dof} degrees of freedom) and is left out"
        );
        reasons.push((text, Weight::Doubt));
    }
    if parts.prior.is_some() && candidate.prior.is_none() {
        let text = "the prior is left out: this fit has no covariance to weigh it against (`auto` has one)";
        reasons.push((text.to_string(), Weight::Doubt));
    }
    let bounds = parts.bounds.as_ref();
    for name in bounds.map(|bounds| bounds.reached(&candidate.theta[..stage.own()])).unwrap_or_default() {
        reasons.push((format!("{name} ends at its bound: the data may ask for a value beyond"), Weight::Doubt));
    }
    reasons
}

/// What the likelihood of the points has against a candidate.
fn by_points(candidate: &Candidate, criteria: &Criteria) -> Vec<(String, Weight)> {
    let Some(evidence) = &candidate.evidence else { return Vec::new() };
    let mut reasons = Vec::new();
    if evidence.log10_false_alarms > criteria.false_alarms {
        let number = evidence.log10_false_alarms;
        reasons.push((
            format!("chance would do as well: 10^{number:.1} such thetas are expected among unrelated points"),
            Weight::Doubt,
        ));
    }
    let deviation = candidate.deviation.unwrap_or(evidence.deviation);
    if candidate.undetermined.is_empty() && (deviation.is_nan() || deviation > criteria.deviation) {
        let text = format!("the points determine theta to {deviation:.3} only (radians and sizes of the source)");
        reasons.push((text, Weight::Doubt));
    }
    if criteria.is_doubtful(evidence.coherence, evidence.noise) {
        let share = 100.0 * evidence.coherence;
        let text =
            format!("neighbouring points miss the shape together ({share:.0} % of the variance of their distances)");
        reasons.push((text, Weight::Doubt));
    }
    if evidence.noise > criteria.most_noise {
        let noise = 100.0 * evidence.noise;
        let text = format!("a noise of {noise:.0} % of the size: shapes that differ by less would fit as well");
        reasons.push((text, Weight::Doubt));
    }
    if evidence.unseen_source > criteria.unseen {
        let share = 100.0 * evidence.unseen_source;
        let weight = if evidence.is_part_enough(criteria) { Weight::Note } else { Weight::Doubt };
        reasons.push((format!("partial overlap: {share:.0} % of the source has no target near it"), weight));
    }
    // Target points that another theta explains, which is as good, are no outliers.
    let unexplained = candidate.unexplained.unwrap_or(evidence.unseen_target);
    // The means of the same points see a missing part in J.
    if candidate.by == By::Points && unexplained > criteria.unseen && evidence.noise > criteria.lacking_noise {
        let (share, noise) = (100.0 * unexplained, 100.0 * evidence.noise);
        let text = format!(
            "{share:.0} % of the target are outliers or a part that the source lacks: a noise of {noise:.1} % of the size hides where it ends"
        );
        reasons.push((text, Weight::Doubt));
    }
    if evidence.unseen_target > criteria.max_clutter && candidate.clutter.is_none() {
        let share = 100.0 * evidence.unseen_target;
        let weight = if unexplained > criteria.max_clutter { Weight::Doubt } else { Weight::Note };
        reasons.push((format!("{share:.0} % of the target points are outliers"), weight));
    }
    let equal = candidate.modes.iter().filter(|mode| mode.behind.is_equal(criteria)).count();
    if equal > 0 {
        let text = format!("{equal} other theta explain(s) the points as well: see the alternatives");
        reasons.push((text, Weight::Several));
    }
    reasons.extend(candidate.undetermined.iter().map(|found| (found.words.clone(), Weight::Several)));
    reasons
}

/// What the means have against a candidate that they are the answer of.
fn by_means(candidate: &Candidate, stage: &ReadyStage, criteria: &Criteria) -> Vec<(String, Weight)> {
    let Some(statistics) = &candidate.statistics else { return Vec::new() };
    let mut reasons = Vec::new();
    let few = stage.fewest_points();
    if candidate.evidence.is_none() && !is_informative(few, stage, statistics, criteria.informative) {
        reasons.push((format!("{few} points are too few for the statistics of so many feature means"), Weight::Doubt));
    }
    if statistics.p_value < criteria.p_suspect {
        let (j, dof) = (statistics.j_statistic, statistics.degrees_of_freedom);
        let text = format!("the statistics refuse the fit: J = {j:.0} with {dof} degrees of freedom");
        reasons.push((text, Weight::Doubt));
    }
    if noise_is_negative(candidate, stage, criteria.noise_negative) {
        let text = "the noise that fits best has a negative variance: the misfit is of another kind";
        reasons.push((text.to_string(), Weight::Doubt));
    }
    if let Some(support) = candidate.support.filter(|_| candidate.evidence.is_none()) {
        if support.coherence > criteria.coherent {
            let share = 100.0 * support.coherence;
            let text = format!("neighbouring points miss the shape together ({share:.0} % of the variance)");
            reasons.push((text, Weight::Doubt));
        }
        if support.unexplained_source > criteria.partial {
            let share = 100.0 * support.unexplained_source;
            let text = format!("partial overlap: {share:.0} % of the source has no target near it");
            reasons.push((text, Weight::Doubt));
        }
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
