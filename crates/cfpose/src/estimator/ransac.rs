//! Hypotheses from clusters of the target: random sample consensus as the paper proposes it (section V), made precise for
//! sets without correspondences.
//!
//! A subset of Q that is chosen point by point has the same means as Q, outliers and all: it says nothing. Outliers are
//! found where they hang together, so the target is cut into clusters, hypotheses leave some of them out, and each is scored
//! by its J statistic and by nearest-neighbour support among *all* points.

use rand::RngExt;
use rand_chacha::ChaCha12Rng;

use super::Watch;
use super::candidate::{Candidate, PointFit};
use super::pipeline::{Outliers, Pipeline};
use super::search::{Search, Stages};
use crate::error::Error;
use crate::streams::stream;
use cfpose_kernel::points::Points;

/// Rounds of k-means.
const ROUNDS: usize = 20;

/// Return the cluster of each point: k-means from seeded, spread-out centres (k-means++).
fn clusters(points: &Points, count: usize, rng: &mut ChaCha12Rng) -> Vec<usize> {
    let rows: Vec<[f64; 3]> = (0..points.len()).map(|k| points.point(k)).collect();
    let squared = |a: &[f64; 3], b: &[f64; 3]| (0..3).map(|d| (a[d] - b[d]).powi(2)).sum::<f64>();
    let mut centres = vec![rows[rng.random_range(0..rows.len())]];
    while centres.len() < count {
        let nearest = |p: &[f64; 3]| centres.iter().map(|c| squared(p, c)).fold(f64::INFINITY, f64::min);
        let weights: Vec<f64> = rows.iter().map(nearest).collect();
        let mut left = rng.random::<f64>() * weights.iter().sum::<f64>();
        let chosen = weights.iter().position(|w| {
            left -= w;
            left <= 0.0
        });
        centres.push(rows[chosen.unwrap_or(rows.len() - 1)]);
    }
    let mut label = vec![0; rows.len()];
    for _ in 0..ROUNDS {
        for (k, p) in rows.iter().enumerate() {
            let best = (0..count).min_by(|a, b| squared(p, &centres[*a]).total_cmp(&squared(p, &centres[*b])));
            label[k] = best.unwrap_or(0);
        }
        for (c, centre) in centres.iter_mut().enumerate() {
            let members: Vec<&[f64; 3]> = rows.iter().zip(&label).filter(|(_, l)| **l == c).map(|(p, _)| p).collect();
            if !members.is_empty() {
                *centre = std::array::from_fn(|d| members.iter().map(|p| p[d]).sum::<f64>() / members.len() as f64);
            }
        }
    }
    label
}

impl Search<'_> {
    /// Leave clusters of the target out in turn, climb on the rest, and keep the pose that explains all points best.
    pub fn by_clusters(&mut self, watch: &mut Watch<'_>) -> Result<Option<PointFit>, Error> {
        let (count, pairs) = (self.parts.criteria.clusters.max(2), self.parts.criteria.cluster_pairs);
        let mut rng = stream(self.parts.settings.seed, "ransac");
        let label = clusters(&self.stages.data.target, count, &mut rng);
        let mut choices: Vec<[usize; 2]> = (0..count).map(|c| [c, c]).collect();
        choices.extend((0..pairs).map(|_| [rng.random_range(0..count), rng.random_range(0..count)]));
        let mut best: Option<(bool, f64, Candidate)> = None;
        for left_out in choices {
            if self.interrupt.is_raised() {
                break;
            }
            let kept: Vec<usize> = (0..label.len()).filter(|k| !left_out.contains(&label[*k])).collect();
            let Ok(data) = self.stages.data.keep(None, Some(&kept)) else { continue };
            if data.target.require_spread(3).is_err() {
                continue;
            }
            let stages = Stages::new(self.parts, data, self.pipeline, 0)?;
            let pipeline = Pipeline { outliers: Outliers::None, restarts: 0, ..self.pipeline.clone() };
            let mut search = Search::new(self.parts, &pipeline, &stages, self.interrupt);
            let given = search.given()?;
            let found = match given.is_empty() {
                true => search.global(usize::MAX, watch)?,
                false => search.climb_given(&given, watch)?,
            };
            self.absorb(0, &search);
            let Some(candidate) = found.into_iter().next().filter(|c| c.plausible) else { continue };
            let score = self.last().support(&candidate.theta)?.distance();
            let rank = (candidate.accepted, score);
            if best.as_ref().is_none_or(|b| (rank.0 && !b.0) || (rank.0 == b.0 && rank.1 < b.1)) {
                best = Some((rank.0, score, candidate));
            }
        }
        Ok(best.map(|(_, _, candidate)| PointFit {
            sigma: self.last().noise_sigma(&candidate.theta).unwrap_or(0.0),
            covariance: candidate.statistics.map_or_else(Vec::new, |s| s.covariance),
            message: candidate.outcome.message,
            converged: candidate.outcome.status.converged(),
            theta: candidate.theta,
        }))
    }
}
