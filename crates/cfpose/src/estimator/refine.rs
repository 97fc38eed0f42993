//! Refinement by closest points: taken only where the sampling is independent and the evidence says that it gains.

use super::Parts;
use super::candidate::{Candidate, PointFit};
use super::pipeline::Pipeline;
use super::stage::ReadyStage;
use crate::distances::sampling::Sampling;
use crate::distances::support::Support;
use crate::error::Error;

/// Refine a candidate where that gains.
///
/// Means of features see every point with its noise averaged; closest points see the shape between the points. Where both sets
/// are the same points under noise, the nearest point is not the true partner, and the refinement is biased: it is never
/// tried there, nor on lattices, which it locks onto. Elsewhere it is taken when
/// 1. the noise along the normals does not change who is nearest, or is small against the shape;
/// 2. the log likelihood of the distances along the normals does not fall: its maximum is the better estimate of independent
///    samples, and a loss says that the closest points locked onto something else;
/// 3. the distances between the points do not grow.
///
/// The covariances of both estimates do not decide: that of means is too small for few independent points.
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
    if fit.gain() < parts.criteria.refine_nats {
        return Ok(());
    }
    let mut fit = PointFit::of(fit, "closest points");
    // The scatter of the residuals is that of one sampling; where there are two, both move the estimate.
    let samplings = if candidate.sampling == Some(Sampling::Independent) { 2.0 } else { 1.0 };
    fit.covariance.iter_mut().for_each(|value| *value *= samplings);
    fit.sigma = support.normal_sigma;
    candidate.take(&fit);
    candidate.support = Some(support);
    candidate.refined = true;
    Ok(())
}

/// Say whether the refined support is no worse than before; below the spacing, distances between points do not rank thetas.
fn is_close(support: &Support, before: &Support) -> bool {
    support.target_rms <= (1.001 * before.target_rms).max(before.source_spacing)
}

/// Say whether a side is a lattice: most nearest distances are equal.
fn is_lattice(stage: &ReadyStage, parts: &Parts) -> bool {
    let share = |share: f64| share > parts.criteria.lattice;
    share(stage.target_tree().equal_spacing_share()) || share(stage.source_spacing_share())
}
