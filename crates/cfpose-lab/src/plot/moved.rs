//! What an estimator says about points, made ready to be drawn: moved points, error ellipses, residuals.

use cfpose::{Estimator, Points};
use cfpose_optim::Manifold;

use super::{Ellipse, Panel};

/// Ellipses of a panel.
const NUM_ELLIPSES: usize = 12;

/// Return the image coordinates (x / z, y / z) of points in 3-D, points at depth <= 0 left out; the first two coordinates
/// of points in the plane.
pub fn image_coordinates(points: &Points) -> Vec<[f64; 2]> {
    let all = (0..points.len()).map(|k| points.point(k));
    if points.dim() < 3 {
        return all.map(|[x, y, _]| [x, y]).collect();
    }
    all.filter(|p| p[2] > 0.0).map(|[x, y, z]| [x / z, y / z]).collect()
}

/// Return the first two coordinates: points in 3-D seen along z.
pub fn seen_from_above(points: &Points) -> Vec<[f64; 2]> {
    (0..points.len()).map(|k| points.point(k)).map(|[x, y, _]| [x, y]).collect()
}

/// Say whether the model maps points to rays or to an image.
fn projects(estimator: &Estimator) -> bool {
    !estimator.model().source.factored().is_some_and(|facts| facts.identity_projection)
}

/// Make one panel per theta (ambient): where the model puts the source, over the target.
///
/// Motions of points in 3-D are seen along z, models that project (to rays, to an image) in the image plane.
///
/// # Errors
/// [`cfpose::Error`] when a mapped point is not finite.
pub fn panels(estimator: &Estimator, thetas: &[(&str, &[f64])]) -> Result<Vec<Panel>, cfpose::Error> {
    let flat = if projects(estimator) { image_coordinates } else { seen_from_above };
    let panel = |(title, theta): &(&str, &[f64])| {
        let (moved, target) = estimator.mapped(theta)?;
        Ok(Panel { title: (*title).to_string(), moved: flat(&moved), target: flat(&target), ..Panel::default() })
    };
    thetas.iter().map(panel).collect()
}

/// Make the panels of an estimate: before, after with its error ellipses, and the residuals, from every moved point to the target
/// point nearest to it.
///
/// # Errors
/// [`cfpose::Error`] when a point mapped at `after` is not finite; a `before` at which one is not has no panel.
pub fn of_estimate(
    estimator: &Estimator,
    before: &[f64],
    after: &[f64],
    covariance: Option<&[f64]>,
) -> Result<Vec<Panel>, cfpose::Error> {
    let mut all = panels(estimator, &[("before", before)]).unwrap_or_default();
    let mut found = panels(estimator, &[("after", after)])?;
    if let (Some(panel), Some(covariance)) = (found.first_mut(), covariance) {
        panel.ellipses = ellipses(estimator, after, covariance)?;
    }
    all.append(&mut found);
    let (moved, target) = estimator.mapped(after)?;
    let partners = estimator.correspondence(after)?;
    let project = projects(estimator);
    let flat = |[x, y, z]: [f64; 3], dim: usize| match project && dim == 3 {
        true => (z > 0.0).then(|| [x / z, y / z]),
        false => Some([x, y]),
    };
    let pair = |(k, partner): (usize, &usize)| {
        let partner = target.point(*partner);
        Some([flat(moved.point(k), moved.dim())?, flat(partner, target.dim())?])
    };
    let pairs: Vec<[[f64; 2]; 2]> = partners.iter().enumerate().filter_map(pair).collect();
    let rest = pairs.iter().map(|[from, to]| [to[0] - from[0], to[1] - from[1]]).collect();
    if let Some(panel) = all.last_mut() {
        panel.lines = pairs;
    }
    all.push(Panel {
        title: "residuals: nearest target point - moved point".to_string(),
        moved: rest,
        target: vec![[0.0, 0.0]],
        own_axes: true,
        labels: Some(["residual".to_string(), "zero".to_string()]),
        ..Panel::default()
    });
    Ok(all)
}

/// Return the error ellipses of evenly chosen source points: C = J Sigma J', J the derivative of the point in the figure with
/// respect to the tangent coordinates at theta (by central differences), Sigma their covariance (tangent x tangent, row by
/// row; all coordinates free). None for a covariance of other coordinates.
///
/// # Errors
/// [`cfpose::Error`] when a mapped point is not finite.
pub fn ellipses(estimator: &Estimator, theta: &[f64], covariance: &[f64]) -> Result<Vec<Ellipse>, cfpose::Error> {
    let manifold = estimator.model().layout.manifold();
    let m = manifold.tangent();
    if covariance.len() != m * m {
        return Ok(Vec::new());
    }
    let projects = projects(estimator);
    let map = |theta: &[f64]| -> Result<Vec<Option<[f64; 2]>>, cfpose::Error> {
        let moved = estimator.mapped_source(theta)?;
        let chosen = (0..moved.len()).step_by(moved.len().div_ceil(NUM_ELLIPSES).max(1));
        let flat = |[x, y, z]: [f64; 3]| {
            let image = projects && moved.dim() == 3;
            if image { (z > 0.0).then(|| [x / z, y / z]) } else { Some([x, y]) }
        };
        Ok(chosen.map(|k| flat(moved.point(k))).collect())
    };
    let centres = map(theta)?;
    let mut slopes = Vec::new();
    for j in 0..m {
        let mut sides = [Vec::new(), Vec::new()];
        for (side, sign) in sides.iter_mut().zip([1.0, -1.0]) {
            let (mut step, mut moved) = (vec![0.0; m], theta.to_vec());
            step[j] = sign * DIFFERENCE;
            manifold.retract(theta, &step, &mut moved);
            *side = map(&moved)?;
        }
        slopes.push(sides);
    }
    let slope = |k: usize, j: usize| -> Option<[f64; 2]> {
        let (after, before) = (slopes[j][0][k]?, slopes[j][1][k]?);
        Some([0, 1].map(|d| (after[d] - before[d]) / (2.0 * DIFFERENCE)))
    };
    let ellipse = |(k, centre): (usize, &Option<[f64; 2]>)| {
        let rows: Option<Vec<[f64; 2]>> = (0..m).map(|j| slope(k, j)).collect();
        let (rows, centre) = (rows?, (*centre)?);
        let entry = |a: usize, b: usize| -> f64 {
            (0..m).map(|i| (0..m).map(|j| rows[i][a] * covariance[i * m + j] * rows[j][b]).sum::<f64>()).sum()
        };
        let xx = entry(0, 0).sqrt();
        let yx = if xx > 0.0 { entry(1, 0) / xx } else { 0.0 };
        let root = [xx, yx, (entry(1, 1) - yx * yx).max(0.0).sqrt()];
        root.iter().all(|value| value.is_finite()).then_some(Ellipse { centre, root })
    };
    Ok(centres.iter().enumerate().filter_map(ellipse).collect())
}

/// Step of the central differences, in tangent coordinates.
const DIFFERENCE: f64 = 1e-5;
