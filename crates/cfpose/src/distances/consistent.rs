//! Rigid motions that many of uncertain matches agree on.
//!
//! Source: Chen, Sun, Yang, Tao, SC2-PCR: a second order spatial compatibility for efficient and robust point cloud registration, CVPR
//! (2022). Different here: compatibility also asks the normals, and is a bit, so that the second order is a count of common bits.

use cfpose_optim::manifold::rotation_of_quaternion;

use crate::distances::spin::SpinImage;
use crate::geometry::linalg::symmetric_eigen_any;

/// A region of the source that may be a region of the target.
pub(crate) struct Match<'a> {
    /// Region of the source.
    pub from: &'a SpinImage,
    /// Region of the target.
    pub to: &'a SpinImage,
}

/// Distances of one pair of regions that agree within this share of the size may be one distance.
const SAME_LENGTH: f64 = 0.08;
/// Cosines between normals and directions that agree within this may be one angle.
const SAME_COSINE: f64 = 0.3;
/// Regions that are closer than this share of the size say little about a pose.
const NEAR: f64 = 0.25;
/// Matches whose companions are looked at, companions a pose is first fitted to, and the least that explain one.
const SEEDS: usize = 120;
const FIRST: usize = 12;
const LEAST: usize = 5;
/// Poses closer than this angle (radians) are one.
const ONE_POSE: f64 = 0.2;

/// A rotation, row by row, and a translation.
type Motion = (Vec<f64>, Vec<f64>);

/// Return at most `keep` motions that differ, those that explain most matches first; `size` is that of the shape.
pub(crate) fn agreed(matches: &[Match<'_>], dim: usize, size: f64, keep: usize) -> Vec<Motion> {
    let compatible = Compatible::new(matches, size);
    let mut by_degree: Vec<(usize, usize)> = (0..matches.len()).map(|i| (compatible.degree(i), i)).collect();
    by_degree.sort_by(|a, b| b.0.cmp(&a.0).then(a.1.cmp(&b.1)));
    let mut found: Vec<(usize, Motion)> = Vec::new();
    for (_, seed) in by_degree.into_iter().take(SEEDS) {
        let mut chosen = compatible.companions(seed, FIRST);
        chosen.push(seed);
        let Some(mut motion) = fit(matches, &chosen, dim) else { continue };
        let mut explained = Vec::new();
        for _ in 0..3 {
            explained = explained_by(matches, &motion, dim, SAME_LENGTH * size);
            let Some(better) = fit(matches, &explained, dim) else { break };
            motion = better;
        }
        if explained.len() >= LEAST {
            found.push((explained.len(), motion));
        }
    }
    found.sort_by_key(|(count, _)| std::cmp::Reverse(*count));
    let limit = 4.0 * (1.0 - ONE_POSE.cos());
    let mut kept: Vec<Motion> = Vec::new();
    for (_, motion) in found {
        let differs = |other: &Motion| {
            let turned = other.0.iter().zip(&motion.0).map(|(a, b)| (a - b).powi(2)).sum::<f64>() > limit;
            let moved =
                other.1.iter().zip(&motion.1).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt() > ONE_POSE * size;
            turned || moved
        };
        if kept.len() < keep && kept.iter().all(differs) {
            kept.push(motion);
        }
    }
    kept
}

/// Which pairs of matches one rigid motion can explain, a bit each.
struct Compatible {
    rows: Vec<Vec<u64>>,
}

impl Compatible {
    fn new(matches: &[Match<'_>], size: f64) -> Self {
        let count = matches.len();
        let mut rows = vec![vec![0_u64; count.div_ceil(64)]; count];
        for i in 0..count {
            for k in 0..i {
                if are_compatible(&matches[i], &matches[k], size) {
                    rows[i][k / 64] |= 1 << (k % 64);
                    rows[k][i / 64] |= 1 << (i % 64);
                }
            }
        }
        Self { rows }
    }

    fn degree(&self, i: usize) -> usize {
        self.rows[i].iter().map(|word| word.count_ones() as usize).sum()
    }

    /// Return the matches that are compatible with one and have most compatible matches in common with it.
    fn companions(&self, i: usize, count: usize) -> Vec<usize> {
        let common =
            |k: usize| -> u32 { self.rows[i].iter().zip(&self.rows[k]).map(|(a, b)| (a & b).count_ones()).sum() };
        let are = (0..self.rows.len()).filter(|k| self.rows[i][k / 64] >> (k % 64) & 1 == 1);
        let mut all: Vec<(u32, usize)> = are.map(|k| (common(k), k)).collect();
        all.sort_by(|a, b| b.0.cmp(&a.0).then(a.1.cmp(&b.1)));
        all.into_iter().take(count).map(|(_, k)| k).collect()
    }
}

/// Compare what a rigid motion leaves alone: the distance of the two regions, the angles of their normals with each other and with the
/// line between them.
fn are_compatible(a: &Match<'_>, b: &Match<'_>, size: f64) -> bool {
    let (p, q) = (Pair::of(a.from, b.from), Pair::of(a.to, b.to));
    (p.length - q.length).abs() < SAME_LENGTH * size
        && p.length.min(q.length) > NEAR * size
        && p.cosines.iter().zip(&q.cosines).all(|(u, v)| (u - v).abs() < SAME_COSINE)
}

/// Invariants of two oriented points (the point pair features of Drost et al. 2010, as cosines).
struct Pair {
    length: f64,
    cosines: [f64; 3],
}

impl Pair {
    fn of(a: &SpinImage, b: &SpinImage) -> Self {
        let line: [f64; 3] = std::array::from_fn(|d| b.at[d] - a.at[d]);
        let dot = |u: &[f64; 3], v: &[f64; 3]| (0..3).map(|d| u[d] * v[d]).sum::<f64>();
        let length = dot(&line, &line).sqrt();
        let along = |normal: &[f64; 3]| if length > 0.0 { dot(normal, &line) / length } else { 0.0 };
        Self { length, cosines: [along(&a.normal), along(&b.normal), dot(&a.normal, &b.normal)] }
    }
}

fn explained_by(matches: &[Match<'_>], (a, b): &Motion, dim: usize, within: f64) -> Vec<usize> {
    let is_explained = |m: &Match<'_>| {
        let miss = |i: usize| (0..dim).map(|k| a[i * dim + k] * m.from.at[k]).sum::<f64>() + b[i] - m.to.at[i];
        (0..dim).map(|i| miss(i).powi(2)).sum::<f64>() < within * within
    };
    (0..matches.len()).filter(|i| is_explained(&matches[*i])).collect()
}

/// Fit a motion to some of the matches: in space Horn's unit quaternion (1987), in the plane the angle in closed form.
fn fit(matches: &[Match<'_>], chosen: &[usize], dim: usize) -> Option<Motion> {
    if chosen.len() < dim {
        return None;
    }
    let count = chosen.len() as f64;
    let mean = |at: &dyn Fn(&Match<'_>) -> [f64; 3]| -> [f64; 3] {
        std::array::from_fn(|d| chosen.iter().map(|i| at(&matches[*i])[d]).sum::<f64>() / count)
    };
    let (p, q) = (mean(&|m| m.from.at), mean(&|m| m.to.at));
    let mut s = [[0.0; 3]; 3];
    for m in chosen.iter().map(|i| &matches[*i]) {
        for (i, row) in s.iter_mut().enumerate() {
            for (k, entry) in row.iter_mut().enumerate() {
                *entry += (m.from.at[i] - p[i]) * (m.to.at[k] - q[k]);
            }
        }
    }
    let rotation = if dim == 2 { turn_of(&s) } else { rotation_of(&s)? };
    let image = |i: usize| (0..dim).map(|k| rotation[i * dim + k] * p[k]).sum::<f64>();
    let offset = (0..dim).map(|i| q[i] - image(i)).collect();
    Some((rotation, offset))
}

fn turn_of(s: &[[f64; 3]; 3]) -> Vec<f64> {
    let (sin, cos) = (s[0][1] - s[1][0]).atan2(s[0][0] + s[1][1]).sin_cos();
    vec![cos, -sin, sin, cos]
}

/// Return the rotation whose quaternion (x, y, z, w) is the eigenvector of the largest eigenvalue of Horn's matrix.
fn rotation_of(s: &[[f64; 3]; 3]) -> Option<Vec<f64>> {
    let trace = s[0][0] + s[1][1] + s[2][2];
    let curl = [s[1][2] - s[2][1], s[2][0] - s[0][2], s[0][1] - s[1][0]];
    let entry = |i: usize, k: usize| match (i, k) {
        (3, 3) => trace,
        (3, d) | (d, 3) => curl[d],
        _ => s[i][k] + s[k][i] - if i == k { trace } else { 0.0 },
    };
    let (_, vectors) = symmetric_eigen_any(4, entry);
    let v = vectors.first()?;
    Some(rotation_of_quaternion(&[v[3], v[0], v[1], v[2]]).to_vec())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fit_in_the_plane_turns_and_moves() {
        let (sin, cos) = 0.7_f64.sin_cos();
        let region = |x: f64, y: f64| SpinImage { at: [x, y, 0.0], normal: [1.0, 0.0, 0.0], image: Vec::new() };
        let places = [(0.0, 0.0), (1.0, 0.0), (0.3, 2.0)];
        let sources = places.map(|(x, y)| region(x, y));
        let targets = places.map(|(x, y)| region(cos * x - sin * y + 3.0, sin * x + cos * y - 1.0));
        let matches: Vec<Match<'_>> = sources.iter().zip(&targets).map(|(from, to)| Match { from, to }).collect();
        let (a, b) = fit(&matches, &[0, 1, 2], 2).unwrap();
        let expected = [cos, -sin, sin, cos, 3.0, -1.0];
        assert!(a.iter().chain(&b).zip(&expected).all(|(u, v)| (u - v).abs() < 1e-12), "{a:?} {b:?}");
    }

    /// Matches of which a third is right, of a motion that turns by 2 radians.
    #[test]
    fn the_motion_behind_a_third_of_the_matches_comes_first() {
        let (sin, cos) = 2.0_f64.sin_cos();
        let truth = [cos, -sin, 0.0, sin, cos, 0.0, 0.0, 0.0, 1.0];
        let turned =
            |x: &[f64; 3]| -> [f64; 3] { std::array::from_fn(|i| (0..3).map(|k| truth[3 * i + k] * x[k]).sum()) };
        let grid = crate::start::direction_grid(60);
        let place = |k: usize| grid[k];
        let region = |at: [f64; 3], normal: [f64; 3]| SpinImage { at, normal, image: Vec::new() };
        let sources: Vec<SpinImage> = (0..60).map(|k| region(place(k), place((7 * k) % 60))).collect();
        let targets: Vec<SpinImage> = (0..60)
            .map(|k| if k % 3 == 0 { k } else { (11 * k + 5) % 60 })
            .map(|k| region(turned(&sources[k].at).map(|v| v + 0.5), turned(&sources[k].normal)))
            .collect();
        let matches: Vec<Match<'_>> = sources.iter().zip(&targets).map(|(from, to)| Match { from, to }).collect();
        let motions = agreed(&matches, 3, 1.0, 5);
        let (a, b) = &motions[0];
        assert!(a.iter().zip(&truth).all(|(u, v)| (u - v).abs() < 1e-9), "{a:?}");
        assert!(b.iter().all(|v| (v - 0.5).abs() < 1e-9), "{b:?}");
    }
}
