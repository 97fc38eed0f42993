//! A transformation model: a turn in the plane, one scale along each axis, a translation. See docs/adding/model.md.

use cfpose::theta::{BlockKind, Layout};
use cfpose::{Map, Model, ModelEntry, Scalar};

/// h(p, theta) = R(angle) diag(scale) p + T, theta = (angle, scale_x, scale_y, T_x, T_y).
struct Stretch2;

impl Map<2, 2, 2> for Stretch2 {
    // Polynomial features then need the points only once.
    const PROJECTION_IS_IDENTITY: bool = true;

    // Once per theta: A and b of y = A p + b. No derivative to write.
    fn affine<S: Scalar>(&self, theta: &[S], a: &mut [S], b: &mut [S]) {
        let (sine, cosine) = theta[0].sin_cos();
        a[0] = cosine * theta[1];
        a[1] = -(sine * theta[2]);
        a[2] = sine * theta[1];
        a[3] = cosine * theta[2];
        b.copy_from_slice(&theta[3..5]);
    }

    // Once per point.
    #[inline(always)]
    fn project<S: Scalar>(&self, y: [S; 2]) -> [S; 2] {
        y
    }
}

/// Return the layout of theta.
pub fn layout() -> Layout {
    Layout::new(&[
        ("angle", "rad", BlockKind::Vector(1)),
        ("scale", "1", BlockKind::Vector(2)),
        ("translation", "target units", BlockKind::Vector(2)),
    ])
}

/// The table line.
pub static ENTRY: ModelEntry = ModelEntry {
    name: "stretch2",
    summary: "planar rotation, one scale per axis, translation",
    parameters: &[],
    source: "own-lab",
    details: "h(p, theta) = R diag(s) p + T. Degenerate when the shape is a circle.",
    build: |_, _| {
        let mut model = Model::new(layout(), Stretch2);
        model.identity = vec![0.0, 1.0, 1.0, 0.0, 0.0]; // the start `identity`
        model.typical = vec![0.2, 1.1, 0.9, 0.1, 0.0]; // where `check` evaluates
        Ok(model)
    },
};
