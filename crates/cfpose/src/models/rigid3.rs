//! 3D-to-3D: R M + T.

use cfpose_kernel::scalar::Scalar;

use super::shared::pose3::{half_turned, pose_affine};
use super::shared::scene;
use crate::geometry::theta::Layout;
use crate::model::{Findings, LinearGroup, LinearKind, Map, Model, ModelEntry, Scene};

struct Rigid;

impl Map<3, 3, 3> for Rigid {
    const PROJECTION_IS_IDENTITY: bool = true;
    fn affine<S: Scalar>(&self, theta: &[S], a: &mut [S], b: &mut [S]) {
        pose_affine(theta, a, b);
    }
    #[inline(always)]
    fn project<S: Scalar>(&self, y: [S; 3]) -> [S; 3] {
        y
    }
}

fn examine(scene: &Scene<'_>) -> Findings {
    let candidates = half_turned(scene.theta, 1.0, scene.source);
    Findings { candidates, warnings: scene::spread_warnings(scene.source, 3, 2), ..Findings::default() }
}

pub(super) const ENTRY: ModelEntry = ModelEntry {
    name: "rigid3",
    summary: "3-D to 3-D rigid motion: R M + T",
    parameters: &[],
    source: "section II, 3D-to-3D example",
    details: "h(M, theta) = R M + T on SO(3) x R^3. theta: rotation vector (rad), translation (units of the points). Degenerate when the cloud is symmetric under a rotation (sphere, cylinder; half turns about principal axes are listed as alternatives) or lies on a line. Converges from 0.2 (radians and units of a cloud of unit size); start `pca` or `grid` removes that condition.",
    build: |_, _| {
        let mut model = Model::new(Layout::pose3(), Rigid);
        model.basin.distance = 0.2;
        model.examine = Box::new(examine);
        model.linear = Some(LinearGroup {
            kind: LinearKind::Rotation,
            dim: 3,
            theta: Box::new(|a, b| [&a[..9], &b[..3]].concat()),
        });
        Ok(model)
    },
};
