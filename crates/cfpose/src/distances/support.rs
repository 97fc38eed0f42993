//! Nearest-neighbour support: does the mapped source lie on the target, everywhere and on both sides?
//!
//! Feature means alone can agree by a noise estimate that swallows the misfit. Distances cannot: where a pose is wrong,
//! neighbouring points miss the shape in the same direction.

use cfpose_kernel::points::Points;

use super::normals::Normals;
use super::regions;
use crate::distances::neighbours::Neighbours;

/// Points of each side that are asked, at most.
const MAX_QUERIES: usize = 1000;
/// Points whose normals are fitted, at most.
const MAX_NORMALS: usize = 400;

/// Regions that coherent residuals are looked for in, at most; each has at least this many points.
const MAX_REGIONS: usize = 32;
const MIN_REGION: usize = 12;

/// How well two sets in one space lie on each other.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Support {
    /// Root mean square distance of target points to the nearest mapped source point, the farthest tenth left out.
    pub target_rms: f64,
    /// The same from mapped source points to the target.
    pub source_rms: f64,
    /// Robust standard deviation of the target's distances along the normals of the mapped source: the noise, however the
    /// two sets were sampled. Equal to `target_rms` where the source has no normals.
    pub normal_sigma: f64,
    /// Share of target points whose nearest source point has them for its own nearest target point: nearly all for the same
    /// points with small noise, about half for independent samples.
    pub mutual: f64,
    /// Median distance of a target point to the nearest mapped source point.
    pub median: f64,
    /// Median distance between neighbours of the mapped source.
    pub source_spacing: f64,
    /// Median distance between neighbours of the target.
    pub target_spacing: f64,
    /// Share of the residuals' variance that neighbouring residuals have in common, 0 to 1: noise gives about 0, a misplaced
    /// shape nearly 1.
    pub coherence: f64,
    /// Share of the target points that no mapped source point explains.
    pub unexplained_target: f64,
    /// Share of the mapped source points that no target point explains.
    pub unexplained_source: f64,
}

impl Support {
    /// Compare the mapped source with the target, both in the feature space; `noise_sigma` is the standard deviation of the
    /// target's noise in one coordinate, where it is known.
    ///
    /// ```
    /// use cfpose::{Points, distances::Support};
    /// let line = |y: f64| (0..200).map(|k| [f64::from(k) * 0.01, y]).collect::<Vec<_>>();
    /// let (p, q) = (Points::from_rows(&line(0.0)).unwrap(), Points::from_rows(&line(0.2)).unwrap());
    /// let support = Support::of(&p, &q, None);
    /// assert!(support.coherence > 0.9 && (support.target_rms - 0.2).abs() < 1e-9);
    /// assert_eq!(Support::of(&p, &p, None).unexplained_source, 0.0);
    /// ```
    pub fn of(source: &Points, target: &Points, noise_sigma: Option<f64>) -> Self {
        Self::against(source, &Neighbours::new(target.rows(), target.dim()), noise_sigma)
    }

    /// Compare as [`Support::of`] with a target whose search structure stands already.
    pub(crate) fn against(source: &Points, on_target: &Neighbours, noise_sigma: Option<f64>) -> Self {
        let on_source = Neighbours::new(source.rows(), on_target.dim());
        let asked_target = residuals(on_target.rows(), &on_source, MAX_QUERIES);
        let asked_source = residuals(on_source.rows(), on_target, MAX_QUERIES);
        let (source_spacing, target_spacing) = (on_source.spacing(), on_target.spacing());
        let lengths = |asked: &[Residual]| {
            let mut lengths: Vec<f64> = asked.iter().map(|r| r.length).collect();
            lengths.sort_by(f64::total_cmp);
            lengths
        };
        let (target_lengths, source_lengths) = (lengths(&asked_target), lengths(&asked_source));
        // A point is explained within four standard deviations, or within the reach of a few neighbours.
        let noise = noise_sigma.unwrap_or(0.0);
        let reach = |spacing: f64| (4.0 * noise).max(5.0 * spacing);
        let beyond = |sorted: &[f64], reach: f64| {
            sorted.iter().filter(|d| **d > reach).count() as f64 / sorted.len().max(1) as f64
        };
        Self {
            target_rms: trimmed_rms(&target_lengths),
            source_rms: trimmed_rms(&source_lengths),
            normal_sigma: normal_sigma(&asked_target, &on_source).unwrap_or_else(|| trimmed_rms(&target_lengths)),
            mutual: mutual(&asked_target, on_target),
            median: target_lengths.get(target_lengths.len() / 2).copied().unwrap_or(0.0),
            source_spacing,
            target_spacing,
            coherence: coherence(&asked_target, trim_limit(&target_lengths), source_spacing),
            unexplained_target: beyond(&target_lengths, reach(source_spacing)),
            unexplained_source: beyond(&source_lengths, reach(target_spacing)),
        }
    }

    /// Return one number to rank hypotheses by: the distance in both directions.
    pub fn distance(&self) -> f64 {
        self.target_rms.hypot(self.source_rms)
    }
}

/// A point, its nearest neighbour's position, and the vector from there to the point.
struct Residual {
    point: [f64; 3],
    index: usize,
    foot: [f64; 3],
    vector: [f64; 3],
    length: f64,
}

/// Ask evenly spaced points for their nearest neighbours.
fn residuals(points: &[[f64; 3]], tree: &Neighbours, limit: usize) -> Vec<Residual> {
    let step = points.len().div_ceil(limit);
    let ask = |p: &[f64; 3]| {
        let found = tree.nearest(p);
        let foot = tree.rows()[found.index];
        Residual {
            point: *p,
            index: found.index,
            foot,
            vector: std::array::from_fn(|d| p[d] - foot[d]),
            length: found.squared.sqrt(),
        }
    };
    points.iter().step_by(step).map(ask).collect()
}

/// Return 1.48 times the median distance along the normals, `None` where few points have one.
fn normal_sigma(asked: &[Residual], tree: &Neighbours) -> Option<f64> {
    let mut normals = Normals::new(tree.rows().len());
    let step = asked.len().div_ceil(MAX_NORMALS);
    let chosen: Vec<&Residual> = asked.iter().step_by(step).collect();
    let along = |r: &&Residual| {
        let normal = normals.at(r.index, tree, tree.rows())?;
        Some((0..3).map(|d| normal[d] * r.vector[d]).sum::<f64>().abs())
    };
    let mut distances: Vec<f64> = chosen.iter().filter_map(along).collect();
    distances.sort_by(f64::total_cmp);
    (2 * distances.len() > chosen.len()).then(|| 1.4826 * distances[distances.len() / 2])
}

/// Return the share of points that are the nearest ones of their nearest ones.
fn mutual(asked: &[Residual], on_target: &Neighbours) -> f64 {
    let step = asked.len().div_ceil(MAX_NORMALS);
    let chosen: Vec<&Residual> = asked.iter().step_by(step).collect();
    let back = |r: &&&Residual| on_target.rows()[on_target.nearest(&r.foot).index] == r.point;
    chosen.iter().filter(back).count() as f64 / chosen.len() as f64
}

/// Return the length below which nine of ten residuals lie.
fn trim_limit(sorted: &[f64]) -> f64 {
    sorted.get(sorted.len() * 9 / 10).or(sorted.last()).copied().unwrap_or(0.0)
}

fn trimmed_rms(sorted: &[f64]) -> f64 {
    let kept = &sorted[..(sorted.len() * 9 / 10).max(1).min(sorted.len())];
    (kept.iter().map(|d| d * d).sum::<f64>() / kept.len().max(1) as f64).sqrt()
}

/// Return the share of the residuals' mean square that region means explain, corrected for chance.
///
/// Regions are groups of neighbouring feet, found by median splits. Residuals below the spacing of the source are
/// its discretisation and count as explained by chance.
fn coherence(asked: &[Residual], limit: f64, spacing: f64) -> f64 {
    let mut kept: Vec<&Residual> = asked.iter().filter(|r| r.length <= limit).collect();
    let total: f64 = kept.iter().map(|r| r.length * r.length).sum();
    let count = kept.len();
    let num_regions = 1_usize << (count / MIN_REGION).clamp(1, MAX_REGIONS).ilog2();
    let floor = count as f64 * spacing * spacing;
    if num_regions < 2 || total <= floor {
        return 0.0;
    }
    let depth = num_regions.trailing_zeros();
    let mut common = 0.0;
    regions(&mut kept, depth, &|r: &&Residual| r.foot, &mut |group| {
        for d in 0..3 {
            let sum: f64 = group.iter().map(|r| r.vector[d]).sum();
            common += sum * sum / group.len() as f64;
        }
    });
    let chance = num_regions as f64 / count as f64;
    let share = (common / total - chance) / (1.0 - chance);
    (share * (1.0 - floor / total)).clamp(0.0, 1.0)
}
