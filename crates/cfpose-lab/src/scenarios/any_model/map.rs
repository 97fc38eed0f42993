//! A model as a map from a scene to an image.

use cfpose::model::{Model, PointKind};
use cfpose::problem::map_points;
use cfpose::{BuildContext, Execution, Points, Registry, Side};

use crate::scenario::ScenarioError;

/// Points that a transfer error is taken over.
const TRANSFERRED: usize = 1000;

/// A model on given source points, and the same in the relation that gives image points.
pub(super) struct View {
    pub model: Model,
    /// The image-plane relation, where the model itself gives rays.
    plane: Option<Model>,
}

impl View {
    /// Build the model; some depend on the source points.
    pub(super) fn new(registry: &Registry, name: &str, source: &Points) -> Result<Self, ScenarioError> {
        let context = BuildContext { source: Some(source), ..BuildContext::default() };
        let build = |name: &str| {
            registry.model(name, &context).map_err(|problem| ScenarioError::Impossible(problem.to_string()))
        };
        let model = build(name)?;
        let plane = model.relations.as_ref().map(|relations| build(&relations.plane)).transpose()?;
        Ok(Self { model, plane })
    }

    fn drawing(&self) -> &Model {
        self.plane.as_ref().unwrap_or(&self.model)
    }

    /// Return the number of coordinates of an image point.
    pub(super) fn target_dim(&self) -> usize {
        if self.model.target.is_moving() { 2 } else { self.drawing().dim() }
    }

    /// Say whether the target lies in the space of the source, so that both are moved by an offset.
    pub(super) fn moves_target(&self) -> bool {
        self.plane.is_none() && self.model.linear.is_some()
    }

    /// Return the images of points of the scene; `None` where one has none.
    pub(super) fn image(&self, theta: &[f64], scene: &[[f64; 3]]) -> Option<Vec<[f64; 3]>> {
        if self.model.target.is_moving() {
            return scene.iter().map(|p| second_view(theta, p)).collect();
        }
        let dim = match self.model.source_points {
            PointKind::Plain(dim) => dim,
            PointKind::Homogeneous => 2,
        };
        self.images_of(theta, &points(Side::Source, scene, dim).ok()?)
    }

    fn images_of(&self, theta: &[f64], source: &Points) -> Option<Vec<[f64; 3]>> {
        let map = self.drawing().source.as_ref();
        let adapted = match map.point_dim() > source.dim() {
            true => &source.with_constant_coordinate(1.0).ok()?,
            false => source,
        };
        let mapped = map_points(map, &map.lift(adapted), theta, &Execution::default()).ok()?;
        // A point behind the camera has weight 0.
        mapped.weights().iter().all(|w| *w > 0.0).then(|| mapped.rows())
    }

    /// Return the root mean square distance of the images of the source under two thetas, in sizes of the image under the second.
    pub(super) fn transfer(&self, estimate: &[f64], truth: &[f64], source: &Points) -> Option<f64> {
        let first: Vec<usize> = (0..source.len().min(TRANSFERRED)).collect();
        let few = source.select(&first).ok()?;
        let (a, b) = (self.images_of(estimate, &few)?, self.images_of(truth, &few)?);
        let square = |p: &[f64; 3], q: &[f64; 3]| (0..3).map(|d| (p[d] - q[d]).powi(2)).sum::<f64>();
        let mean = a.iter().zip(&b).map(|(p, q)| square(p, q)).sum::<f64>() / a.len() as f64;
        Some(mean.sqrt() / size(&b, self.target_dim())).filter(|value| value.is_finite())
    }

    /// Return thetas that give the same image of every point: the second decomposition of a plane's homography.
    pub(super) fn equally_true(&self, theta: &[f64]) -> Vec<Vec<f64>> {
        let (Some(homography), Some(_)) = (self.model.homography, self.model.layout.range("normal")) else {
            return Vec::new();
        };
        let solutions = cfpose::homography::decompose(&homography(theta), &[0.0, 0.0, 1.0]).solutions;
        solutions.iter().map(|s| [&s.rotation[..], &s.translation[..], &s.normal[..]].concat()).collect()
    }
}

/// Return the image of a point of the scene in the second camera.
fn second_view(theta: &[f64], p: &[f64; 3]) -> Option<[f64; 3]> {
    let row = |i: usize| theta[9 + i] + (0..3).map(|k| theta[3 * i + k] * p[k]).sum::<f64>();
    let z = row(2);
    (z > 0.1).then(|| [row(0) / z, row(1) / z, 0.0])
}

/// Make points of the first `dim` coordinates.
pub(super) fn points(side: Side, rows: &[[f64; 3]], dim: usize) -> Result<Points, ScenarioError> {
    let columns = (0..dim).map(|d| rows.iter().map(|row| row[d]).collect()).collect();
    Points::from_columns(columns).map_err(|problem| ScenarioError::Points { side, problem })
}

/// Return the root mean square distance of points from their mean.
pub(super) fn size(rows: &[[f64; 3]], dim: usize) -> f64 {
    let count = rows.len().max(1) as f64;
    let variance = |d: usize| {
        let mean = rows.iter().map(|p| p[d]).sum::<f64>() / count;
        rows.iter().map(|p| (p[d] - mean).powi(2)).sum::<f64>() / count
    };
    (0..dim).map(variance).sum::<f64>().sqrt()
}
