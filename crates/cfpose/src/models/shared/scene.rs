//! What the examinations of the models share: the spread of a point set, half turns, sides of a plane.

use cfpose_kernel::points::Points;

use crate::geometry::linalg::symmetric_eigen;

/// Relative standard deviation below which a point set has no extent in a direction.
const FLAT: f64 = 1e-7;

/// Return standard deviations (descending) and principal axes of a point set.
fn principal(points: &Points) -> ([f64; 3], [[f64; 3]; 3]) {
    let (values, axes) = symmetric_eigen(&points.covariance(), points.dim());
    (values.map(|value| value.max(0.0).sqrt()), axes)
}

/// Return the number of directions in which a point set has extent.
pub fn spread_rank(points: &Points) -> usize {
    let (deviations, _) = principal(points);
    deviations.iter().filter(|deviation| **deviation > FLAT * deviations[0]).count()
}

/// Report a set whose spread has fewer than `needed` of `dim` directions.
pub fn spread_warnings(points: &Points, dim: usize, needed: usize) -> Vec<String> {
    let rank = spread_rank(points);
    if rank >= needed {
        return Vec::new();
    }
    let place = match rank {
        0 => "in one point",
        1 => "on a line",
        _ => "in a plane",
    };
    let rest = if dim == 2 || rank == 2 { "across it" } else { "around or across it" };
    vec![format!("the source lies {place}: what the map does {rest} is undetermined")]
}

/// Report a linear map that reverses orientation.
pub fn reflection_warning(determinant: f64) -> Option<String> {
    (determinant < 0.0)
        .then(|| "the map reverses orientation (det A < 0); start with reflections=forbid to exclude it".to_string())
}

/// A half turn about an axis through the mean of a point set.
pub struct HalfTurn {
    /// Rotation matrix, row by row.
    pub rotation: [f64; 9],
    /// Displacement: x -> rotation x + shift.
    pub shift: [f64; 3],
}

impl HalfTurn {
    /// Return the map x -> A Q x + (A shift + b): the half turn first, then A and b.
    pub fn before(&self, a: &[f64], b: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let turned = cfpose_optim::manifold::multiply3(a, &self.rotation).to_vec();
        let moved = (0..3).map(|i| b[i] + (0..3).map(|k| a[3 * i + k] * self.shift[k]).sum::<f64>()).collect();
        (turned, moved)
    }
}

/// Return the half turns about the principal axes of a 3-D point set: the symmetries that most shapes with one have.
pub fn half_turns(points: &Points) -> Vec<HalfTurn> {
    let (_, axes) = principal(points);
    let mean = points.mean();
    axes.iter()
        .map(|axis| {
            // Q = 2 a a' - I, shift = m - Q m.
            let mut turn = HalfTurn { rotation: [0.0; 9], shift: mean };
            for i in 0..3 {
                for k in 0..3 {
                    turn.rotation[3 * i + k] = 2.0 * axis[i] * axis[k] - f64::from(u8::from(i == k));
                    turn.shift[i] -= turn.rotation[3 * i + k] * mean[k];
                }
            }
            turn
        })
        .collect()
}

/// Return the principal axis of least extent and whether the set is flat along it.
pub fn normal(points: &Points) -> ([f64; 3], bool) {
    let (deviations, axes) = principal(points);
    (axes[2], deviations[2] <= FLAT * deviations[0])
}

/// Report points at negative depth: all of them, or some. `depth` maps a point to its depth.
pub fn depth_warnings(points: &Points, depth: impl Fn([f64; 3]) -> f64) -> (Vec<String>, bool) {
    let behind = (0..points.len()).filter(|k| depth(points.point(*k)) <= 0.0).count();
    if behind == points.len() {
        return (vec!["all points lie behind the camera: not a view of the scene".to_string()], true);
    }
    if behind > 0 {
        let warning = format!("{behind} of {} points lie behind the camera", points.len());
        return (vec![warning], depth(points.mean()) <= 0.0);
    }
    (Vec::new(), false)
}
