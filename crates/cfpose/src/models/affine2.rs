//! 2D-to-2D: A p + b.

use super::shared::affine::Affine;
use super::shared::scene;
use crate::geometry::theta::{BlockKind, Layout};
use crate::model::{Findings, LinearGroup, LinearKind, Model, ModelEntry, Scene};

/// Return the half turn of a plane shape, A -> -A about the mean, and what its spread leaves open.
fn examine(scene: &Scene<'_>) -> Findings {
    let (theta, mean) = (scene.theta, scene.source.mean());
    let mut turned: Vec<f64> = theta[..4].iter().map(|value| -value).collect();
    turned.extend((0..2).map(|i| theta[4 + i] + 2.0 * (theta[2 * i] * mean[0] + theta[2 * i + 1] * mean[1])));
    let mut warnings = scene::spread_warnings(scene.source, 2, 2);
    warnings.extend(scene::reflection_warning(theta[0] * theta[3] - theta[1] * theta[2]));
    Findings { candidates: vec![turned], warnings, ..Findings::default() }
}

pub(super) const ENTRY: ModelEntry = ModelEntry {
    name: "affine2",
    summary: "2-D to 2-D affine map: A p + b",
    parameters: &[],
    source: "the line of Domokos and Hagege on which the paper builds",
    details: "h(p, theta) = A p + b. theta: A row by row (target units per source unit), b (target units). Degenerate when the points lie on a line, or the shape is an affine image of one that is unchanged by a rotation (ellipse) or a half turn (parallelogram, listed as an alternative); det A < 0 is a reflection and reported. Converges from 0.2 (entries of A, units of a shape of unit size); start `whitened-affine` removes that condition.",
    build: |_, _| {
        let layout = Layout::new(&[
            ("matrix", "target per source unit", BlockKind::Vector(4)),
            ("translation", "target units", BlockKind::Vector(2)),
        ]);
        let mut model = Model::new(layout, Affine::<2>);
        model.identity = vec![1.0, 0.0, 0.0, 1.0, 0.0, 0.0];
        model.typical = vec![1.2, -0.3, 0.4, 0.9, 0.1, -0.2];
        model.basin.distance = 0.2;
        model.examine = Box::new(examine);
        model.linear = Some(LinearGroup {
            kind: LinearKind::General,
            dim: 2,
            theta: Box::new(|a, b| [&a[..4], &b[..2]].concat()),
        });
        model.homography = Some(|theta| [theta[0], theta[1], theta[4], theta[2], theta[3], theta[5], 0.0, 0.0, 1.0]);
        Ok(model)
    },
};
