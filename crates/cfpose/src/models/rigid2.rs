//! 2D-to-2D: R p + T in the plane.

use cfpose_kernel::scalar::Scalar;

use super::shared::pose2::angle_of;
use super::shared::scene;
use crate::geometry::theta::{BlockKind, Layout};
use crate::model::{Findings, LinearGroup, LinearKind, Map, Model, ModelEntry, Scene};

struct Rigid2;

impl Map<2, 2, 2> for Rigid2 {
    const PROJECTION_IS_IDENTITY: bool = true;
    fn affine<S: Scalar>(&self, theta: &[S], a: &mut [S], b: &mut [S]) {
        let (sin, cos) = theta[0].sin_cos();
        a.copy_from_slice(&[cos, -sin, sin, cos]);
        b.copy_from_slice(&theta[1..3]);
    }
    #[inline(always)]
    fn project<S: Scalar>(&self, y: [S; 2]) -> [S; 2] {
        y
    }
}

/// Propose the half turn about the mean: shapes of even symmetry cannot tell.
fn examine(scene: &Scene<'_>) -> Findings {
    let mean = scene.source.mean();
    let (sin, cos) = scene.theta[0].sin_cos();
    // R Q p + T' with Q = -I about the mean m: T' = T + 2 R m.
    let turned = vec![
        scene.theta[0] + std::f64::consts::PI,
        scene.theta[1] + 2.0 * (cos * mean[0] - sin * mean[1]),
        scene.theta[2] + 2.0 * (sin * mean[0] + cos * mean[1]),
    ];
    Findings { candidates: vec![turned], warnings: scene::spread_warnings(scene.source, 2, 1), ..Findings::default() }
}

pub(super) const ENTRY: ModelEntry = ModelEntry {
    name: "rigid2",
    summary: "2-D to 2-D rigid motion: R p + T",
    parameters: &[],
    source: "section II, 3D-to-3D example, in the plane",
    details: "h(p, theta) = R p + T on SO(2) x R^2. theta: angle (rad, from x to y), translation (units of the points). Degenerate when the shape is unchanged by a rotation (a disc; the half turn of an even shape is listed as an alternative). Converges from 0.3 (radians and units of a shape of unit size); start `pca` or `grid` removes that condition.",
    build: |_, _| {
        let layout =
            Layout::new(&[("angle", "rad", BlockKind::Angle), ("translation", "source units", BlockKind::Vector(2))]);
        let mut model = Model::new(layout, Rigid2);
        model.typical = vec![0.4, 0.1, -0.2];
        model.basin.distance = 0.3;
        model.examine = Box::new(examine);
        model.linear = Some(LinearGroup {
            kind: LinearKind::Rotation,
            dim: 2,
            theta: Box::new(|a, b| vec![angle_of(a), b[0], b[1]]),
        });
        model.homography = Some(|theta| {
            let (sin, cos) = theta[0].sin_cos();
            [cos, -sin, theta[1], sin, cos, theta[2], 0.0, 0.0, 1.0]
        });
        Ok(model)
    },
};
