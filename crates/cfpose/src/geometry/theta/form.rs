//! The forms in which people write rotations: rotation vector, quaternion, Euler angles in every order.

use std::str::FromStr;

use cfpose_optim::entry::EntryError;
use cfpose_optim::manifold::{quaternion_of, rotation_exp, rotation_log, rotation_of_quaternion};

/// An order of Euler angles: R = R_a(first) R_b(second) R_c(third), angles in radians listed in that order.
///
/// The three axes are those of moving frames, first to last (scipy's upper-case orders). `zyx` with the list reversed is the
/// simulation's R = Rz Ry Rx, which [`RotationForm::Euler`] writes as angles about x, y, z.
///
/// ```
/// use cfpose::theta::EulerOrder;
/// let order: EulerOrder = "zxz".parse().unwrap();
/// let matrix = order.matrix(&[0.3, 0.7, -0.2]);
/// let back = order.angles(&matrix);
/// assert!((back[0] - 0.3).abs() < 1e-15 && (back[1] - 0.7).abs() < 1e-15 && (back[2] + 0.2).abs() < 1e-15);
/// assert_eq!(EulerOrder::all().count(), 12);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct EulerOrder {
    axes: [usize; 3],
}

impl EulerOrder {
    /// The order of the simulation, R = Rz Ry Rx.
    pub const ZYX: EulerOrder = EulerOrder { axes: [2, 1, 0] };

    /// List all twelve orders: six with three different axes, then six that repeat the first.
    pub fn all() -> impl Iterator<Item = EulerOrder> {
        let triples = (0..27).map(|code| [code / 9, code / 3 % 3, code % 3]);
        let proper = |axes: &[usize; 3]| axes[0] != axes[1] && axes[1] != axes[2];
        let (different, repeated): (Vec<_>, Vec<_>) = triples.filter(proper).partition(|axes| axes[0] != axes[2]);
        different.into_iter().chain(repeated).map(|axes| EulerOrder { axes })
    }

    /// Return the three axes (0, 1, 2 for x, y, z), first factor of the product first.
    pub fn axes(&self) -> [usize; 3] {
        self.axes
    }

    /// Return the name: `zyx`, ...
    pub fn name(&self) -> String {
        self.axes.iter().map(|axis| ["x", "y", "z"][*axis]).collect()
    }

    /// Return the third axis k and the sign of the permutation (i, j, k), i and j the first two axes.
    fn frame(&self) -> (usize, f64) {
        let [i, j, _] = self.axes;
        (3 - i - j, if (i + 1) % 3 == j { 1.0 } else { -1.0 })
    }

    /// Return the matrix (row by row) of three angles in radians.
    pub fn matrix(&self, angles: &[f64; 3]) -> [f64; 9] {
        let mut product = axis_rotation(self.axes[0], angles[0]);
        for factor in 1..3 {
            let next = axis_rotation(self.axes[factor], angles[factor]);
            product = cfpose_optim::manifold::multiply3(&product, &next);
        }
        product
    }

    /// Return the angles in radians of a rotation matrix: the inverse of [`EulerOrder::matrix`].
    ///
    /// The middle angle is in -pi/2..=pi/2 for three different axes, in 0..=pi for a repeated one. At gimbal lock, where only
    /// the sum or difference of the outer angles is determined, the third is 0.
    pub fn angles(&self, r: &[f64]) -> [f64; 3] {
        let [i, j, last] = self.axes;
        let (k, sign) = self.frame();
        let at = |row: usize, column: usize| r[3 * row + column];
        let across = at(i, j).hypot(if last == k { at(i, i) } else { at(i, k) });
        // R_ik = sign sin(second) for different axes, R_ii = cos(second) for a repeated one.
        let second = if last == k { (sign * at(i, k)).atan2(across) } else { across.atan2(at(i, i)) };
        if across < 1e-12 {
            return [(sign * at(k, j)).atan2(at(j, j)), second, 0.0];
        }
        if last == k {
            [(-sign * at(j, k)).atan2(at(k, k)), second, (-sign * at(i, j)).atan2(at(i, i))]
        } else {
            [at(j, i).atan2(-sign * at(k, i)), second, at(i, j).atan2(sign * at(i, k))]
        }
    }
}

impl FromStr for EulerOrder {
    type Err = EntryError;

    fn from_str(text: &str) -> Result<Self, EntryError> {
        Self::all().find(|order| order.name() == text).ok_or_else(|| EntryError::BadValue {
            key: "order".to_string(),
            value: text.to_string(),
            problem: "expected three axes, no axis twice in a row: xyz, zyx, zxz, ...".to_string(),
        })
    }
}

/// Return the rotation by an angle in radians about axis 0, 1 or 2, row by row.
fn axis_rotation(axis: usize, angle: f64) -> [f64; 9] {
    let (sin, cos) = angle.sin_cos();
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    let mut r = [0.0; 9];
    r[4 * axis] = 1.0;
    r[4 * u] = cos;
    r[4 * v] = cos;
    r[3 * u + v] = -sin;
    r[3 * v + u] = sin;
    r
}

/// How rotations stand in lists of numbers.
///
/// ```
/// use cfpose::theta::RotationForm;
/// assert_eq!("quaternion".parse::<RotationForm>().unwrap(), RotationForm::Quaternion);
/// assert_eq!("euler-zxz".parse::<RotationForm>().unwrap().name(), "euler-zxz");
/// assert!("euler-xxz".parse::<RotationForm>().is_err());
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum RotationForm {
    /// Rotation vector, radians (3 numbers).
    #[default]
    Vector,
    /// Euler angles about x, y, z in radians with R = Rz Ry Rx (3 numbers), the simulation's order.
    Euler,
    /// Euler angles in another order, listed first factor first (3 numbers).
    EulerIn(EulerOrder),
    /// Unit quaternion w x y z (4 numbers).
    Quaternion,
}

impl RotationForm {
    /// Return the name: `vector`, `euler`, `euler-zxz`, ..., `quaternion`.
    pub fn name(self) -> String {
        match self {
            RotationForm::Vector => "vector".to_string(),
            RotationForm::Euler => "euler".to_string(),
            RotationForm::EulerIn(order) => format!("euler-{}", order.name()),
            RotationForm::Quaternion => "quaternion".to_string(),
        }
    }

    /// Return the number of entries of a rotation in a list: 3 or 4.
    pub fn num_entries(self) -> usize {
        if self == RotationForm::Quaternion { 4 } else { 3 }
    }

    /// Convert the entries of a list (`num_entries()` numbers, a quaternion of any positive norm) into a matrix, row by row.
    pub(crate) fn matrix(self, list: &[f64]) -> [f64; 9] {
        match self {
            RotationForm::Vector => rotation_exp(list),
            RotationForm::Euler => rotation_of_euler(list),
            RotationForm::EulerIn(order) => order.matrix(&[list[0], list[1], list[2]]),
            RotationForm::Quaternion => rotation_of_quaternion(&[list[0], list[1], list[2], list[3]]),
        }
    }

    /// Convert a matrix, row by row, into the entries of a list.
    pub(crate) fn list(self, matrix: &[f64]) -> Vec<f64> {
        match self {
            RotationForm::Vector => rotation_log(matrix).to_vec(),
            RotationForm::Euler => euler_of_rotation(matrix).to_vec(),
            RotationForm::EulerIn(order) => order.angles(matrix).to_vec(),
            RotationForm::Quaternion => quaternion_of(matrix).to_vec(),
        }
    }
}

impl FromStr for RotationForm {
    type Err = EntryError;

    fn from_str(text: &str) -> Result<Self, EntryError> {
        match text {
            "vector" => Ok(RotationForm::Vector),
            "euler" => Ok(RotationForm::Euler),
            "quaternion" => Ok(RotationForm::Quaternion),
            _ => match text.strip_prefix("euler-") {
                Some(order) => Ok(RotationForm::EulerIn(order.parse()?)),
                None => Err(EntryError::BadValue {
                    key: "rotation".to_string(),
                    value: text.to_string(),
                    problem: "expected vector, euler, quaternion or euler-ORDER (euler-zyx, ...)".to_string(),
                }),
            },
        }
    }
}

/// Return the rotation matrix (row by row) of R = Rz Ry Rx, angles about x, y, z in radians.
///
/// ```
/// let r = cfpose::theta::rotation_of_euler(&[0.0, 0.0, 0.1]);
/// assert!((r[3] - 0.1_f64.sin()).abs() < 1e-15);
/// ```
pub fn rotation_of_euler(angles: &[f64]) -> [f64; 9] {
    EulerOrder::ZYX.matrix(&[angles[2], angles[1], angles[0]])
}

/// Return the angles about x, y, z of R = Rz Ry Rx, the middle one in -pi/2..=pi/2; at gimbal lock the x angle is 0.
pub fn euler_of_rotation(r: &[f64]) -> [f64; 3] {
    let [z, y, x] = EulerOrder::ZYX.angles(r);
    [x, y, z]
}
