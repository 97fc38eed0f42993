//! Manifolds: ambient coordinates for storage, tangent coordinates for steps.
//!
//! Each manifold gives a retraction and its second-order Taylor expansion at step 0 over second-order dual numbers, so first
//! *and* second derivatives of any problem flow from tangent seeds by automatic differentiation.

use std::fmt::Debug;
use std::sync::Arc;

use num_dual::{DualNum, HyperDual64};

/// A manifold embedded in ambient coordinates.
pub trait Manifold: Send + Sync + Debug {
    /// Return the number of ambient coordinates.
    fn ambient(&self) -> usize;

    /// Return the dimension of the tangent space.
    fn tangent(&self) -> usize;

    /// Write the point reached from `theta` (ambient) by `step` (tangent); a zero step gives `theta` itself.
    fn retract(&self, theta: &[f64], step: &[f64], out: &mut [f64]);

    /// Write the step that leads from `from` to `to`: the local inverse of [`Manifold::retract`].
    fn local(&self, from: &[f64], to: &[f64], step: &mut [f64]);

    /// Write the second-order Taylor expansion of the retraction at step 0, evaluated at the dual step.
    fn lift2(&self, theta: &[f64], step: &[HyperDual64], out: &mut [HyperDual64]);

    /// Write the derivative of the retraction at step 0 (ambient x tangent, row by row).
    fn basis(&self, theta: &[f64], out: &mut [f64]) {
        basis_by_lift(self, theta, out);
    }

    /// Write the derivative of [`Manifold::retract`] at `step`, in the tangent coordinates of the point reached (tangent x
    /// tangent, row by row): the identity at step 0, and what turns a gradient at the point reached into one with respect to
    /// the step.
    fn differential(&self, theta: &[f64], step: &[f64], out: &mut [f64]) {
        differential_by_differences(self, theta, step, out);
    }

    /// Write the size of `theta` seen along each tangent coordinate, the unit in which a relative step is small: `|theta_j|`
    /// in R^n, by default an equal share of `norm(theta)`.
    fn extent(&self, theta: &[f64], out: &mut [f64]) {
        let m = self.tangent();
        out[..m].fill(norm(&theta[..self.ambient()]) / (m.max(1) as f64).sqrt());
    }

    /// Move ambient coordinates that left the manifold by rounding or input back onto it.
    fn project(&self, theta: &mut [f64]);
}

/// Compute [`Manifold::basis`] from [`Manifold::lift2`]: the reference that overrides are tested against.
pub fn basis_by_lift<M: Manifold + ?Sized>(manifold: &M, theta: &[f64], out: &mut [f64]) {
    let (n, m) = (manifold.ambient(), manifold.tangent());
    let zero = HyperDual64::from(0.0);
    let mut lifted = vec![zero; n];
    for j in 0..m {
        let mut step = vec![zero; m];
        step[j].eps1 = 1.0;
        manifold.lift2(theta, &step, &mut lifted);
        for i in 0..n {
            out[i * m + j] = lifted[i].eps1;
        }
    }
}

/// Compute [`Manifold::differential`] from central differences, extrapolated once: the default, and the reference that
/// overrides are tested against (error about 1e-11).
pub fn differential_by_differences<M: Manifold + ?Sized>(manifold: &M, theta: &[f64], step: &[f64], out: &mut [f64]) {
    let (n, m) = (manifold.ambient(), manifold.tangent());
    let mut centre = vec![0.0; n];
    manifold.retract(theta, step, &mut centre);
    let (mut point, mut moved, mut local) = (vec![0.0; n], step.to_vec(), vec![0.0; m]);
    for j in 0..m {
        let width = 1e-3 * step[j].abs().max(1.0);
        let mut column = vec![0.0; m];
        for (factor, h) in [(4.0 / 3.0, 0.5 * width), (-1.0 / 3.0, width)] {
            for sign in [1.0, -1.0] {
                moved[j] = step[j] + sign * h;
                manifold.retract(theta, &moved, &mut point);
                manifold.local(&centre, &point, &mut local);
                for i in 0..m {
                    column[i] += factor * sign * local[i] / (2.0 * h);
                }
            }
        }
        moved[j] = step[j];
        for i in 0..m {
            out[i * m + j] = column[i];
        }
    }
}

/// Return the norm of a vector.
pub fn norm(v: &[f64]) -> f64 {
    v.iter().map(|a| a * a).sum::<f64>().sqrt()
}

/// Return the norm of a 3-vector.
pub fn norm3(v: &[f64; 3]) -> f64 {
    norm(v)
}

/// R^n with addition.
///
/// ```
/// use cfpose_optim::manifold::{Euclidean, Manifold};
/// let mut out = [0.0; 2];
/// Euclidean(2).retract(&[1.0, 2.0], &[0.5, -1.0], &mut out);
/// assert_eq!(out, [1.5, 1.0]);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Euclidean(pub usize);

impl Manifold for Euclidean {
    fn ambient(&self) -> usize {
        self.0
    }
    fn tangent(&self) -> usize {
        self.0
    }
    fn retract(&self, theta: &[f64], step: &[f64], out: &mut [f64]) {
        for i in 0..self.0 {
            out[i] = theta[i] + step[i];
        }
    }
    fn local(&self, from: &[f64], to: &[f64], step: &mut [f64]) {
        for i in 0..self.0 {
            step[i] = to[i] - from[i];
        }
    }
    fn lift2(&self, theta: &[f64], step: &[HyperDual64], out: &mut [HyperDual64]) {
        for i in 0..self.0 {
            out[i] = step[i] + theta[i];
        }
    }
    fn basis(&self, _theta: &[f64], out: &mut [f64]) {
        for i in 0..self.0 {
            for j in 0..self.0 {
                out[i * self.0 + j] = f64::from(u8::from(i == j));
            }
        }
    }
    fn differential(&self, theta: &[f64], _step: &[f64], out: &mut [f64]) {
        self.basis(theta, out);
    }
    fn extent(&self, theta: &[f64], out: &mut [f64]) {
        for i in 0..self.0 {
            out[i] = theta[i].abs();
        }
    }
    fn project(&self, _theta: &mut [f64]) {}
}

/// SO(3): the ambient coordinates are the rotation matrix row by row, the retraction is `R exp([w])` (right perturbation).
///
/// The matrix is kept inside because a rotation vector breaks at angle pi and under differentiation at 0.
///
/// ```
/// use cfpose_optim::manifold::{Manifold, Rotation3};
/// let identity = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
/// let mut quarter = [0.0; 9];
/// Rotation3.retract(&identity, &[0.0, 0.0, std::f64::consts::FRAC_PI_2], &mut quarter);
/// assert!((quarter[3] - 1.0).abs() < 1e-15); // x axis goes to y axis
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Rotation3;

/// Return a (row by row) times b (row by row), both 3x3.
pub fn multiply3(a: &[f64], b: &[f64]) -> [f64; 9] {
    let mut out = [0.0; 9];
    for i in 0..3 {
        for j in 0..3 {
            out[3 * i + j] = a[3 * i] * b[j] + a[3 * i + 1] * b[3 + j] + a[3 * i + 2] * b[6 + j];
        }
    }
    out
}

/// Return `exp([w])`, the rotation matrix (row by row) of a rotation vector in radians (Rodrigues).
pub fn rotation_exp(w: &[f64]) -> [f64; 9] {
    let angle2 = w[0] * w[0] + w[1] * w[1] + w[2] * w[2];
    let angle = angle2.sqrt();
    // Series below 1e-4: the next terms are under 1e-17 relative.
    let (a, b) = if angle < 1e-4 {
        (1.0 - angle2 / 6.0, 0.5 - angle2 / 24.0)
    } else {
        let half = (0.5 * angle).sin() / (0.5 * angle);
        (angle.sin() / angle, 0.5 * half * half)
    };
    let (x, y, z) = (w[0], w[1], w[2]);
    [
        1.0 - b * (y * y + z * z),
        b * x * y - a * z,
        b * x * z + a * y,
        b * x * y + a * z,
        1.0 - b * (x * x + z * z),
        b * y * z - a * x,
        b * x * z - a * y,
        b * y * z + a * x,
        1.0 - b * (x * x + y * y),
    ]
}

/// Return the rotation vector (radians, angle in 0..=pi) of a rotation matrix: the inverse of [`rotation_exp`].
///
/// Goes through the quaternion of largest component, so it is accurate at angle 0 and at angle pi.
pub fn rotation_log(r: &[f64]) -> [f64; 3] {
    let q = quaternion_of(r);
    let vector_norm = norm(&q[1..]);
    let angle = 2.0 * vector_norm.atan2(q[0]);
    let factor = if vector_norm < 1e-12 { 2.0 / q[0] } else { angle / vector_norm };
    [q[1] * factor, q[2] * factor, q[3] * factor]
}

/// Return the unit quaternion (w, x, y, z), w >= 0, of a rotation matrix.
pub fn quaternion_of(r: &[f64]) -> [f64; 4] {
    let trace = r[0] + r[4] + r[8];
    // Shepperd: divide by the largest of the four components.
    let candidates = [trace, r[0], r[4], r[8]];
    let mut largest = 0;
    for i in 1..4 {
        if candidates[i] > candidates[largest] {
            largest = i;
        }
    }
    let mut q = match largest {
        0 => [1.0 + trace, r[7] - r[5], r[2] - r[6], r[3] - r[1]],
        1 => [r[7] - r[5], 1.0 + 2.0 * r[0] - trace, r[1] + r[3], r[2] + r[6]],
        2 => [r[2] - r[6], r[1] + r[3], 1.0 + 2.0 * r[4] - trace, r[5] + r[7]],
        _ => [r[3] - r[1], r[2] + r[6], r[5] + r[7], 1.0 + 2.0 * r[8] - trace],
    };
    let scale = norm(&q).copysign(q[0]).recip();
    for value in &mut q {
        *value *= scale;
    }
    q
}

/// Return the rotation matrix (row by row) of a quaternion (w, x, y, z) of any positive norm.
pub fn rotation_of_quaternion(q: &[f64; 4]) -> [f64; 9] {
    let scale = norm(q).recip();
    let [w, x, y, z] = q.map(|v| v * scale);
    [
        1.0 - 2.0 * (y * y + z * z),
        2.0 * (x * y - w * z),
        2.0 * (x * z + w * y),
        2.0 * (x * y + w * z),
        1.0 - 2.0 * (x * x + z * z),
        2.0 * (y * z - w * x),
        2.0 * (x * z - w * y),
        2.0 * (y * z + w * x),
        1.0 - 2.0 * (x * x + y * y),
    ]
}

impl Manifold for Rotation3 {
    fn ambient(&self) -> usize {
        9
    }
    fn tangent(&self) -> usize {
        3
    }
    fn retract(&self, theta: &[f64], step: &[f64], out: &mut [f64]) {
        if step[..3] == [0.0; 3] {
            out[..9].copy_from_slice(&theta[..9]);
            return;
        }
        out[..9].copy_from_slice(&multiply3(theta, &rotation_exp(step)));
        // A thousand products drift off SO(3) by 1e-13: stay on it.
        self.project(out);
    }
    fn local(&self, from: &[f64], to: &[f64], step: &mut [f64]) {
        let transposed = [from[0], from[3], from[6], from[1], from[4], from[7], from[2], from[5], from[8]];
        step[..3].copy_from_slice(&rotation_log(&multiply3(&transposed, to)));
    }
    fn lift2(&self, theta: &[f64], step: &[HyperDual64], out: &mut [HyperDual64]) {
        // I + [w] + 1/2 [w]^2, exact to second order at w = 0.
        let zero = HyperDual64::from(0.0);
        let skew = [[zero, -step[2], step[1]], [step[2], zero, -step[0]], [-step[1], step[0], zero]];
        let mut exp = [[zero; 3]; 3];
        for i in 0..3 {
            for j in 0..3 {
                let mut square = zero;
                for k in 0..3 {
                    square += skew[i][k] * skew[k][j];
                }
                exp[i][j] = skew[i][j] + square * 0.5 + f64::from(u8::from(i == j));
            }
        }
        for i in 0..3 {
            for j in 0..3 {
                out[3 * i + j] = exp[0][j] * theta[3 * i] + exp[1][j] * theta[3 * i + 1] + exp[2][j] * theta[3 * i + 2];
            }
        }
    }
    fn basis(&self, theta: &[f64], out: &mut [f64]) {
        // d R[w]/dw_j: column c of R goes to column a with sign of the skew matrix.
        for i in 0..3 {
            let r = &theta[3 * i..3 * i + 3];
            let rows = [[0.0, -r[2], r[1]], [r[2], 0.0, -r[0]], [-r[1], r[0], 0.0]];
            for (j, row) in rows.iter().enumerate() {
                out[(3 * i + j) * 3..(3 * i + j) * 3 + 3].copy_from_slice(row);
            }
        }
    }
    fn differential(&self, _theta: &[f64], step: &[f64], out: &mut [f64]) {
        // Right Jacobian: I - (1 - cos a) / a^2 [w] + (a - sin a) / a^3 [w]^2.
        let (x, y, z) = (step[0], step[1], step[2]);
        let square = x * x + y * y + z * z;
        let angle = square.sqrt();
        let (a, b) = if angle < 1e-2 {
            // Series: the next terms are under 1e-16.
            let (s2, s4) = (square, square * square);
            (0.5 - s2 / 24.0 + s4 / 720.0, 1.0 / 6.0 - s2 / 120.0 + s4 / 5040.0)
        } else {
            ((1.0 - angle.cos()) / square, (angle - angle.sin()) / (square * angle))
        };
        let diagonal = |v: f64| 1.0 + b * (v * v - square);
        out[..9].copy_from_slice(&[
            diagonal(x),
            a * z + b * x * y,
            -a * y + b * x * z,
            -a * z + b * x * y,
            diagonal(y),
            a * x + b * y * z,
            a * y + b * x * z,
            -a * x + b * y * z,
            diagonal(z),
        ]);
    }
    fn project(&self, theta: &mut [f64]) {
        // Two Newton steps towards the orthogonal factor of the polar decomposition, after a quaternion for far input.
        let matrix = if orthogonality_error(theta) < 0.1 && determinant3(theta) > 0.0 {
            let mut m = [0.0; 9];
            m.copy_from_slice(&theta[..9]);
            m
        } else {
            rotation_of_quaternion(&quaternion_of(theta))
        };
        let mut r = matrix;
        for _ in 0..3 {
            if orthogonality_error(&r) < 1e-16 {
                break;
            }
            r = newton_polar_step(&r);
        }
        theta[..9].copy_from_slice(&r);
    }
}

/// Return max |R R' - I|.
fn orthogonality_error(r: &[f64]) -> f64 {
    let mut worst = 0.0_f64;
    for i in 0..3 {
        for j in 0..=i {
            let dot = r[3 * i] * r[3 * j] + r[3 * i + 1] * r[3 * j + 1] + r[3 * i + 2] * r[3 * j + 2];
            worst = worst.max((dot - f64::from(u8::from(i == j))).abs());
        }
    }
    worst
}

/// Return the determinant of a 3x3 matrix (row by row).
pub fn determinant3(r: &[f64]) -> f64 {
    r[0] * (r[4] * r[8] - r[5] * r[7]) - r[1] * (r[3] * r[8] - r[5] * r[6]) + r[2] * (r[3] * r[7] - r[4] * r[6])
}

/// Return (3 R - R R' R) / 2, quadratically convergent to the nearest rotation.
fn newton_polar_step(r: &[f64; 9]) -> [f64; 9] {
    let transposed = [r[0], r[3], r[6], r[1], r[4], r[7], r[2], r[5], r[8]];
    let cubic = multiply3(&multiply3(r, &transposed), r);
    let mut out = [0.0; 9];
    for i in 0..9 {
        out[i] = 1.5 * r[i] - 0.5 * cubic[i];
    }
    out
}

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

/// The product of manifolds: ambient and tangent coordinates one after the other.
///
/// ```
/// use std::sync::Arc;
/// use cfpose_optim::manifold::{Euclidean, Manifold, Product, Rotation3};
/// let pose = Product::new(vec![Arc::new(Rotation3), Arc::new(Euclidean(3))]);
/// assert_eq!((pose.ambient(), pose.tangent()), (12, 6));
/// ```
#[derive(Debug, Clone)]
pub struct Product {
    factors: Vec<Arc<dyn Manifold>>,
}

/// Ambient and tangent ranges of one factor.
struct Part<'a> {
    factor: &'a dyn Manifold,
    ambient: std::ops::Range<usize>,
    tangent: std::ops::Range<usize>,
}

impl Product {
    /// Join manifolds in order.
    pub fn new(factors: Vec<Arc<dyn Manifold>>) -> Self {
        Self { factors }
    }

    /// Return the factors.
    pub fn factors(&self) -> &[Arc<dyn Manifold>] {
        &self.factors
    }

    fn parts(&self) -> impl Iterator<Item = Part<'_>> {
        self.factors.iter().scan((0, 0), |(a, t), factor| {
            let part = Part {
                factor: factor.as_ref(),
                ambient: *a..*a + factor.ambient(),
                tangent: *t..*t + factor.tangent(),
            };
            *a += factor.ambient();
            *t += factor.tangent();
            Some(part)
        })
    }
}

impl Manifold for Product {
    fn ambient(&self) -> usize {
        self.factors.iter().map(|f| f.ambient()).sum()
    }
    fn tangent(&self) -> usize {
        self.factors.iter().map(|f| f.tangent()).sum()
    }
    fn retract(&self, theta: &[f64], step: &[f64], out: &mut [f64]) {
        for p in self.parts() {
            p.factor.retract(&theta[p.ambient.clone()], &step[p.tangent], &mut out[p.ambient]);
        }
    }
    fn local(&self, from: &[f64], to: &[f64], step: &mut [f64]) {
        for p in self.parts() {
            p.factor.local(&from[p.ambient.clone()], &to[p.ambient], &mut step[p.tangent]);
        }
    }
    fn lift2(&self, theta: &[f64], step: &[HyperDual64], out: &mut [HyperDual64]) {
        for p in self.parts() {
            p.factor.lift2(&theta[p.ambient.clone()], &step[p.tangent], &mut out[p.ambient]);
        }
    }
    fn basis(&self, theta: &[f64], out: &mut [f64]) {
        let m = self.tangent();
        out[..self.ambient() * m].fill(0.0);
        // Solvers ask for it at every step: a rotation's basis needs no allocation.
        let (mut small, mut large) = ([0.0; 27], Vec::new());
        for p in self.parts() {
            let width = p.tangent.len();
            let size = p.ambient.len() * width;
            let local = if size <= small.len() {
                &mut small[..size]
            } else {
                large.resize(size, 0.0);
                &mut large[..]
            };
            p.factor.basis(&theta[p.ambient.clone()], local);
            for (i, row) in p.ambient.enumerate() {
                out[row * m + p.tangent.start..row * m + p.tangent.end]
                    .copy_from_slice(&local[i * width..(i + 1) * width]);
            }
        }
    }
    fn differential(&self, theta: &[f64], step: &[f64], out: &mut [f64]) {
        let m = self.tangent();
        out[..m * m].fill(0.0);
        let mut local = Vec::new();
        for p in self.parts() {
            let width = p.tangent.len();
            local.resize(width * width, 0.0);
            p.factor.differential(&theta[p.ambient], &step[p.tangent.clone()], &mut local);
            for (i, row) in p.tangent.clone().enumerate() {
                out[row * m + p.tangent.start..row * m + p.tangent.end]
                    .copy_from_slice(&local[i * width..(i + 1) * width]);
            }
        }
    }
    fn extent(&self, theta: &[f64], out: &mut [f64]) {
        for p in self.parts() {
            p.factor.extent(&theta[p.ambient], &mut out[p.tangent]);
        }
    }
    fn project(&self, theta: &mut [f64]) {
        for p in self.parts() {
            p.factor.project(&mut theta[p.ambient]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check_basis(manifold: &dyn Manifold, theta: &[f64]) {
        let size = manifold.ambient() * manifold.tangent();
        let (mut direct, mut lifted) = (vec![0.0; size], vec![0.0; size]);
        manifold.basis(theta, &mut direct);
        basis_by_lift(manifold, theta, &mut lifted);
        for (a, b) in direct.iter().zip(&lifted) {
            assert!((a - b).abs() < 1e-14, "{direct:?} {lifted:?}");
        }
    }

    #[test]
    fn direct_bases_equal_the_dual_lift() {
        check_basis(&Rotation3, &rotation_exp(&[0.3, -0.8, 2.0]));
        for x in [[0.6, 0.0, 0.8], [-0.6, 0.48, 0.64], [0.0, 1.0, 0.0]] {
            check_basis(&UnitSphere(2), &x);
        }
        let product = Product::new(vec![Arc::new(Rotation3), Arc::new(UnitSphere(2)), Arc::new(Euclidean(1))]);
        let mut theta = rotation_exp(&[1.0, 0.2, -0.4]).to_vec();
        theta.extend([0.36, 0.48, -0.8, 7.0]);
        check_basis(&product, &theta);
    }

    #[test]
    fn direct_differentials_equal_differences() {
        let product = Product::new(vec![Arc::new(Rotation3), Arc::new(UnitSphere(2)), Arc::new(Euclidean(1))]);
        let mut theta = rotation_exp(&[1.0, 0.2, -0.4]).to_vec();
        theta.extend([0.36, 0.48, -0.8, 7.0]);
        for scale in [0.0, 1e-3, 0.02, 0.7, 1.5] {
            let step = [0.5, -0.7, 0.3, 0.9, -0.4, 2.0].map(|d| d * scale);
            let (mut direct, mut numeric) = ([0.0; 36], [0.0; 36]);
            product.differential(&theta, &step, &mut direct);
            differential_by_differences(&product, &theta, &step, &mut numeric);
            for (a, b) in direct.iter().zip(&numeric) {
                assert!((a - b).abs() < 1e-10, "{scale}: {direct:?} {numeric:?}");
            }
        }
    }

    #[test]
    fn rotation_vector_survives_the_whole_range_of_angles() {
        for angle in [0.0, 1e-9, 1e-5, 0.5, 2.0, 3.0, std::f64::consts::PI - 1e-9, std::f64::consts::PI] {
            let axis = [0.36, -0.48, 0.8];
            let w = axis.map(|a| a * angle);
            let back = rotation_exp(&rotation_log(&rotation_exp(&w)));
            for (a, b) in back.iter().zip(&rotation_exp(&w)) {
                assert!((a - b).abs() < 2e-15, "angle {angle}");
            }
        }
    }
}
