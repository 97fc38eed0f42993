//! The unit sphere.

use num_dual::{DualNum, HyperDual64};

use super::{Manifold, norm};

/// The unit sphere S^n in R^(n+1): `UnitSphere(n)`; retraction by normalising x + B d.
///
/// The tangent basis B at x are the columns 2.. of the Householder reflection that sends x to -sign(x_1) e_1:
/// deterministic and smooth away from x_1 = 0.
///
/// ```
/// use cfpose_optim::manifold::{Manifold, UnitSphere};
/// let mut out = [0.0; 3];
/// UnitSphere(2).retract(&[0.0, 0.0, 1.0], &[0.1, 0.0], &mut out);
/// assert!((out.iter().map(|v| v * v).sum::<f64>() - 1.0).abs() < 1e-15);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct UnitSphere(pub usize);

impl UnitSphere {
    /// Return entry (i, j) of the tangent basis at `theta`.
    fn basis_entry(theta: &[f64], sign: f64, i: usize, j: usize) -> f64 {
        // v = x + sign e_1, v'v = 2 (1 + |x_1|), column j + 1 of I - 2 v v' / v'v.
        let vi = if i == 0 { theta[0] + sign } else { theta[i] };
        f64::from(u8::from(i == j + 1)) - vi * theta[j + 1] / (1.0 + theta[0].abs())
    }

    fn sign(theta: &[f64]) -> f64 {
        if theta[0] >= 0.0 { 1.0 } else { -1.0 }
    }
}

impl Manifold for UnitSphere {
    fn ambient(&self) -> usize {
        self.0 + 1
    }
    fn tangent(&self) -> usize {
        self.0
    }
    fn retract(&self, theta: &[f64], step: &[f64], out: &mut [f64]) {
        if step[..self.0].iter().all(|d| *d == 0.0) {
            out[..=self.0].copy_from_slice(&theta[..=self.0]);
            return;
        }
        let sign = Self::sign(theta);
        for i in 0..=self.0 {
            out[i] = theta[i];
            for j in 0..self.0 {
                out[i] += step[j] * Self::basis_entry(theta, sign, i, j);
            }
        }
        self.project(out);
    }
    fn local(&self, from: &[f64], to: &[f64], step: &mut [f64]) {
        // to = (from + B d) / norm, so B'to / (from'to) = d for points of the same hemisphere.
        let sign = Self::sign(from);
        let along: f64 = (0..=self.0).map(|i| from[i] * to[i]).sum();
        for j in 0..self.0 {
            let across: f64 = (0..=self.0).map(|i| Self::basis_entry(from, sign, i, j) * to[i]).sum();
            step[j] = across / along;
        }
    }
    fn lift2(&self, theta: &[f64], step: &[HyperDual64], out: &mut [HyperDual64]) {
        let sign = Self::sign(theta);
        let mut square = HyperDual64::from(0.0);
        for i in 0..=self.0 {
            out[i] = HyperDual64::from(theta[i]);
            for j in 0..self.0 {
                out[i] += step[j] * Self::basis_entry(theta, sign, i, j);
            }
            square += out[i] * out[i];
        }
        let scale = DualNum::recip(&DualNum::sqrt(&square));
        for value in &mut out[..=self.0] {
            *value *= scale;
        }
    }
    fn basis(&self, theta: &[f64], out: &mut [f64]) {
        let sign = Self::sign(theta);
        for i in 0..=self.0 {
            for j in 0..self.0 {
                out[i * self.0 + j] = Self::basis_entry(theta, sign, i, j);
            }
        }
    }
    fn differential(&self, theta: &[f64], step: &[f64], out: &mut [f64]) {
        // y = x + B d, d(y / norm(y)) = (I - u u') B / norm(y) with u = y / norm(y), and B(u)'u = 0.
        let sign = Self::sign(theta);
        let mut reached = vec![0.0; self.0 + 1];
        for i in 0..=self.0 {
            reached[i] = theta[i] + (0..self.0).map(|j| step[j] * Self::basis_entry(theta, sign, i, j)).sum::<f64>();
        }
        let length = norm(&reached);
        reached.iter_mut().for_each(|v| *v /= length);
        let sign_reached = Self::sign(&reached);
        for a in 0..self.0 {
            for b in 0..self.0 {
                let entry = |i| Self::basis_entry(&reached, sign_reached, i, a) * Self::basis_entry(theta, sign, i, b);
                out[a * self.0 + b] = (0..=self.0).map(entry).sum::<f64>() / length;
            }
        }
    }
    fn project(&self, theta: &mut [f64]) {
        let length = norm(&theta[..=self.0]);
        for value in &mut theta[..=self.0] {
            *value /= length;
        }
    }
}
