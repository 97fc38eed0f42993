//! Rotations of space: SO(3), its exponential and logarithm, quaternions.

use num_dual::HyperDual64;

use super::{Manifold, norm};

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
