//! 3D-to-3D: A M + b.

use cfpose_optim::manifold::determinant3;

use super::shared::affine::Affine;
use super::shared::scene;
use crate::geometry::theta::{BlockKind, Layout};
use crate::model::{Findings, LinearGroup, LinearKind, Model, ModelEntry, Scene};

fn examine(scene: &Scene<'_>) -> Findings {
    let mut warnings = scene::spread_warnings(scene.source, 3, 3);
    warnings.extend(scene::reflection_warning(determinant3(scene.theta)));
    let candidates = scene::half_turns(scene.source)
        .iter()
        .map(|turn| {
            let (a, b) = turn.before(&scene.theta[..9], &scene.theta[9..]);
            [a, b].concat()
        })
        .collect();
    Findings { candidates, warnings, ..Findings::default() }
}

pub(super) const ENTRY: ModelEntry = ModelEntry {
    name: "affine3",
    summary: "3-D to 3-D affine map: A M + b",
    parameters: &[],
    source: "the line of Domokos and Hagege on which the paper builds",
    details: "h(M, theta) = A M + b. theta: A row by row (target units per source unit), b (target units). Degenerate when the points lie in a plane (the image of its normal is undetermined), or the cloud is an affine image of one that a rotation leaves unchanged; det A < 0 is a reflection and reported. Converges from 0.2 (entries of A, units of a cloud of unit size); start `whitened-affine` removes that condition.",
    build: |_, _| {
        let layout = Layout::new(&[
            ("matrix", "target per source unit", BlockKind::Vector(9)),
            ("translation", "target units", BlockKind::Vector(3)),
        ]);
        let mut model = Model::new(layout, Affine::<3>);
        model.identity = vec![1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0];
        model.typical = vec![1.2, -0.3, 0.1, 0.4, 0.9, -0.2, 0.0, 0.2, 1.1, 0.1, -0.2, 0.3];
        model.basin.distance = 0.2;
        model.examine = Box::new(examine);
        model.linear = Some(LinearGroup {
            kind: LinearKind::General,
            dim: 3,
            theta: Box::new(|a, b| [&a[..9], &b[..3]].concat()),
        });
        Ok(model)
    },
};
