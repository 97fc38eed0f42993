//! The motivation example: scalars with one gain, theta p = q.

use cfpose_kernel::scalar::Scalar;

use crate::geometry::theta::{BlockKind, Layout};
use crate::model::{Map, Model, ModelEntry};

struct Gain;

impl Map<1, 1, 1> for Gain {
    const PROJECTION_IS_IDENTITY: bool = true;
    fn affine<S: Scalar>(&self, theta: &[S], a: &mut [S], _b: &mut [S]) {
        a[0] = theta[0];
    }
    #[inline(always)]
    fn project<S: Scalar>(&self, y: [S; 1]) -> [S; 1] {
        y
    }
}

pub(super) const ENTRY: ModelEntry = ModelEntry {
    name: "gain1",
    summary: "scalars with one gain: theta p = q",
    parameters: &[],
    source: "section III.A, the motivation example",
    details: "h(p, theta) = theta p. theta: gain (1 number). Degenerate when the mean of the source is 0 and only `coordinates` is used. Converges from 0.5.",
    build: |_, _| {
        let mut model = Model::new(Layout::new(&[("gain", "1", BlockKind::Vector(1))]), Gain);
        model.identity = vec![1.0];
        model.typical = vec![1.0];
        model.basin.distance = 0.5;
        Ok(model)
    },
};
