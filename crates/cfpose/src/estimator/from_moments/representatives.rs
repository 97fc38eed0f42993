//! A few points that have the weight, mean and covariance of a set of which only moments are known.

use cfpose_kernel::moments::Moments;
use cfpose_kernel::points::Points;

use crate::error::{Error, Side};
use crate::geometry::linalg::symmetric_eigen;

/// Return two points on each principal axis, as far out as the spread asks for: what normalisers and start strategies look at.
pub(super) fn representatives(moments: &Moments, side: Side) -> Result<Points, Error> {
    let (dim, mean) = (moments.dim(), moments.mean());
    let (values, vectors) = symmetric_eigen(&moments.covariance(), dim);
    let mut columns = vec![Vec::new(); dim];
    for (value, axis) in values.iter().zip(&vectors).take(dim) {
        let reach = (dim as f64 * value.max(0.0)).sqrt();
        for sign in [-1.0, 1.0] {
            columns.iter_mut().enumerate().for_each(|(d, column)| column.push(mean[d] + sign * reach * axis[d]));
        }
    }
    let weights = vec![moments.weight() / (2 * dim) as f64; 2 * dim];
    let points = Points::weighted(columns, weights).map_err(|problem| Error::Points { side, problem })?;
    points.require_spread(2).map_err(|problem| Error::Points { side, problem })?;
    Ok(points)
}
