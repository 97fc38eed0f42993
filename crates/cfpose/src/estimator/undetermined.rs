//! Directions of theta that the data do not determine: turns of a body of revolution, shifts of a plane in itself
//! (docs/method.md, *Undetermined directions*).
//!
//! A sample is rough, so its likelihood has a curvature along every direction, and small steps find it. What counts is the
//! smoothed likelihood, and what lies far away: with the noise as wide as the distances between the points, a direction with
//! little information is walked along, far, all other parameters following while it is held, and the data are asked whether they
//! can tell: a profile of the likelihood.

use super::modes::{Behind, behind};
use super::search::Search;
use crate::distances::likelihood::{Fit, Kernel, PointsLikelihood};
use crate::geometry::linalg::symmetric_eigen_any;
use serde::{Deserialize, Serialize};

/// A direction of theta that the data do not determine.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Undetermined {
    /// Unit vector of tangent coordinates, lengths in sizes of the source.
    pub direction: Vec<f64>,
    /// The same in words.
    pub words: String,
}

/// How far a direction is walked: radians, sizes of the source.
const FAR: [f64; 4] = [0.35, -0.35, 0.9, -0.9];
/// Steps of the other parameters at its end.
const STEPS: usize = 8;
/// Deviations by which the largest of some twenty independent maxima leads an average place: so many fit about a whole turn.
const LEAD: f64 = 2.0;
/// So many of the walks may fail.
const MAY_FAIL: usize = 1;
/// A walk counts that ends at least at this share of its distance.
const STAYED: f64 = 0.5;

/// Set the variances and covariances of what is not determined to NaN: they are not small.
pub(super) fn without(undetermined: &[Undetermined], covariance: &mut [f64]) {
    for direction in undetermined.iter().map(|found| &found.direction) {
        let n = direction.len();
        if covariance.len() == n * n {
            for at in 0..n * n {
                if direction[at / n].abs().max(direction[at % n].abs()) > 0.2 {
                    covariance[at] = f64::NAN;
                }
            }
        }
    }
}

impl Search<'_> {
    /// Return the directions that are not determined at a fit, weakest first; `several` says that the data know several modes.
    pub fn undetermined(&self, fine: &PointsLikelihood<'_>, fit: &Fit, several: bool) -> Vec<Undetermined> {
        let Some(information) = fine.smooth_information(&fit.theta, &fit.mixture) else { return Vec::new() };
        let scales = self.scales(&fit.theta);
        let n = scales.len();
        // By descending information.
        let (values, vectors) = symmetric_eigen_any(n, |i, j| information[i * n + j] * scales[i] * scales[j]);
        let mut found = Vec::new();
        for (value, vector) in values.iter().zip(&vectors).rev() {
            // The deviation that the smoothed likelihood lets expect.
            let deviation = value.max(1e-12).sqrt().recip();
            let is_weak = several || deviation > self.parts.criteria.weak;
            if !is_weak || !self.can_walk(fine, fit, vector, &scales, several) {
                break;
            }
            found.push(Undetermined { direction: vector.clone(), words: self.words(vector) });
        }
        found
    }

    /// Say whether most walks along a direction end far away, at thetas that the data cannot tell from the fit.
    fn can_walk(&self, fine: &PointsLikelihood<'_>, fit: &Fit, vector: &[f64], scales: &[f64], several: bool) -> bool {
        // The component along the direction, as a form of the unscaled tangent.
        let held: Vec<f64> = vector.iter().zip(scales).map(|(v, scale)| v / scale).collect();
        let is_far = |end: &Fit, far: f64| {
            self.apart(&fit.theta, &end.theta) > STAYED * far.abs() && self.is_plausible(&end.theta)
        };
        let criteria = &self.parts.criteria;
        // The best of several rough maxima leads a place between them by chance.
        let chance = if several { LEAD } else { 0.0 };
        let is_equal = |there: Behind| Behind { deviations: there.deviations - chance, ..there }.is_equal(criteria);
        let walk = |far: f64| {
            let step: Vec<f64> = vector.iter().zip(scales).map(|(v, scale)| far * v * scale).collect();
            let begin = fine.mover.retract(&fit.theta, &step);
            let Some(beside) = fine.ascend_beside(&begin, Kernel::Shape, STEPS, &held) else { return false };
            let there = behind(fine, fit, &beside);
            if is_equal(there) {
                return is_far(&beside, far);
            }
            // A sample is rough: a little farther on it may do better.
            let end = there
                .may_be_equal(criteria)
                .then(|| fine.ascend(&beside.theta, Kernel::Shape, STEPS, f64::NEG_INFINITY));
            end.flatten().is_some_and(|end| is_equal(behind(fine, fit, &end)) && is_far(&end, far))
        };
        let mut left = MAY_FAIL + 1;
        FAR.into_iter().all(|far| {
            left -= usize::from(!walk(far));
            left > 0
        })
    }

    /// Name the parameters that a direction moves.
    fn words(&self, vector: &[f64]) -> String {
        let layout = &self.last().model().layout;
        let free = self.parts.settings.free.as_deref();
        let mut names = Vec::new();
        let mut at = 0;
        for block in layout.blocks() {
            let len = cfpose_optim::manifold::Manifold::tangent(block.kind.manifold().as_ref());
            let of_block = |j: usize| {
                let column = free.map_or(Some(j), |free| free.iter().position(|f| *f == j));
                column.and_then(|column| vector.get(column)).copied().unwrap_or(0.0)
            };
            let part: Vec<f64> = (at..at + len).map(of_block).collect();
            let size = part.iter().map(|v| v * v).sum::<f64>().sqrt();
            if size > 0.3 {
                let along: Vec<String> = part.iter().map(|v| format!("{:.2}", v / size)).collect();
                let verb = if block.name == "rotation" { "turns about" } else { "changes of" };
                names.push(match (block.name, len) {
                    ("rotation", _) => format!("{verb} ({})", along.join(", ")),
                    (name, 1) => format!("{verb} {name}"),
                    (name, _) => format!("{verb} {name} along ({})", along.join(", ")),
                });
            }
            at += len;
        }
        format!("{} are not determined", if names.is_empty() { "small changes".into() } else { names.join(" with ") })
    }
}
