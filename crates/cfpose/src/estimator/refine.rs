//! Refinement by closest points: taken only where the sampling is independent and the evidence says that it gains.

use super::Parts;
use super::candidate::{Candidate, PointFit};
use super::pipeline::Pipeline;
use super::stage::ReadyStage;
use crate::distances::sampling::Sampling;
use crate::distances::support::Support;
use crate::error::Error;
use crate::statistics::chi_square_tail;

/// Refine a candidate where that gains.
///
/// Means of features see every point with its noise averaged; closest points see the shape between the points. Where both sets
/// are the same points under noise, the nearest point is not the true partner, and the refinement is biased: it is never
/// tried there, nor on lattices, which it locks onto. Elsewhere it is taken when
/// 1. the noise along the normals does not change who is nearest, or is small against the shape;
/// 2. its own covariance is not larger than that of the means, direction by direction;
/// 3. J of the weighted problem at the refined theta stays within its chi-square.
pub(super) fn refine(
    candidate: &mut Candidate,
    stage: &ReadyStage,
    pipeline: &Pipeline,
    parts: &Parts,
) -> Result<(), Error> {
    let wanted = candidate.outcome.usable() && pipeline.refine_below > 0.0;
    let Some(before) = candidate.support.filter(|_| wanted && candidate.sampling != Some(Sampling::Same)) else {
        return Ok(());
    };
    let criteria = &parts.criteria;
    let limit = (pipeline.refine_below * stage.unit()).max(criteria.refine_spacing * before.source_spacing);
    if before.normal_sigma > criteria.refine_nearly * limit || is_lattice(stage, parts) {
        return Ok(());
    }
    let Some(fit) = stage.by_closest_points(&candidate.theta, parts) else { return Ok(()) };
    let support = stage.support(&fit.theta)?;
    // A pose that is still off adds its misfit to the noise, so the limit is asked again.
    if support.normal_sigma > limit || !is_close(&support, &before) {
        return Ok(());
    }
    let mut refined = candidate.clone();
    let mut fit = PointFit::of(fit, "closest points");
    // The scatter of the residuals is that of one sampling; where there are two, both move the estimate.
    let samplings = if candidate.sampling == Some(Sampling::Independent) { 2.0 } else { 1.0 };
    fit.covariance.iter_mut().for_each(|value| *value *= samplings);
    fit.sigma = support.normal_sigma;
    refined.take(&fit);
    if gains(candidate, &refined, parts) {
        refined.support = Some(support);
        refined.refined = true;
        *candidate = refined;
    }
    Ok(())
}

/// Say whether the refined support is no worse than before; below the spacing, distances between points do not rank thetas.
fn is_close(support: &Support, before: &Support) -> bool {
    support.target_rms <= (1.001 * before.target_rms).max(before.source_spacing)
}

/// Say whether the refined covariance is smaller and the means do not refuse the refined theta.
fn gains(before: &Candidate, refined: &Candidate, parts: &Parts) -> bool {
    let (Some(old), Some(new)) = (&before.statistics, &refined.statistics) else { return true };
    let n = (old.covariance.len() as f64).sqrt() as usize;
    // The mean of log ratios of deviations does not depend on the units of theta.
    let ratio = |j: usize| (new.covariance[j * n + j] / old.covariance[j * n + j]).max(1e-300).ln();
    let mean = (0..n).map(ratio).sum::<f64>() / (2 * n.max(1)) as f64;
    let smaller = mean.exp() <= parts.criteria.refine_gain;
    // J may grow by what the covariance of the means allows: a chi-square of the number of parameters.
    let grown = (new.j_statistic - old.j_statistic).max(0.0);
    smaller && chi_square_tail(grown, n) >= parts.criteria.p_suspect
}

/// Say whether a side is a lattice: most nearest distances are equal.
fn is_lattice(stage: &ReadyStage, parts: &Parts) -> bool {
    let share = |share: f64| share > parts.criteria.lattice;
    share(stage.target_tree().equal_spacing_share()) || share(stage.source_spacing_share())
}
