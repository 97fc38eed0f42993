//! How two sets were sampled, and random parts of a set.

use cfpose_kernel::points::{Points, PointsError};

use super::support::Support;
use crate::criteria::Criteria;

/// How the two sets were sampled, which decides kappa (docs/method.md, *Means have statistics*).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sampling {
    /// The same physical points: kappa = 0.
    Same,
    /// One set is a random part of the other: kappa = abs(1/N - 1/M).
    Thinned,
    /// Sampled independently from one shape: kappa = 1/N + 1/M.
    Independent,
    /// The pixels of two regions, each on its own lattice: a quadrature whose error lies on the boundary.
    Raster,
}

/// Variance of the share of a pixel beside the boundary that a mask gives wrongly (1/24 over a band of two pixels; twice that where the mask
/// was resampled by nearest neighbours), times the pixels of the band of a region of N pixels over sqrt(N): two for each pixel of a boundary
/// 3 times as long as a disc's, 2 sqrt(pi N).
const RASTER: f64 = 2.0 * 3.0 * 3.545 / 12.0;

impl Sampling {
    /// Names, as the command line gives them.
    pub const NAMES: [(&'static str, Sampling); 4] = [
        ("same", Sampling::Same),
        ("thinned", Sampling::Thinned),
        ("independent", Sampling::Independent),
        ("raster", Sampling::Raster),
    ];

    /// Return the name.
    pub fn name(self) -> &'static str {
        match self {
            Sampling::Same => "same",
            Sampling::Thinned => "thinned",
            Sampling::Independent => "independent",
            Sampling::Raster => "raster",
        }
    }

    /// Return kappa for effective numbers of points.
    ///
    /// ```
    /// use cfpose::distances::Sampling;
    /// assert_eq!(Sampling::Thinned.kappa(50.0, 100.0), 0.01);
    /// assert_eq!(Sampling::Same.kappa(50.0, 100.0), 0.0);
    /// ```
    pub fn kappa(self, num_target: f64, num_source: f64) -> f64 {
        match self {
            Sampling::Same => 0.0,
            Sampling::Thinned => (num_target.recip() - num_source.recip()).abs(),
            Sampling::Independent => num_target.recip() + num_source.recip(),
            // Variance of a mean of N pixels by those of the boundary: RASTER sqrt(N) / N^2.
            Sampling::Raster => RASTER * (num_target.powf(-1.5) + num_source.powf(-1.5)),
        }
    }

    /// Choose by nearest-neighbour distances after the fit against the spacing, never from the residual: were kappa fitted,
    /// J would be 1 by construction and detect nothing.
    ///
    /// Same points: the median distance is that of the noise, seen along the normals. Independent ones: about the spacing,
    /// with the noise on top. Where the noise hides the spacing, the numbers of points (`counts`: target, source) decide:
    /// equal within 3 % counts as the same points. `dim` is the dimension of the feature space.
    pub fn detect(support: &Support, dim: usize, counts: [usize; 2], criteria: &Criteria) -> Self {
        let (noise, spacing) = (support.normal_sigma.powi(2) * dim as f64, support.source_spacing.powi(2));
        let visible = noise < criteria.visible * spacing;
        let gap = criteria.gap_spacing * spacing + criteria.gap_noise * noise;
        if visible && support.mutual < criteria.mutual && support.median.powi(2) > gap {
            return Sampling::Independent;
        }
        let ratio = counts[0] as f64 / counts[1] as f64;
        if (ratio - 1.0).abs() < criteria.equal_counts { Sampling::Same } else { Sampling::Thinned }
    }
}

/// Return at most `limit` of the points: evenly spaced along a curve, else a random choice in the order of the points.
///
/// Every n-th of unordered points would be a random choice whose quality depends on the order of the file; points in curve
/// order may be thinned as a quadrature.
///
/// # Errors
/// [`PointsError::NoWeight`] when all chosen weights are zero.
pub(crate) fn thin(points: &Points, limit: usize, rng: &mut impl rand::Rng) -> Result<Points, PointsError> {
    let len = points.len();
    if len <= limit || limit == 0 {
        return Ok(points.clone());
    }
    if points.is_in_curve_order() {
        let indices: Vec<usize> = (0..limit).map(|i| i * len / limit).collect();
        return points.select(&indices);
    }
    // Selection sampling (Knuth 3.4.2, algorithm S): every subset is equally likely, and the order is kept.
    let mut indices = Vec::with_capacity(limit);
    for k in 0..len {
        let (needed, left) = ((limit - indices.len()) as f64, (len - k) as f64);
        if rand::RngExt::random::<f64>(rng) * left < needed {
            indices.push(k);
        }
    }
    points.select(&indices)
}

/// Return at most `limit` points of equal weight: [`thin`] where the weights are equal; else drawn without replacement in proportion to
/// their weights, at most as many as count effectively, (sum w)^2 / sum w^2: three weighted points of 300 are three.
///
/// # Errors
/// [`PointsError`] as of [`Points::select`].
pub(crate) fn draw(points: &Points, limit: usize, rng: &mut impl rand::Rng) -> Result<Points, PointsError> {
    let weights = points.weights();
    if weights.iter().all(|w| *w == weights[0]) {
        return thin(points, limit, rng);
    }
    let (sum, squares) = weights.iter().fold((0.0, 0.0), |(s, t), w| (s + w, t + w * w));
    let count = (sum * sum / squares).ceil() as usize;
    let count = if limit == 0 { count } else { count.min(limit) };
    // The largest of u^(1/w) are such a draw (Efraimidis and Spirakis, 2006).
    let key = |w: &f64| rand::RngExt::random::<f64>(rng).ln() / w;
    let keys: Vec<f64> =
        weights.iter().map(key).map(|key| if key.is_nan() { f64::NEG_INFINITY } else { key }).collect();
    let mut rows: Vec<usize> = (0..points.len()).filter(|k| weights[*k] > 0.0).collect();
    rows.sort_by(|a, b| keys[*b].total_cmp(&keys[*a]));
    rows.truncate(count.max(1));
    rows.sort_unstable();
    points.select(&rows).map(Points::with_equal_weights)
}

/// Farther from the median point than so many median distances a point is a stray one.
const STRAY: f64 = 20.0;
/// More points than this share are no stray points but a part of the set.
const MOST_STRAY: f64 = 0.02;

/// Return the rows of stray points: a few that lie so far away that they would set mean, scale and extent of the whole set.
pub(crate) fn stray(points: &Points) -> Vec<usize> {
    let median = |values: &mut Vec<f64>| {
        let at = values.len() / 2;
        *values.select_nth_unstable_by(at, f64::total_cmp).1
    };
    let middle: Vec<f64> = (0..points.dim()).map(|d| median(&mut points.column(d).to_vec())).collect();
    let distance = |k: usize| (0..points.dim()).map(|d| (points.column(d)[k] - middle[d]).powi(2)).sum::<f64>().sqrt();
    let distances: Vec<f64> = (0..points.len()).map(distance).collect();
    let limit = STRAY * median(&mut distances.clone());
    let rows: Vec<usize> = (0..points.len()).filter(|k| distances[*k] > limit).collect();
    let most = (MOST_STRAY * points.len() as f64).max(1.0);
    if limit > 0.0 && rows.len() as f64 <= most && points.len() > 8 { rows } else { Vec::new() }
}

/// Return at most `limit` points that stand for all: of each cell of a grid the one nearest to the middle of its points, with the weight of all
/// of them. Weighted points are drawn ([`draw`]).
///
/// # Errors
/// [`PointsError`] as of [`Points::select`].
pub(crate) fn represent(points: &Points, limit: usize) -> Result<Points, PointsError> {
    let rng = &mut crate::streams::stream(0, "represent");
    if points.weights().iter().any(|w| *w != points.weights()[0]) {
        return draw(points, limit, rng);
    }
    if points.len() <= limit || limit == 0 {
        return Ok(points.clone());
    }
    let most = REPRESENTED * limit;
    if points.len() > most {
        return represent(&thin(points, most, rng)?, limit);
    }
    let Some(cells) = cells_within(points, limit) else { return Ok(points.clone()) };
    let (mut rows, mut weights) = (Vec::with_capacity(cells.len()), Vec::with_capacity(cells.len()));
    for cell in cells {
        let total: f64 = cell.iter().map(|k| points.weights()[*k]).sum();
        let of = |d: usize| cell.iter().map(|k| points.column(d)[*k]).sum::<f64>() / cell.len() as f64;
        let middle: Vec<f64> = (0..points.dim()).map(of).collect();
        let far = |k: usize| (0..points.dim()).map(|d| (points.column(d)[k] - middle[d]).powi(2)).sum::<f64>();
        let least = cell.iter().map(|k| far(*k)).fold(f64::INFINITY, f64::min);
        // Two points are equally near: the first one then, not the one that rounding prefers.
        let nearest = cell.iter().copied().find(|k| far(*k) <= least * (1.0 + SAME_DISTANCE)).unwrap_or(cell[0]);
        rows.push(nearest);
        weights.push(total);
    }
    points.select(&rows)?.with_weights(weights)
}

/// Squared distances that differ by no more are one.
const SAME_DISTANCE: f64 = 1e-6;
/// Points that one may stand for; of more a random part is looked at.
const REPRESENTED: usize = 25;

/// Points that [`even`] looks at for each that it keeps.
const LOOKED_AT: usize = 100;

/// Return at most `limit` of the points, one from each cell of a grid that is as fine as that allows: dense parts lose most, so that what is
/// left covers the shape evenly, however it was sampled. Of very many points a random part is looked at.
///
/// # Errors
/// [`PointsError::NoWeight`] when all chosen weights are zero.
pub(crate) fn even(points: &Points, limit: usize) -> Result<Points, PointsError> {
    let most = LOOKED_AT * limit.max(1);
    if points.len() > most {
        return even(&thin(points, most, &mut crate::streams::stream(0, "even"))?, limit);
    }
    even_cells(points, limit).map_or_else(|| Ok(points.clone()), |rows| points.select(&rows))
}

/// Return the rows of [`even`]; `None` for all of a set that has no extent or hardly any points.
pub(super) fn even_cells(points: &Points, limit: usize) -> Option<Vec<usize>> {
    Some(cells_within(points, limit)?.into_iter().map(|cell| cell[0]).collect())
}

/// Return the rows in each cell of the finest grid with at most `limit` cells that hold points, in the order of their first; `None` as of
/// [`even_cells`].
fn cells_within(points: &Points, limit: usize) -> Option<Vec<Vec<usize>>> {
    let bounds: Vec<(f64, f64)> = (0..points.dim())
        .map(|d| {
            let mut column = points.column(d).to_vec();
            column.sort_by(f64::total_cmp);
            // Strays must not widen the cells.
            let (low, high) = (column[column.len() / 20], column[(column.len() - 1) * 19 / 20]);
            (low, high - low)
        })
        .collect();
    let size = bounds.iter().map(|(_, width)| *width).fold(0.0, f64::max);
    let has_extent = size.is_finite() && size > 0.0;
    if points.len() <= 3 || !has_extent {
        return None;
    }
    // Cells per size of the set, by bisection.
    let (mut coarse, mut fine) = (2.0_f64, 400.0_f64);
    let kept_of = |cells: f64| by_cells(points, |d, x| (x - bounds[d].0) / size * cells);
    let mut kept = kept_of(coarse);
    for _ in 0..9 {
        let middle = (coarse * fine).sqrt();
        let cells = kept_of(middle);
        if cells.len() <= limit {
            (coarse, kept) = (middle, cells);
        } else {
            fine = middle;
        }
    }
    Some(kept)
}

/// Return the first point of every cell; `place` gives the cell of a coordinate.
pub(super) fn first_of_cells(points: &Points, place: impl Fn(usize, f64) -> f64) -> Vec<usize> {
    by_cells(points, place).into_iter().map(|cell| cell[0]).collect()
}

/// Return the points of every cell, in the order of the first ones.
fn by_cells(points: &Points, place: impl Fn(usize, f64) -> f64) -> Vec<Vec<usize>> {
    let mut cells: Vec<Vec<usize>> = Vec::new();
    let mut at = std::collections::HashMap::new();
    for k in 0..points.len() {
        let mut cell = [0_i64; 3];
        (0..points.dim()).for_each(|d| cell[d] = place(d, points.column(d)[k]).floor() as i64);
        let new = cells.len();
        let index = *at.entry(cell).or_insert(new);
        if index == new {
            cells.push(Vec::new());
        }
        cells[index].push(k);
    }
    cells
}
