//! 3D-to-3D: s R M + T.

use cfpose_kernel::scalar::Scalar;
use cfpose_optim::manifold::determinant3;

use super::shared::pose3::half_turned;
use super::shared::scene;
use crate::geometry::theta::{BlockKind, Layout};
use crate::model::{Findings, LinearGroup, LinearKind, Map, Model, ModelEntry, Scene};

struct Similarity3;

impl Map<3, 3, 3> for Similarity3 {
    const PROJECTION_IS_IDENTITY: bool = true;
    fn affine<S: Scalar>(&self, theta: &[S], a: &mut [S], b: &mut [S]) {
        for i in 0..9 {
            a[i] = theta[i] * theta[12];
        }
        b.copy_from_slice(&theta[9..12]);
    }
    #[inline(always)]
    fn project<S: Scalar>(&self, y: [S; 3]) -> [S; 3] {
        y
    }
}

fn examine(scene: &Scene<'_>) -> Findings {
    let mut warnings = scene::spread_warnings(scene.source, 3, 2);
    let negative = scene.theta[12] <= 0.0;
    if negative {
        warnings.push(format!("the scale is {:.3}: a mirror image, start elsewhere", scene.theta[12]));
    }
    let candidates = half_turned(scene.theta, scene.theta[12], scene.source);
    Findings { candidates, warnings, implausible: negative, ..Findings::default() }
}

pub(super) const ENTRY: ModelEntry = ModelEntry {
    name: "similarity3",
    summary: "3-D to 3-D similarity: s R M + T",
    parameters: &[],
    source: "the line of Domokos and Hagege on which the paper builds",
    details: "h(M, theta) = s R M + T. theta: rotation vector (rad), translation (units of the target), scale. Degenerate when the cloud is symmetric under a rotation or lies on a line; a scale below 0 is a mirror image and reported. Converges from 0.2 (radians, units of a cloud of unit size, scale); start `pca` or `grid` removes that condition.",
    build: |_, _| {
        let layout = Layout::new(&[
            ("rotation", "rad", BlockKind::Rotation),
            ("translation", "target units", BlockKind::Vector(3)),
            ("scale", "1", BlockKind::Vector(1)),
        ]);
        let mut model = Model::new(layout, Similarity3);
        model.identity[12] = 1.0;
        model.typical = model.identity.clone();
        model.typical[12] = 1.3;
        model.basin.distance = 0.2;
        model.examine = Box::new(examine);
        model.linear = Some(LinearGroup {
            kind: LinearKind::Similarity,
            dim: 3,
            theta: Box::new(|a, b| {
                let scale = determinant3(a).cbrt();
                a.iter().map(|value| value / scale).chain(b.iter().copied()).chain([scale]).collect()
            }),
        });
        Ok(model)
    },
};
