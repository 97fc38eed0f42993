//! Homographies: decomposition into R, T/d, n, and the units of files.

use cfpose_optim::manifold::{determinant3, multiply3};

use crate::geometry::linalg::symmetric_eigen;

/// A motion and a plane that induce a homography: H = R + (T/d) n'.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlaneMotion {
    /// R, row by row: second camera from first.
    pub rotation: [f64; 9],
    /// T/d: translation in units of the first camera's distance to the plane.
    pub translation: [f64; 3],
    /// Unit normal n of the plane in the first camera's frame, n'X = d > 0.
    pub normal: [f64; 3],
}

/// What a homography says about the motion.
#[derive(Debug, Clone, PartialEq)]
pub struct Decomposition {
    /// The matrix at its true scale: the middle singular value is 1 and the depth at the mean positive.
    pub matrix: [f64; 9],
    /// The motions with the plane in front of the first camera: two, or one where both coincide or T = 0.
    pub solutions: Vec<PlaneMotion>,
    /// Whether the normal is determined; it is not for a pure rotation (T = 0).
    pub normal_determined: bool,
}

/// Relative difference of singular values below which two count as equal.
const EQUAL: f64 = 1e-9;

/// Decompose H (row by row, any scale and sign) into R, T/d, n; `mean` is the mean (x, y, 1) of the source points.
///
/// With H'H = V diag(s_1^2, 1, s_3^2) V', s_1 >= 1 >= s_3, the two unit vectors
/// u = (sqrt(1 - s_3^2) v_1 +- sqrt(s_1^2 - 1) v_3) / sqrt(s_1^2 - s_3^2) are those that H keeps at norm 1 orthogonally to
/// v_2: (v_2, u, v_2 x u) and (H v_2, H u, H v_2 x H u) are frames that R maps onto each other, n = v_2 x u, T/d = (H - R) n.
/// Of each pair (T, n), (-T, -n) the one with n'mean > 0 is returned (cheirality).
///
/// Sources: Ma, Soatto, Kosecka and Sastry, An Invitation to 3-D Vision (2004), theorem 5.19; Zhang and Hanson, 3D
/// reconstruction based on homography mapping (1996).
///
/// *Degenerate when* T = 0 (the normal is undetermined; one solution with T = 0 is returned) and when H is singular.
///
/// ```
/// use cfpose::homography::decompose;
/// use cfpose::theta::rotation_of_euler;
/// let (r, t, n) = (rotation_of_euler(&[0.1, -0.2, 0.3]), [0.4, -0.1, 0.2], [0.0, 0.6, 0.8]);
/// let mut h = r;
/// for i in 0..3 {
///     for k in 0..3 {
///         h[3 * i + k] = -5.0 * (h[3 * i + k] + t[i] * n[k]); // any scale, any sign
///     }
/// }
/// let found = decompose(&h, &[0.1, 0.0, 1.0]);
/// assert_eq!(found.solutions.len(), 2);
/// let near = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(x, y)| (x - y).abs() < 1e-12);
/// assert!(found.solutions.iter().any(|s| near(&s.rotation, &r) && near(&s.translation, &t) && near(&s.normal, &n)));
/// ```
pub fn decompose(h: &[f64; 9], mean: &[f64; 3]) -> Decomposition {
    let depth = h[6] * mean[0] + h[7] * mean[1] + h[8] * mean[2];
    let (squares, axes) = gram_eigen(h);
    let scale = squares[1].max(0.0).sqrt().copysign(depth).recip();
    let matrix = h.map(|value| value * scale);
    let (first, third) = ((squares[0] * scale * scale - 1.0).max(0.0), (1.0 - squares[2] * scale * scale).max(0.0));
    let mut result = Decomposition { matrix, solutions: Vec::new(), normal_determined: true };
    if !matrix.iter().all(|value| value.is_finite()) || determinant3(&matrix).abs() < 1e-12 {
        result.normal_determined = false;
        return result;
    }
    if first + third < EQUAL {
        // A rotation: T = 0, and any normal does.
        let normal = unit(*mean);
        let mut rotation = matrix.to_vec();
        cfpose_optim::manifold::Manifold::project(&cfpose_optim::manifold::Rotation3, &mut rotation);
        let mut motion = PlaneMotion { rotation: matrix, translation: [0.0; 3], normal };
        motion.rotation.copy_from_slice(&rotation);
        result.solutions.push(motion);
        result.normal_determined = false;
        return result;
    }
    let total = (first + third).sqrt();
    let (along_first, along_third) = (third.sqrt() / total, first.sqrt() / total);
    for sign in [1.0, -1.0] {
        let u = [0, 1, 2].map(|i| along_first * axes[0][i] + sign * along_third * axes[2][i]);
        let motion = motion_of(&matrix, axes[1], u, mean);
        let distinct = |other: &PlaneMotion| (0..9).any(|i| (other.rotation[i] - motion.rotation[i]).abs() > 1e-7);
        if result.solutions.iter().all(distinct) {
            result.solutions.push(motion);
        }
    }
    result
}

/// Return R, T/d, n of the plane that contains v_2 and u, which H maps without changing lengths.
fn motion_of(h: &[f64; 9], v2: [f64; 3], u: [f64; 3], mean: &[f64; 3]) -> PlaneMotion {
    let mut normal = cross(v2, u);
    let (image2, image_u) = (times(h, v2), times(h, u));
    let image_n = cross(image2, image_u);
    let mut rotation = [0.0; 9];
    for i in 0..3 {
        for k in 0..3 {
            rotation[3 * i + k] = image2[i] * v2[k] + image_u[i] * u[k] + image_n[i] * normal[k];
        }
    }
    let mut translation = [0.0; 3];
    for i in 0..3 {
        translation[i] = (0..3).map(|k| (h[3 * i + k] - rotation[3 * i + k]) * normal[k]).sum();
    }
    if (0..3).map(|i| normal[i] * mean[i]).sum::<f64>() < 0.0 {
        normal = normal.map(|value| -value);
        translation = translation.map(|value| -value);
    }
    PlaneMotion { rotation, translation, normal }
}

/// Return eigenvalues (descending) and eigenvectors of H'H.
fn gram_eigen(h: &[f64; 9]) -> ([f64; 3], [[f64; 3]; 3]) {
    let mut gram = [[0.0; 3]; 3];
    for i in 0..3 {
        for k in 0..3 {
            gram[i][k] = (0..3).map(|r| h[3 * r + i] * h[3 * r + k]).sum();
        }
    }
    symmetric_eigen(&gram, 3)
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn times(m: &[f64; 9], v: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|i| m[3 * i] * v[0] + m[3 * i + 1] * v[1] + m[3 * i + 2] * v[2])
}

fn unit(v: [f64; 3]) -> [f64; 3] {
    let size = cfpose_optim::manifold::norm3(&v);
    v.map(|value| value / size)
}

/// A pinhole camera: pixel = (fx x + cx, fy y + cy) for the image point (x, y), pixel centres at integers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Intrinsics {
    /// Focal length along x, pixels.
    pub fx: f64,
    /// Focal length along y, pixels.
    pub fy: f64,
    /// Principal point, x, pixels.
    pub cx: f64,
    /// Principal point, y, pixels.
    pub cy: f64,
}

impl Intrinsics {
    /// Return K, row by row: pixel from image point.
    pub fn matrix(&self) -> [f64; 9] {
        [self.fx, 0.0, self.cx, 0.0, self.fy, self.cy, 0.0, 0.0, 1.0]
    }

    /// Return the inverse of K, row by row: image point from pixel.
    pub fn inverse(&self) -> [f64; 9] {
        [self.fx.recip(), 0.0, -self.cx / self.fx, 0.0, self.fy.recip(), -self.cy / self.fy, 0.0, 0.0, 1.0]
    }
}

/// Return a homography between image points as one between the units of the files, last entry 1: K_t H K_s^-1.
///
/// A file without a camera holds image or plane points already. `None` when the last entry vanishes.
///
/// ```
/// use cfpose::homography::{Intrinsics, in_file_units};
/// let camera = Intrinsics { fx: 100.0, fy: 100.0, cx: 50.0, cy: 40.0 };
/// let shift = [1.0, 0.0, 0.1, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]; // x + 0.1
/// let pixels = in_file_units(&shift, Some(&camera), Some(&camera)).unwrap();
/// assert!((pixels[2] - 10.0).abs() < 1e-12 && (pixels[0] - 1.0).abs() < 1e-15);
/// ```
pub fn in_file_units(h: &[f64; 9], source: Option<&Intrinsics>, target: Option<&Intrinsics>) -> Option<[f64; 9]> {
    let mut matrix = *h;
    if let Some(camera) = source {
        matrix = multiply3(&matrix, &camera.inverse());
    }
    if let Some(camera) = target {
        matrix = multiply3(&camera.matrix(), &matrix);
    }
    let last = matrix[8];
    let scaled = matrix.map(|value| value / last);
    scaled.iter().all(|value| value.is_finite()).then_some(scaled)
}

/// Apply a homography (row by row) to an image point; infinite where the depth vanishes.
pub fn apply(h: &[f64; 9], point: [f64; 2]) -> [f64; 2] {
    let y = times(h, [point[0], point[1], 1.0]);
    [y[0] / y[2], y[1] / y[2]]
}
