//! Hypotheses from clusters of the target: random sample consensus as the paper proposes it (section V), made precise for
//! sets without correspondences.
//!
//! A subset of Q that is chosen point by point has the same means as Q, outliers and all: it says nothing. Outliers are
//! found where they hang together, so the target is cut into clusters, hypotheses leave some of them out, and each is scored
//! by its J statistic and by nearest-neighbour support among *all* points.

use cfpose_kernel::points::Points;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::Supervision;
use super::engine::{Engine, Hypothesis};
use super::level::Ingredients;
use super::pipeline::{Outliers, Pipeline};
use super::repair::Robust;
use crate::error::Error;

/// Clusters of the target.
const NUM_CLUSTERS: usize = 8;
/// Rounds of k-means.
const ROUNDS: usize = 20;
/// Hypotheses with two clusters left out, besides those with one.
const PAIRS: usize = 8;

/// Return the cluster of each point: k-means from seeded, spread-out centres (k-means++).
fn clusters(points: &Points, count: usize, rng: &mut ChaCha8Rng) -> Vec<usize> {
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

impl Engine<'_> {
    /// Leave clusters out, one by one and in random pairs, and keep the hypothesis of best support.
    pub fn by_clusters(&mut self, supervision: &mut Supervision<'_>) -> Result<Option<Robust>, Error> {
        let mut rng = ChaCha8Rng::seed_from_u64(self.ingredients.settings.seed ^ 0x7261_6e73_6163);
        let label = clusters(self.ingredients.target, NUM_CLUSTERS, &mut rng);
        let mut choices: Vec<[usize; 2]> = (0..NUM_CLUSTERS).map(|c| [c, c]).collect();
        choices.extend((0..PAIRS).map(|_| [rng.random_range(0..NUM_CLUSTERS), rng.random_range(0..NUM_CLUSTERS)]));
        let mut best: Option<(bool, f64, Hypothesis, f64)> = None;
        for left_out in choices {
            let kept: Vec<usize> = (0..label.len()).filter(|k| !left_out.contains(&label[*k])).collect();
            let Ok(target) = self.ingredients.target.select(&kept) else { continue };
            if target.require_spread(3).is_err() {
                continue;
            }
            let ingredients = Ingredients { target: &target, ..self.ingredients };
            let pipeline = Pipeline { outliers: Outliers::None, restarts: 0, ..self.pipeline.clone() };
            let mut engine = Engine::new(ingredients, &pipeline)?;
            let given = engine.given()?;
            let hypotheses = match given.is_empty() {
                true => engine.global(usize::MAX, supervision)?,
                false => engine.climb_given(&given, supervision)?,
            };
            self.absorb(0, &engine);
            let Some(hypothesis) = hypotheses.into_iter().next().filter(|h| h.plausible) else { continue };
            let score = self.last().support(&hypothesis.solved.theta)?.distance();
            let rank = (hypothesis.accepted, score);
            if best.as_ref().is_none_or(|b| (rank.0 && !b.0) || (rank.0 == b.0 && rank.1 < b.1)) {
                let clutter = 1.0 - kept.len() as f64 / label.len() as f64;
                best = Some((rank.0, score, hypothesis, clutter));
            }
        }
        Ok(best.map(|(_, _, hypothesis, clutter)| {
            let sigma = self.last().noise_sigma(&hypothesis.solved.theta).unwrap_or(0.0);
            let covariance = hypothesis.solved.statistics.map_or_else(Vec::new, |s| s.covariance);
            Robust { theta: hypothesis.solved.theta, sigma, covariance, clutter }
        }))
    }
}
