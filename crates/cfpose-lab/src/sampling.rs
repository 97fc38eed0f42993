//! Draws that scenarios share.

use rand::RngExt;
use rand_chacha::ChaCha12Rng;

use crate::shapes::direction;

/// Permute rows: Fisher-Yates from the end, one draw each.
pub fn shuffle<T>(rows: &mut [T], rng: &mut ChaCha12Rng) {
    for k in (1..rows.len()).rev() {
        rows.swap(k, rng.random_range(0..=k));
    }
}

/// Add `count` points, D uniforms each, in the bounding box of the points enlarged by a fifth about its centre.
pub fn add_uniform<const D: usize>(points: &mut Vec<[f64; D]>, count: usize, rng: &mut ChaCha12Rng) {
    if points.is_empty() {
        return;
    }
    let bounds: [(f64, f64); D] = std::array::from_fn(|d| {
        points.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), q| (low.min(q[d]), high.max(q[d])))
    });
    for _ in 0..count {
        points.push(bounds.map(|(low, high)| {
            let (centre, size) = (0.5 * (low + high), 1.2 * (high - low));
            centre + size * (rng.random::<f64>() - 0.5)
        }));
    }
}

/// Choose one of several values by their shares.
pub fn chosen<T: Copy>(values: &[(T, u32)], rng: &mut ChaCha12Rng) -> T {
    let total: u32 = values.iter().map(|(_, share)| share).sum();
    let mut left = rng.random_range(0..total);
    for (value, share) in values {
        if left < *share {
            return *value;
        }
        left -= share;
    }
    values[0].0
}

/// Keep the `kept` points that lie farthest back along a direction; draws the direction (three normals).
pub fn cut_by_plane(points: &mut Vec<[f64; 3]>, kept: usize, rng: &mut ChaCha12Rng) {
    keep_behind(points, kept, &direction(rng));
}

/// Keep the `kept` points that lie farthest back along a direction.
pub fn keep_behind(points: &mut Vec<[f64; 3]>, kept: usize, axis: &[f64; 3]) {
    let along = |p: &[f64; 3]| p[0] * axis[0] + p[1] * axis[1] + p[2] * axis[2];
    points.sort_by(|a, b| along(a).total_cmp(&along(b)));
    points.truncate(kept);
}
