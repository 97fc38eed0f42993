//! The correspondence c(k), read off after the fit (section III.A).

use std::num::NonZero;

use kiddo::{ImmutableKdTree, SquaredEuclidean};

use cfpose_kernel::points::Points;

mod assignment;

pub use assignment::assign;

/// Number of points of the larger set up to which [`correspond`] assigns one to one: about a second at 1000.
pub const MAX_ASSIGNED: usize = 1000;

/// Who corresponds to whom, and how well.
#[derive(Debug, Clone, PartialEq)]
pub struct Correspondence {
    /// For each source point the index (from 0) of its target point; `None` where the target has fewer points.
    pub target_of_source: Vec<Option<usize>>,
    /// Whether no target point is used twice.
    pub one_to_one: bool,
    /// Distance of each matched pair, in the order of the source (units of the feature space).
    pub distances: Vec<f64>,
    /// Root mean square of the distances.
    pub rms: f64,
    /// Largest distance.
    pub max: f64,
    /// Distance up to which a pair counts as an inlier.
    pub threshold: f64,
    /// Share of the *source points* that are inliers; those without a partner are none.
    pub inlier_share: f64,
}

/// Match two sets that were mapped into the feature space, one to one by least total squared distance up to
/// [`MAX_ASSIGNED`] points, by nearest neighbours above.
///
/// The inlier threshold is the given one, or half the median distance between neighbours of the target.
///
/// ```
/// use cfpose::{Points, distances::correspond};
/// let p = Points::from_rows(&[[1.0], [2.0], [3.0], [4.0]]).unwrap();
/// let q = Points::from_rows(&[[2.0], [3.1], [1.0], [9.0]]).unwrap();
/// let c = correspond(&p, &q, None);
/// assert_eq!(c.target_of_source, vec![Some(2), Some(0), Some(1), Some(3)]);
/// assert!(c.max == 5.0 && c.inlier_share == 0.75);
/// ```
pub fn correspond(source: &Points, target: &Points, threshold: Option<f64>) -> Correspondence {
    let one_to_one = source.len().max(target.len()) <= MAX_ASSIGNED;
    let target_of_source = if one_to_one {
        one_to_one_match(source, target)
    } else {
        nearest_neighbours(source, target).into_iter().map(Some).collect()
    };
    let pairs = target_of_source.iter().enumerate().filter_map(|(k, partner)| partner.map(|q| (k, q)));
    let distances: Vec<f64> = pairs.map(|(k, q)| squared(source.point(k), target.point(q)).sqrt()).collect();
    let threshold = threshold.unwrap_or_else(|| 0.5 * median_spacing(target));
    let square_sum: f64 = distances.iter().map(|d| d * d).sum();
    let inliers = distances.iter().filter(|d| **d <= threshold).count();
    Correspondence {
        rms: (square_sum / distances.len() as f64).sqrt(),
        max: distances.iter().fold(0.0, |a, b| a.max(*b)),
        inlier_share: inliers as f64 / source.len() as f64,
        target_of_source,
        one_to_one,
        distances,
        threshold,
    }
}

fn squared(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|d| (a[d] - b[d]).powi(2)).sum()
}

/// Assign the smaller set into the larger one.
fn one_to_one_match(source: &Points, target: &Points) -> Vec<Option<usize>> {
    let costs = |rows: &Points, columns: &Points| -> Vec<f64> {
        let of_row = |k: usize| (0..columns.len()).map(move |q| squared(rows.point(k), columns.point(q)));
        (0..rows.len()).flat_map(of_row).collect()
    };
    if source.len() <= target.len() {
        let assigned = assign(&costs(source, target), target.len()).unwrap_or_default();
        return assigned.into_iter().map(Some).collect();
    }
    let mut partners = vec![None; source.len()];
    for (q, k) in assign(&costs(target, source), source.len()).into_iter().flatten().enumerate() {
        partners[k] = Some(q);
    }
    partners
}

/// Return the median distance of a point to its nearest other point; of many points a thousand are asked.
fn median_spacing(points: &Points) -> f64 {
    let rows: Vec<[f64; 3]> = (0..points.len()).map(|k| points.point(k)).collect();
    let asked = (0..rows.len()).step_by(rows.len().div_ceil(1000));
    let mut spacing: Vec<f64> = match ImmutableKdTree::<f64, 3>::new_from_slice(&rows) {
        Ok(tree) => {
            let two = NonZero::<usize>::MIN.saturating_add(1);
            // The nearest is the point itself, or its double.
            let nearest = |k: usize| tree.query(&rows[k]).nearest_n::<SquaredEuclidean<f64>>(two).execute();
            asked.filter_map(|k| nearest(k).get(1).map(|found| found.distance.sqrt())).collect()
        }
        Err(_) => {
            let others = |k: usize| (0..rows.len()).filter(move |q| *q != k);
            asked.map(|k| others(k).map(|q| squared(rows[k], rows[q])).fold(f64::INFINITY, f64::min).sqrt()).collect()
        }
    };
    spacing.sort_by(f64::total_cmp);
    spacing.get(spacing.len() / 2).copied().filter(|middle| middle.is_finite()).unwrap_or(0.0)
}

/// Return for each source point the index (from 0) of the nearest target point, both mapped into the feature space.
///
/// Several source points may share a target point.
///
/// ```
/// use cfpose::{Points, distances::nearest_neighbours};
/// let p = Points::from_rows(&[[1.0], [2.0], [3.0], [4.0]]).unwrap();
/// let q = Points::from_rows(&[[2.0], [3.0], [1.0], [4.0]]).unwrap();
/// assert_eq!(nearest_neighbours(&p, &q), vec![2, 0, 1, 3]);
/// ```
pub fn nearest_neighbours(source: &Points, target: &Points) -> Vec<usize> {
    let rows: Vec<[f64; 3]> = (0..target.len()).map(|k| target.point(k)).collect();
    match ImmutableKdTree::<f64, 3>::new_from_slice(&rows) {
        Ok(tree) => (0..source.len())
            .map(|k| tree.query(&source.point(k)).nearest_one::<SquaredEuclidean<f64>>().execute().item as usize)
            .collect(),
        // The tree refuses some degenerate sets (very many equal points): the scan is slow and always right.
        Err(_) => (0..source.len()).map(|k| nearest_by_scan(source.point(k), &rows)).collect(),
    }
}

fn nearest_by_scan(point: [f64; 3], rows: &[[f64; 3]]) -> usize {
    let distance = |row: &[f64; 3]| (0..3).map(|d| (row[d] - point[d]).powi(2)).sum::<f64>();
    let mut best = (0, f64::INFINITY);
    for (index, row) in rows.iter().enumerate() {
        if distance(row) < best.1 {
            best = (index, distance(row));
        }
    }
    best.0
}
