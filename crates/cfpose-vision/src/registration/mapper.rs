//! Places of a contour under a model, with derivatives by the model's own automatic differentiation.

use std::sync::Arc;

use cfpose::block::{LiftedPoints, MapBlock, Transform};
use cfpose::model::PointKind;
use cfpose::{Isa, Model, Points, PointsError};
use cfpose_optim::Manifold;

/// Points of a block of the kernel.
const BLOCK: usize = cfpose::block::Row::ZERO.0.len();

/// Places that a model maps, lifted once.
pub(super) struct Mapper {
    model: Arc<Model>,
    lifted: LiftedPoints,
    isa: Isa,
}

/// Mapped places.
#[derive(Debug, Clone, Default)]
pub(super) struct Mapped {
    /// x and y on the plane z = 1 of the frame.
    pub x: Vec<[f64; 2]>,
    /// Derivatives, place x 2 x tangent.
    pub dx: Vec<f64>,
    /// Whether the place is in front of the camera.
    pub ahead: Vec<bool>,
}

impl Mapper {
    /// Lift places of the plane z = 1 (or of the plane, for models of plane points).
    pub fn new(model: &Arc<Model>, places: &[[f64; 2]]) -> Result<Self, PointsError> {
        let points = as_model_takes(model, &Points::from_rows(places)?)?;
        Ok(Self { model: Arc::clone(model), lifted: model.source.lift(&points), isa: cfpose::Execution::default().isa })
    }

    /// Map all places; derivatives along the tangent of a manifold where one is given.
    pub fn at(&self, theta: &[f64], manifold: Option<&dyn Manifold>) -> Mapped {
        let tangent = manifold.map_or(0, |manifold| manifold.tangent());
        let mut basis = vec![0.0; theta.len() * tangent];
        if let Some(manifold) = manifold {
            manifold.basis(theta, &mut basis);
        }
        let map = self.model.source.as_ref();
        let prepared = map.prepare(theta, &basis, tangent);
        let count = self.lifted.len;
        let mut block = MapBlock::new(2, tangent);
        let mut mapped = Mapped { dx: vec![0.0; count * 2 * tangent], ..Mapped::default() };
        for start in (0..self.lifted.weights.len()).step_by(BLOCK) {
            map.block(self.isa, &prepared, &Transform::identity(), &self.lifted, start, &mut block);
            for k in 0..BLOCK.min(count.saturating_sub(start)) {
                mapped.x.push([block.x[0].0[k], block.x[1].0[k]]);
                // Derivatives come times the weight, which is 1 in front of the camera and 0 behind it.
                mapped.ahead.push(block.weight.0[k] > 0.0);
                for row in 0..2 * tangent {
                    mapped.dx[(start + k) * 2 * tangent + row] = block.dx[row].0[k];
                }
            }
        }
        mapped
    }
}

/// Add z = 1 where a model wants it.
pub(super) fn as_model_takes(model: &Model, points: &Points) -> Result<Points, PointsError> {
    match model.source_points {
        PointKind::Homogeneous => points.with_constant_coordinate(1.0),
        PointKind::Plain(_) => Ok(points.clone()),
    }
}
