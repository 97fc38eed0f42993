//! Starts from nothing: regions that are seen as a whole tell an affine map up to a turn, and their shape tells the turn.

use cfpose::Points;
use cfpose_optim::manifold::{multiply3, rotation_exp};

use super::pattern::Pattern;
use super::registrar::Registrar;
use super::view::View;

/// Turns that are looked at, and how many of the best are kept.
const TURNS: usize = 180;
const KEPT: usize = 4;

/// Waves around the centre that tell the turn, and the powers of the distance that they are weighted with.
const WAVES: usize = 8;
const POWERS: [i32; 2] = [1, 3];

/// A region in coordinates of mean 0 and covariance 1.
struct Whitened {
    mean: [f64; 2],
    /// Lower triangle L of the covariance L L': a, b, c of ((a, 0), (b, c)).
    root: [f64; 3],
    /// Sums of r^p exp(i m angle), for each p and m.
    waves: Vec<[f64; 2]>,
}

impl Whitened {
    fn of(points: &Points) -> Option<Self> {
        let (mean, covariance) = (points.mean(), points.covariance());
        let a = covariance[0][0].sqrt();
        let b = covariance[0][1] / a;
        let c = (covariance[1][1] - b * b).sqrt();
        if !(a > 0.0 && c > 0.0) {
            return None;
        }
        let total: f64 = points.weights().iter().sum();
        let mut waves = vec![[0.0; 2]; POWERS.len() * WAVES];
        for (k, weight) in points.weights().iter().enumerate() {
            let x = (points.column(0)[k] - mean[0]) / a;
            let y = (points.column(1)[k] - mean[1] - b * x) / c;
            let (radius, angle) = (x.hypot(y), y.atan2(x));
            for (i, wave) in waves.iter_mut().enumerate() {
                let (m, power) = ((i % WAVES + 1) as f64, POWERS[i / WAVES]);
                let size = weight / total * radius.powi(power);
                wave[0] += size * (m * angle).cos();
                wave[1] += size * (m * angle).sin();
            }
        }
        Some(Self { mean: [mean[0], mean[1]], root: [a, b, c], waves })
    }

    /// Return how much alike two regions are after a turn of the first.
    fn alike(&self, other: &Self, turn: f64) -> f64 {
        let pairs = self.waves.iter().zip(&other.waves).enumerate();
        pairs
            .map(|(i, (p, q))| {
                let (sine, cosine) = ((i % WAVES + 1) as f64 * turn).sin_cos();
                // The real part of conj(p exp(i m turn)) q.
                (p[0] * cosine - p[1] * sine) * q[0] + (p[0] * sine + p[1] * cosine) * q[1]
            })
            .sum()
    }

    /// Return the linear map from this region to another one, by a turn.
    fn map_to(&self, other: &Self, turn: f64) -> [f64; 4] {
        let (sine, cosine) = turn.sin_cos();
        let [a, b, c] = other.root;
        let turned = [a * cosine, -a * sine, b * cosine + c * sine, c * cosine - b * sine];
        let [p, q, r] = self.root;
        // Times the inverse of ((p, 0), (q, r)).
        let row = |x: f64, y: f64| [(x - y * q / r) / p, y / r];
        let ([w, x], [y, z]) = (row(turned[0], turned[1]), row(turned[2], turned[3]));
        [w, x, y, z]
    }
}

impl Registrar {
    /// Return thetas near which a pattern that is seen as a whole may be, whatever its turn and tilt; the likeliest turn first.
    ///
    /// Mean and covariance of both regions determine an affine map up to a turn of the whitened region; the turn is where the waves
    /// around the centre agree best. An affine map is what a pose is near the pattern's centre: to both tilts.
    pub(super) fn whitened(&self, pattern: &Pattern, view: &View) -> Vec<Vec<f64>> {
        let (Some(source), Some(target)) = (Whitened::of(&pattern.points[0]), Whitened::of(&view.points[0])) else {
            return Vec::new();
        };
        let turn = |k: usize| k as f64 / TURNS as f64 * std::f64::consts::TAU;
        let alike: Vec<f64> = (0..TURNS).map(|k| source.alike(&target, turn(k))).collect();
        let next = |k: usize, by: usize| alike[(k + by) % TURNS];
        let mut best: Vec<usize> =
            (0..TURNS).filter(|k| alike[*k] > next(*k, 1) && alike[*k] >= next(*k, TURNS - 1)).collect();
        best.sort_by(|a, b| alike[*b].total_cmp(&alike[*a]));
        let maps = best.into_iter().take(KEPT).map(|k| source.map_to(&target, turn(k)));
        maps.flat_map(|map| self.of_affine(map, source.mean, target.mean)).collect()
    }

    /// Return thetas that act like an affine map near a place; none for models that have no such one.
    fn of_affine(&self, map: [f64; 4], from: [f64; 2], to: [f64; 2]) -> Vec<Vec<f64>> {
        let layout = &self.model().layout;
        let start = self.start();
        let [a, b, c, d] = map;
        let shift = [to[0] - a * from[0] - b * from[1], to[1] - c * from[0] - d * from[1]];
        let found = match start.len() {
            12.. if layout.range("rotation") == Some(0..9) && layout.range("translation") == Some(9..12) => {
                let poses = poses_of(map, from, to).into_iter();
                poses.map(|pose| pose.into_iter().chain(start[12..].iter().copied()).collect()).collect()
            }
            9 => {
                let matrix = [a, b, shift[0], c, d, shift[1], 0.0, 0.0, 1.0];
                let norm = matrix.iter().map(|v| v * v).sum::<f64>().sqrt();
                vec![matrix.iter().map(|v| v / norm).collect()]
            }
            6 => vec![vec![a, b, c, d, shift[0], shift[1]]],
            _ => Vec::new(),
        };
        let found: Vec<Vec<f64>> = found.iter().map(|theta| self.held_at_start(theta, start)).collect();
        found.into_iter().filter(|theta| theta.iter().all(|v| v.is_finite())).collect()
    }
}

/// Return both poses (R, T) of the plane z = 1 whose images have a linear map as derivative where a place comes to lie.
///
/// Seen along the line of sight to that place the derivative is the upper left part of R over the distance: its larger singular value is
/// one over the distance, and unit columns at right angles tell the third row of R up to a sign.
fn poses_of([a, b, c, d]: [f64; 4], from: [f64; 2], to: [f64; 2]) -> Vec<Vec<f64>> {
    // The turn that brings the line of sight onto the axis.
    let (sine, length) = (to[0].hypot(to[1]), to[0].hypot(to[1]).hypot(1.0));
    let angle = sine.atan2(1.0);
    let axis = if sine > 1e-12 { [to[1] / sine * angle, -to[0] / sine * angle, 0.0] } else { [0.0; 3] };
    let turn = rotation_exp(&axis);
    let back = [turn[0], turn[3], turn[6], turn[1], turn[4], turn[7], turn[2], turn[5], turn[8]];
    // Derivative of the turned image by the image: the place comes to (0, 0) at depth `length`.
    let by_image = |i: usize, j: usize| turn[3 * i + j] / length;
    let entry = |i: usize, x: f64, y: f64| by_image(i, 0) * x + by_image(i, 1) * y;
    let seen = [entry(0, a, c), entry(0, b, d), entry(1, a, c), entry(1, b, d)];
    let squares = seen.iter().map(|v| v * v).sum::<f64>();
    let determinant = seen[0] * seen[3] - seen[1] * seen[2];
    let larger = (0.5 * (squares + (squares * squares - 4.0 * determinant * determinant).max(0.0).sqrt())).sqrt();
    let depth = 1.0 / larger;
    let [p, q, r, s] = seen.map(|v| v * depth);
    let (e, f) = ((1.0 - p * p - r * r).max(0.0).sqrt(), (1.0 - q * q - s * s).max(0.0).sqrt());
    let f = if p * q + r * s > 0.0 { -f } else { f };
    [1.0, -1.0]
        .into_iter()
        .map(|side| {
            let (first, second) = ([p, r, side * e], [q, s, side * f]);
            let third = [
                first[1] * second[2] - first[2] * second[1],
                first[2] * second[0] - first[0] * second[2],
                first[0] * second[1] - first[1] * second[0],
            ];
            let columns: [f64; 9] = std::array::from_fn(|k| [first, second, third][k % 3][k / 3]);
            let rotation = multiply3(&back, &columns);
            let centre = [0, 1, 2].map(|i: usize| back[3 * i + 2] * depth);
            let moved = |i: usize| rotation[3 * i] * from[0] + rotation[3 * i + 1] * from[1] + rotation[3 * i + 2];
            rotation.into_iter().chain((0..3).map(|i| centre[i] - moved(i))).collect()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use cfpose::homography::apply;

    #[test]
    fn poses_have_the_derivative_of_the_map_at_the_place() {
        let (from, map, to) = ([0.1, -0.05], [0.5, 0.3, -0.4, 0.7], [0.3, -0.2]);
        for pose in poses_of(map, from, to) {
            let r = &pose[..9];
            let mut h: [f64; 9] = std::array::from_fn(|k| r[k]);
            (0..3).for_each(|i| h[3 * i + 2] += pose[9 + i]);
            let at = |x: f64, y: f64| apply(&h, [from[0] + x, from[1] + y]);
            let (middle, e) = (at(0.0, 0.0), 1e-6);
            assert!((middle[0] - to[0]).abs() < 1e-9 && (middle[1] - to[1]).abs() < 1e-9, "{middle:?}");
            let (x, y) = (at(e, 0.0), at(0.0, e));
            let slopes = [x[0] - middle[0], y[0] - middle[0], x[1] - middle[1], y[1] - middle[1]].map(|v| v / e);
            assert!(slopes.iter().zip(map).all(|(s, m)| (s - m).abs() < 1e-4), "{slopes:?}");
            let norm = |k: usize| (0..3).map(|i| r[3 * i + k].powi(2)).sum::<f64>();
            assert!((0..3).all(|k| (norm(k) - 1.0).abs() < 1e-9));
        }
    }
}
