//! 2D-to-2D: s R p + T in the plane.

use cfpose_kernel::scalar::Scalar;

use super::shared::pose2::angle_of;
use super::shared::scene;
use crate::geometry::theta::{BlockKind, Layout};
use crate::model::{Findings, LinearGroup, LinearKind, Map, Model, ModelEntry, Scene};

struct Similarity2;

impl Map<2, 2, 2> for Similarity2 {
    const PROJECTION_IS_IDENTITY: bool = true;
    fn affine<S: Scalar>(&self, theta: &[S], a: &mut [S], b: &mut [S]) {
        let (sin, cos) = theta[0].sin_cos();
        let (sin, cos) = (sin * theta[3], cos * theta[3]);
        a.copy_from_slice(&[cos, -sin, sin, cos]);
        b.copy_from_slice(&theta[1..3]);
    }
    #[inline(always)]
    fn project<S: Scalar>(&self, y: [S; 2]) -> [S; 2] {
        y
    }
}

/// Return the same map with scale > 0: in the plane -R is a rotation too.
fn positive(theta: &[f64]) -> Option<Vec<f64>> {
    let turned = theta[0] + std::f64::consts::PI;
    (theta[3] < 0.0).then(|| vec![(turned.sin()).atan2(turned.cos()), theta[1], theta[2], -theta[3]])
}

fn examine(scene: &Scene<'_>) -> Findings {
    let canonical = positive(scene.theta);
    let theta = canonical.as_deref().unwrap_or(scene.theta);
    let mean = scene.source.mean();
    let (sin, cos) = theta[0].sin_cos();
    // s R Q p + T' with Q = -I about the mean m: T' = T + 2 s R m.
    let turned = vec![
        theta[0] + std::f64::consts::PI,
        theta[1] + 2.0 * theta[3] * (cos * mean[0] - sin * mean[1]),
        theta[2] + 2.0 * theta[3] * (sin * mean[0] + cos * mean[1]),
        theta[3],
    ];
    let warnings = scene::spread_warnings(scene.source, 2, 1);
    Findings { candidates: vec![turned], warnings, theta: canonical, ..Findings::default() }
}

pub(super) const ENTRY: ModelEntry = ModelEntry {
    name: "similarity2",
    summary: "2-D to 2-D similarity: s R p + T",
    parameters: &[],
    source: "the line of Domokos and Hagege on which the paper builds",
    details: "h(p, theta) = s R p + T. theta: angle (rad, from x to y), translation (units of the target), scale (reported > 0). Degenerate when the shape is unchanged by a rotation (a disc; the half turn of an even shape is listed as an alternative). Converges from 0.2 (radians, units of a shape of unit size, scale); start `pca` or `grid` removes that condition.",
    build: |_, _| {
        let layout = Layout::new(&[
            ("angle", "rad", BlockKind::Angle),
            ("translation", "target units", BlockKind::Vector(2)),
            ("scale", "1", BlockKind::Vector(1)),
        ]);
        let mut model = Model::new(layout, Similarity2);
        model.identity[3] = 1.0;
        model.typical = vec![0.4, 0.1, -0.2, 1.3];
        model.basin.distance = 0.2;
        model.examine = Box::new(examine);
        model.linear = Some(LinearGroup {
            kind: LinearKind::Similarity,
            dim: 2,
            theta: Box::new(|a, b| vec![angle_of(a), b[0], b[1], (a[0] * a[3] - a[1] * a[2]).abs().sqrt()]),
        });
        model.homography = Some(|theta| {
            let (sin, cos) = theta[0].sin_cos();
            let s = theta[3];
            [s * cos, -s * sin, theta[1], s * sin, s * cos, theta[2], 0.0, 0.0, 1.0]
        });
        Ok(model)
    },
};
