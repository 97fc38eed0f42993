//! Disturbed starts: turned, tilted, moved and scaled about the pattern's centre.

use cfpose_optim::Manifold;
use cfpose_optim::manifold::{multiply3, rotation_exp};
use rand::RngExt;
use rand_chacha::ChaCha12Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::StandardNormal;

use super::pattern::Pattern;
use super::registrar::Registrar;

/// Standard deviations of a disturbance: angles, radians (in the plane 0.6 of it), and shift as a share of the depth.
const ANGLE: f64 = 0.25;
const SHIFT: f64 = 0.12;

/// Draws starts from a seed.
pub(super) struct Disturbed<'a> {
    registrar: &'a Registrar,
    mean: [f64; 3],
    /// Extent of the pattern on the plane z = 1.
    size: f64,
    /// Area of the pattern there.
    area: f64,
    rng: ChaCha12Rng,
}

impl<'a> Disturbed<'a> {
    pub fn new(registrar: &'a Registrar, pattern: &Pattern, seed: u64) -> Self {
        let points = &pattern.points[0];
        let covariance = points.covariance();
        let size = (covariance[0][0] + covariance[1][1]).sqrt();
        let area = points.weights().iter().sum::<f64>() / pattern.camera.focal().powi(2);
        Self { registrar, mean: points.mean(), size, area, rng: ChaCha12Rng::seed_from_u64(seed) }
    }

    fn normal(&mut self) -> f64 {
        self.rng.sample(StandardNormal)
    }

    /// Return a theta near another; `scale` multiplies the disturbance.
    pub fn near(&mut self, theta: &[f64], scale: f64) -> Vec<f64> {
        let draws: [f64; 6] = std::array::from_fn(|_| self.normal());
        let layout = &self.registrar.model().layout;
        let has_pose = layout.range("rotation") == Some(0..9) && layout.range("translation") == Some(9..12);
        let disturbed = match theta.len() {
            12.. if has_pose => self.pose(theta, &draws, scale),
            9 => self.homography(theta, &draws, scale),
            6 => self.affine(theta, &draws, scale),
            _ => {
                let manifold = layout.manifold();
                let step: Vec<f64> = (0..manifold.tangent()).map(|j| 0.1 * scale * draws[j % draws.len()]).collect();
                let mut out = vec![0.0; theta.len()];
                manifold.retract(theta, &step, &mut out);
                out
            }
        };
        self.registrar.held_at_start(&disturbed, theta)
    }

    /// Return a theta after a turn of the pattern in its plane about its centre, radians.
    pub fn turned(&self, theta: &[f64], angle: f64) -> Vec<f64> {
        let layout = &self.registrar.model().layout;
        let (sine, cosine) = angle.sin_cos();
        let turned = match theta.len() {
            12.. if layout.range("rotation") == Some(0..9) => {
                // The draw of an angle in the plane that `pose` multiplies.
                self.pose(theta, &[0.0, 0.0, angle / (0.6 * ANGLE), 0.0, 0.0, 0.0], 1.0)
            }
            9 => self.homography_by(theta, [cosine, -sine, sine, cosine], [0.0; 2]),
            6 => self.affine_by(theta, [cosine, -sine, sine, cosine], [0.0; 2]),
            _ => theta.to_vec(),
        };
        self.registrar.held_at_start(&turned, theta)
    }

    /// Return a theta of the pattern shifted in its plane; `None` for models that have no such one.
    pub fn shifted(&self, theta: &[f64], shift: [f64; 2]) -> Option<Vec<f64>> {
        let layout = &self.registrar.model().layout;
        let moved = match theta.len() {
            12 if layout.range("rotation") == Some(0..9) && layout.range("translation") == Some(9..12) => {
                let mut out = theta.to_vec();
                (0..3).for_each(|i| out[9 + i] += theta[3 * i] * shift[0] + theta[3 * i + 1] * shift[1]);
                out
            }
            9 => self.homography_by(theta, [1.0, 0.0, 0.0, 1.0], shift),
            6 => {
                let mut out = theta.to_vec();
                (0..2).for_each(|i| out[4 + i] += theta[2 * i] * shift[0] + theta[2 * i + 1] * shift[1]);
                out
            }
            _ => return None,
        };
        Some(self.registrar.held_at_start(&moved, theta))
    }

    /// Return thetas tilted to four sides about the pattern's centre; none for models without a rotation.
    pub fn tilted(&self, theta: &[f64]) -> Vec<Vec<f64>> {
        const SIDES: [[f64; 2]; 4] = [[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]];
        let layout = &self.registrar.model().layout;
        if layout.range("rotation") != Some(0..9) || layout.range("translation") != Some(9..12) {
            return Vec::new();
        }
        let tilted = SIDES.map(|[x, y]| self.pose(theta, &[x, y, 0.0, 0.0, 0.0, 0.0], 0.5));
        tilted.iter().map(|tilted| self.registrar.held_at_start(tilted, theta)).collect()
    }

    /// Move and scale a theta so that the pattern's centre and area are those of the frame's region; fixed parameters stay.
    pub fn centred(&self, theta: &[f64], view: &super::view::View) -> Vec<f64> {
        let target = view.points[0].mean();
        let h = self.registrar.homography(theta);
        let depth = h[6] * self.mean[0] + h[7] * self.mean[1] + h[8];
        let image = cfpose::homography::apply(&h, [self.mean[0], self.mean[1]]);
        // Change of area at the centre, times the reference's, against the frame's.
        let change = cfpose_optim::manifold::determinant3(&h).abs() / depth.abs().powi(3);
        let area = |points: &cfpose::Points, focal: f64| points.weights().iter().sum::<f64>() / focal.powi(2);
        let scale = (area(&view.points[0], view.camera.focal()) / (change * self.area)).sqrt();
        let shift = [target[0] - scale * image[0], target[1] - scale * image[1]];
        let layout = &self.registrar.model().layout;
        let moved: Vec<f64> = match theta.len() {
            12.. if layout.range("rotation") == Some(0..9) => {
                // The centre at depth / scale along its new line of sight.
                let own =
                    |i: usize| (0..3).map(|k| theta[3 * i + k] * [self.mean[0], self.mean[1], 1.0][k]).sum::<f64>();
                let z = depth / scale;
                let centre = [target[0] * z, target[1] * z, z];
                let mut out = theta.to_vec();
                (0..3).for_each(|i| out[9 + i] = centre[i] - own(i));
                out
            }
            9 => {
                let product = multiply3(&[scale, 0.0, shift[0], 0.0, scale, shift[1], 0.0, 0.0, 1.0], theta);
                let norm = product.iter().map(|v| v * v).sum::<f64>().sqrt();
                product.iter().map(|v| v / norm).collect()
            }
            6 => {
                let mut out: Vec<f64> = theta.iter().map(|v| v * scale).collect();
                (0..2).for_each(|d| out[4 + d] += shift[d]);
                out
            }
            _ => theta.to_vec(),
        };
        let moved = self.registrar.held_at_start(&moved, theta);
        if moved.iter().all(|v| v.is_finite()) { moved } else { theta.to_vec() }
    }

    /// Turn about the pattern's centre in the camera's axes, and move that centre.
    fn pose(&self, theta: &[f64], draws: &[f64; 6], scale: f64) -> Vec<f64> {
        let angle = ANGLE * scale;
        let turn = rotation_exp(&[angle * draws[0], angle * draws[1], 0.6 * angle * draws[2]]);
        let rotation = multiply3(&turn, &theta[..9]);
        let point = [self.mean[0], self.mean[1], 1.0];
        let image = |r: &[f64], i: usize| (0..3).map(|k| r[3 * i + k] * point[k]).sum::<f64>();
        let shift = SHIFT * scale;
        let moves = [0.6 * shift * draws[3], 0.6 * shift * draws[4], shift * draws[5]];
        let mut out = rotation.to_vec();
        out.extend((0..3).map(|i| image(theta, i) + theta[9 + i] + moves[i] - image(&rotation, i)));
        out.extend(&theta[12..]);
        out
    }

    /// Disturb a homography by an affine map about the pattern's centre.
    fn homography(&self, theta: &[f64], draws: &[f64; 6], scale: f64) -> Vec<f64> {
        let e = 0.15 * scale;
        let change = [1.0 + e * draws[0], e * draws[1], e * draws[2], 1.0 + e * draws[3]];
        self.homography_by(theta, change, [4, 5].map(|k: usize| 0.4 * self.size * scale * draws[k]))
    }

    /// Apply a linear map about the pattern's centre, and a shift, before a homography.
    fn homography_by(&self, theta: &[f64], [a, b, c, d]: [f64; 4], shift: [f64; 2]) -> Vec<f64> {
        let m = self.mean;
        let matrix = [
            a,
            b,
            m[0] + shift[0] - a * m[0] - b * m[1], //
            c,
            d,
            m[1] + shift[1] - c * m[0] - d * m[1], //
            0.0,
            0.0,
            1.0,
        ];
        let product = multiply3(&theta[..9], &matrix);
        let norm = product.iter().map(|v| v * v).sum::<f64>().sqrt();
        product.iter().map(|v| v / norm).collect()
    }

    /// Disturb an affine map about the pattern's centre.
    fn affine(&self, theta: &[f64], draws: &[f64; 6], scale: f64) -> Vec<f64> {
        let e = 0.25 * scale;
        let change = [1.0 + e * draws[0], e * draws[1], e * draws[2], 1.0 + e * draws[3]];
        self.affine_by(theta, change, [4, 5].map(|k: usize| 0.3 * self.size * scale * draws[k]))
    }

    /// Apply a linear map about the pattern's centre before an affine one, and a shift after it.
    fn affine_by(&self, theta: &[f64], change: [f64; 4], shift: [f64; 2]) -> Vec<f64> {
        let mut out = vec![0.0; 6];
        for i in 0..2 {
            for j in 0..2 {
                out[2 * i + j] = (0..2).map(|k| theta[2 * i + k] * change[2 * k + j]).sum();
            }
            let centre = theta[2 * i] * self.mean[0] + theta[2 * i + 1] * self.mean[1] + theta[4 + i];
            out[4 + i] = centre + shift[i] - out[2 * i] * self.mean[0] - out[2 * i + 1] * self.mean[1];
        }
        out
    }
}
