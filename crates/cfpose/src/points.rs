//! Weighted point sets, and a choice of some of their points.

pub use cfpose_kernel::points::{Attribute, BLOCK, Points, PointsError};

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
