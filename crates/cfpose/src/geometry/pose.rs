//! Poses: distance between two of them, and the 4x4 matrix.

use cfpose_optim::manifold::{Manifold, Rotation3, norm3};

use crate::geometry::theta::Layout;

/// A rigid motion `target_from_source`: x -> rotation x + translation.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Pose {
    /// Rotation matrix, row by row.
    pub rotation: [f64; 9],
    /// Translation (units of the source, or depths for `plane-bearing`).
    pub translation: [f64; 3],
}

impl Pose {
    /// Read the pose of a theta whose layout has a `rotation` and a `translation` of 3 numbers.
    pub fn of_theta(layout: &Layout, theta: &[f64]) -> Option<Self> {
        let (rotation, translation) = (layout.range("rotation")?, layout.range("translation")?);
        Some(Self { rotation: theta[rotation].try_into().ok()?, translation: theta[translation].try_into().ok()? })
    }

    /// Return the 4x4 matrix, row by row.
    pub fn matrix(&self) -> [[f64; 4]; 4] {
        let mut matrix = [[0.0; 4]; 4];
        for i in 0..3 {
            matrix[i][..3].copy_from_slice(&self.rotation[3 * i..3 * i + 3]);
            matrix[i][3] = self.translation[i];
        }
        matrix[3][3] = 1.0;
        matrix
    }

    /// Apply the motion to a point.
    pub fn apply(&self, p: [f64; 3]) -> [f64; 3] {
        let mut out = self.translation;
        for i in 0..3 {
            for k in 0..3 {
                out[i] += self.rotation[3 * i + k] * p[k];
            }
        }
        out
    }
}

/// The distance of two poses. Never score a pose by norm(theta - theta*): Euler angles wrap.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PoseError {
    /// Geodesic angle on SO(3), radians.
    pub angle: f64,
    /// Norm of the difference of translations.
    pub translation: f64,
}

impl PoseError {
    /// Compare two poses.
    ///
    /// ```
    /// use cfpose::{Pose, PoseError};
    /// use cfpose::theta::rotation_of_euler;
    /// let a = Pose { rotation: rotation_of_euler(&[0.0, 0.0, 0.3]), translation: [0.4, 0.0, 0.0] };
    /// let b = Pose { rotation: rotation_of_euler(&[0.0; 3]), translation: [0.0; 3] };
    /// let error = PoseError::between(&a, &b);
    /// assert!((error.angle - 0.3).abs() < 1e-15 && (error.total() - 0.5).abs() < 1e-15);
    /// ```
    pub fn between(a: &Pose, b: &Pose) -> Self {
        let mut w = [0.0; 3];
        Rotation3.local(&a.rotation, &b.rotation, &mut w);
        let difference = [0, 1, 2].map(|i| a.translation[i] - b.translation[i]);
        Self { angle: norm3(&w), translation: norm3(&difference) }
    }

    /// Return e = sqrt(angle^2 + translation^2), the measure of success everywhere in this project (e <= 0.1).
    pub fn total(&self) -> f64 {
        self.angle.hypot(self.translation)
    }
}
