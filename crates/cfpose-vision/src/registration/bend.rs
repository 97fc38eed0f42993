//! The shift of a curved edge by blur, and how to take it back.

use nalgebra::{Matrix3, Vector3};

use super::fit::Found;

/// Slope of a step blurred by a Gaussian of deviation 1: 1 / sqrt(2 pi).
pub(super) const STEEPEST: f64 = 0.398_94;

/// Longest distance between neighbours of one contour, pixels.
const NEAR: f64 = 20.0;

/// Largest shift, pixels.
const MOST: f64 = 1.0;

/// Return the distance along the normal from each edge to where it would be without blur, pixels; 0 where there is none.
///
/// A Gaussian blur of covariance S moves the middle of a step with curvature k by k t'S t / 2 towards the centre of curvature, t the
/// contour's direction (the level sets follow the heat equation, to first order in the curvature). S follows from the slopes s of the
/// edges: n'S n = 1 / (2 pi s^2) for all normals n. The curvature is averaged over the width of the blur.
pub(super) fn shifts(found: &Found) -> Vec<f64> {
    let count = found.distances.len();
    let none = vec![0.0; count];
    let Some([xx, xy, yy]) = blur(found) else { return none };
    let width = (0.5 * (xx + yy)).sqrt();
    let turns: Vec<Option<(f64, f64)>> = (0..count).map(|i| turn(found, i)).collect();
    (0..count)
        .map(|i| {
            if found.distances[i].is_nan() {
                return 0.0;
            }
            let Some(curvature) = curvature(&turns, i, width) else { return 0.0 };
            let [nx, ny] = found.across[i];
            let along = xx * ny * ny - 2.0 * xy * nx * ny + yy * nx * nx;
            (0.5 * curvature * along).clamp(-MOST, MOST)
        })
        .collect()
}

/// Fit the covariance of the blur, pixels^2: entries xx, xy, yy; `None` where the edges do not determine it.
fn blur(found: &Found) -> Option<[f64; 3]> {
    let (mut normal, mut right, mut count) = (Matrix3::zeros(), Vector3::zeros(), 0);
    for (i, slope) in found.slopes.iter().enumerate() {
        if found.distances[i].is_nan() || found.distances[i].abs() > 1.5 || !(slope.is_finite() && *slope > 0.02) {
            continue;
        }
        let [nx, ny] = found.across[i];
        let row = Vector3::new(nx * nx, 2.0 * nx * ny, ny * ny);
        // Deviations, not variances, are alike in error: rows are weighted by the slope squared.
        let weight = slope * slope;
        normal += row * row.transpose() * weight * weight;
        right += row * (STEEPEST / slope).powi(2) * weight * weight;
        count += 1;
    }
    if count < 30 {
        return None;
    }
    let solved = normal.cholesky()?.solve(&right);
    let (xx, xy, yy) = (solved[0], solved[1], solved[2]);
    let sound = xx > 0.0 && yy > 0.0 && xx * yy > xy * xy && xx + yy < 200.0;
    // The blur of one pixel and a sharp lens is in the reference's outline too.
    let own = OWN.min(xx).min(yy);
    sound.then_some([xx - own, xy, yy - own])
}

/// Variance of the blur that a sharp image has, pixels^2.
const OWN: f64 = 0.6;

/// Return the angle by which the contour turns from a place to the next, towards the outside positive, and the distance between them.
fn turn(found: &Found, i: usize) -> Option<(f64, f64)> {
    let j = i + 1;
    let (a, b) = (*found.pixels.get(i)?, *found.pixels.get(j)?);
    let length = (b[0] - a[0]).hypot(b[1] - a[1]);
    let near = length.is_finite() && length < NEAR && length > 0.0;
    let ([ax, ay], [bx, by]) = (found.across[i], found.across[j]);
    near.then(|| ((ax * by - ay * bx).atan2(ax * bx + ay * by), length))
}

/// Return the mean curvature around a place, positive where the region bulges.
fn curvature(turns: &[Option<(f64, f64)>], i: usize, width: f64) -> Option<f64> {
    let (mut angle, mut length) = (0.0, 0.0);
    let mut reach = 0.0;
    for piece in turns[i..].iter().map_while(|piece| *piece) {
        (angle, length, reach) = (angle + piece.0, length + piece.1, reach + piece.1);
        if reach > width {
            break;
        }
    }
    reach = 0.0;
    for piece in turns[..i].iter().rev().map_while(|piece| *piece) {
        (angle, length, reach) = (angle + piece.0, length + piece.1, reach + piece.1);
        if reach > width {
            break;
        }
    }
    // Normals point out and the region lies on the side of (-t_y, t_x): a bulge turns them by a positive angle.
    (length > 0.0).then(|| angle / length)
}
