//! 3D-to-3D: R M + T.

use super::scene;
use crate::model::{Findings, LinearGroup, LinearKind, Map, Model, ModelEntry, Scene};
use crate::points::Points;
use crate::scalar::Scalar;
use crate::theta::Layout;

/// A = R, b = T from ambient theta = (R row by row, T): shared by all models of a 3-D pose.
pub(super) fn pose_affine<S: Scalar>(theta: &[S], a: &mut [S], b: &mut [S]) {
    a.copy_from_slice(&theta[..9]);
    b.copy_from_slice(&theta[9..12]);
}

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

/// Return theta = (R, T, rest) after each half turn of the source about its principal axes, for maps s R M + T.
pub(super) fn half_turned(theta: &[f64], scale: f64, source: &Points) -> Vec<Vec<f64>> {
    scene::half_turns(source)
        .iter()
        .map(|turn| {
            let (rotation, _) = turn.before(&theta[..9], &theta[9..12]);
            let scaled: Vec<f64> = theta[..9].iter().map(|value| scale * value).collect();
            let (_, translation) = turn.before(&scaled, &theta[9..12]);
            [&rotation[..], &translation[..], &theta[12..]].concat()
        })
        .collect()
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
