//! Sets whose points are not spread evenly: one point from each cell, weights by the length or area that each point stands for.

use cfpose_kernel::points::{Points, PointsError};

use super::neighbours::Neighbours;
use super::sampling::{even_cells, first_of_cells};

/// Neighbours whose distance tells what a point stands for, the point itself included.
const NEIGHBOURS: usize = 7;
/// Neighbours that tell whether the set is a curve, a surface or a body.
const NEAR_AND_FAR: [usize; 2] = [4, 13];

/// Return the rows (from 0) of the first point in each cell of a grid of edge `size`.
///
/// # Errors
/// A text for a size that is not above 0.
///
/// ```
/// use cfpose::{Points, distances::one_per_cell};
/// let points = Points::from_rows(&[[0.1], [0.2], [1.5], [1.6], [0.3]]).unwrap();
/// assert_eq!(one_per_cell(&points, 1.0).unwrap(), [0, 2]);
/// ```
pub fn one_per_cell(points: &Points, size: f64) -> Result<Vec<usize>, String> {
    if !(size > 0.0 && size.is_finite()) {
        return Err(format!("cells of size {size} hold no points; give a size above 0"));
    }
    Ok(first_of_cells(points, |_, x| x / size))
}

/// Return the rows (from 0) of at most `limit` points that cover a set evenly; `None` where all are few enough.
///
/// ```
/// use cfpose::{Points, distances::even_rows};
/// let points = Points::from_rows(&(0..100).map(|k| [f64::from(k).powi(2)]).collect::<Vec<_>>()).unwrap();
/// assert_eq!(even_rows(&points, 100), None);
/// assert!(even_rows(&points, 20).unwrap().len() <= 20);
/// ```
pub fn even_rows(points: &Points, limit: usize) -> Option<Vec<usize>> {
    if points.len() <= limit { None } else { even_cells(points, limit) }
}

/// Weigh every point by the length, area or volume that it stands for: r^m with the distance r to its sixth neighbour and the dimension
/// m of the set, which the growth of these distances tells. Means over a set with a dense part are then those over the shape.
///
/// # Errors
/// As [`Points::weighted`]; sets of fewer than 14 points keep their weights.
///
/// ```
/// use cfpose::{Points, distances::density_weights};
/// // A line whose right half is four times as dense: its mean moves to the middle.
/// let x = (0..50).map(|k| k as f64 * 0.02).chain((0..200).map(|k| 1.0 + k as f64 * 0.005));
/// let points = Points::from_rows(&x.map(|x| [x, 0.0]).collect::<Vec<_>>()).unwrap();
/// assert!(points.mean()[0] > 1.25);
/// assert!((density_weights(&points).unwrap().mean()[0] - 1.0).abs() < 0.03);
/// ```
pub fn density_weights(points: &Points) -> Result<Points, PointsError> {
    let [near, far] = NEAR_AND_FAR;
    if points.len() <= far {
        return Ok(points.clone());
    }
    let tree = Neighbours::new(points.rows(), points.dim());
    let mut ratios = Vec::new();
    let mut reach = Vec::with_capacity(points.len());
    for p in tree.rows() {
        let found = tree.nearest_n(p, far);
        let distance = |count: usize| found[count - 1].squared.sqrt();
        reach.push(distance(NEIGHBOURS));
        if distance(near) > 0.0 {
            ratios.push(distance(far) / distance(near));
        }
    }
    ratios.sort_by(f64::total_cmp);
    let growth = ratios.get(ratios.len() / 2).map_or(2.0, |ratio| ratio.ln().max(1e-3));
    let growing = ((far - 1) as f64 / (near - 1) as f64).ln();
    let dimension = (growing / growth).round().clamp(1.0, points.dim() as f64);
    // Doubles stand for little, not for nothing.
    let mut sorted = reach.clone();
    sorted.sort_by(f64::total_cmp);
    let least = 0.05 * sorted[sorted.len() / 2];
    let weights = reach.iter().map(|r| r.max(least).powf(dimension)).collect();
    points.with_weights(weights)
}
