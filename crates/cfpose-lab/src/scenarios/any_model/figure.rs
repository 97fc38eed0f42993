//! The shape of a trial: a curve in the plane, a body in space, numbers on a line, a scene before two cameras.

use std::f64::consts::TAU;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use cfpose::entry::{EntryError, Parameters};
use cfpose::model::{Model, PointKind};
use rand::RngExt;
use rand_chacha::ChaCha12Rng;
use rand_distr::StandardNormal;

use crate::curves::{self, PlacedCurve};
use crate::scenario::ScenarioError;
use crate::shapes::{Shape, Source, Star};

/// Seeds of random shapes.
const SEEDS: std::ops::Range<u64> = 1000..1_000_000;
/// Depth of the middle of a scene before two cameras, in baselines, and the spread of its logarithm.
const SCENE: (f64, f64) = (4.0, 0.25);

/// What the source points of a model are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// Numbers.
    Line,
    /// Points of a plane.
    Plane,
    /// Image points (x, y, 1).
    Image,
    /// Points in space.
    Space,
    /// Image points of a scene with depth.
    TwoViews,
}

impl Kind {
    pub(super) fn of(model: &Model) -> Self {
        match (model.source_points, model.target.is_moving()) {
            (_, true) => Kind::TwoViews,
            (PointKind::Homogeneous, _) => Kind::Image,
            (PointKind::Plain(1), _) => Kind::Line,
            (PointKind::Plain(2), _) => Kind::Plane,
            (PointKind::Plain(_), _) => Kind::Space,
        }
    }

    /// Largest coordinate of a curve.
    fn scale(self) -> f64 {
        if matches!(self, Kind::Image | Kind::TwoViews) { 0.5 } else { 1.0 }
    }
}

/// What the parameter `shape` says.
enum Choice {
    Random,
    Curve(Arc<PlacedCurve>),
    Body(Source, Option<Arc<Shape>>),
}

/// The shape of a cell.
pub(super) struct Figure {
    kind: Kind,
    choice: Choice,
    file: Option<PathBuf>,
}

/// The shape of a trial.
pub(super) enum Drawn {
    Curve(Kind, Arc<PlacedCurve>),
    Body(Arc<Shape>),
}

impl Figure {
    pub(super) fn of(parameters: &Parameters, kind: Kind) -> Result<Self, EntryError> {
        let choice = match (parameters.text("shape"), kind) {
            ("random", _) => Choice::Random,
            (_, Kind::Space) => {
                let source = Source::of(parameters)?;
                // A surface from a seed needs no file.
                let shape = if matches!(source, Source::Seed(_)) { source.load(Path::new("")).ok() } else { None };
                Choice::Body(source, shape.map(Arc::new))
            }
            (curve, kind) => Choice::Curve(Arc::new(curves::placed(curve, kind.scale())?)),
        };
        Ok(Self { kind, choice, file: None })
    }

    pub(super) fn load(&mut self, folder: &Path, num_points: usize) -> Result<(), ScenarioError> {
        let Choice::Body(source, shape) = &mut self.choice else { return Ok(()) };
        if shape.is_none() {
            *shape = Some(Arc::new(source.load(folder)?));
            self.file = source.path(folder);
        }
        match shape.as_ref().and_then(|shape| shape.max_points()) {
            Some(most) if most < num_points => Err(ScenarioError::File(format!(
                "points = {num_points}, but the shape's file holds {most} and no faces"
            ))),
            _ => Ok(()),
        }
    }

    pub(super) fn file(&self) -> Option<PathBuf> {
        self.file.clone()
    }

    /// Return the number of coordinates of a source point.
    pub(super) fn dim(&self) -> usize {
        match self.kind {
            Kind::Line => 1,
            Kind::Plane | Kind::Image | Kind::TwoViews => 2,
            Kind::Space => 3,
        }
    }

    /// Return the source point of a point of the scene: its image where there are two views.
    pub(super) fn flat(&self, p: [f64; 3]) -> [f64; 3] {
        if self.kind == Kind::TwoViews { [p[0] / p[2], p[1] / p[2], 0.0] } else { p }
    }

    /// Draw the shape of a trial.
    pub(super) fn drawn(&self, rng: &mut ChaCha12Rng) -> Result<Drawn, ScenarioError> {
        match (&self.choice, self.kind) {
            (Choice::Random, Kind::Space) => Ok(Drawn::Body(Arc::new(Shape::Star(Star::new(rng.random_range(SEEDS)))))),
            (Choice::Random, kind) => {
                let name = format!("fourier[seed={}]", rng.random_range(SEEDS));
                let curve = curves::placed(&name, kind.scale());
                curve
                    .map(|curve| Drawn::Curve(kind, Arc::new(curve)))
                    .map_err(|problem| ScenarioError::Impossible(problem.to_string()))
            }
            (Choice::Curve(curve), kind) => Ok(Drawn::Curve(kind, Arc::clone(curve))),
            (Choice::Body(_, Some(shape)), _) => Ok(Drawn::Body(Arc::clone(shape))),
            (Choice::Body(_, None), _) => Err(ScenarioError::File("shape: its file was not loaded".to_string())),
        }
    }
}

impl Drawn {
    /// Draw points; `varied`: a point is kept with probability (1 + .8 x) / 1.8, x its first coordinate (radius 1), and drawn again
    /// otherwise. Draws: a uniform a point of a curve and, for two views, a normal for its depth; a body's own; a uniform for
    /// the probability.
    pub(super) fn sample(&self, count: usize, varied: bool, rng: &mut ChaCha12Rng) -> Vec<[f64; 3]> {
        let mut points = self.even(count, rng);
        if !varied {
            return points;
        }
        let scale = if let Self::Curve(kind, _) = self { kind.scale() } else { 1.0 };
        let mut kept = Vec::with_capacity(count);
        while kept.len() < count {
            let left = count - kept.len();
            let keep = |p: &[f64; 3], rng: &mut ChaCha12Rng| {
                rng.random::<f64>() * 1.8 < 1.0 + 0.8 * (p[0] / scale).clamp(-1.0, 1.0)
            };
            kept.extend(points.iter().filter(|p| keep(p, rng)).take(left));
            points = self.even(count, rng);
        }
        kept
    }

    fn even(&self, count: usize, rng: &mut ChaCha12Rng) -> Vec<[f64; 3]> {
        let (kind, curve) = match self {
            Self::Body(shape) => return shape.sample(count, rng),
            Self::Curve(kind, curve) => (*kind, curve),
        };
        let mut point = |_| {
            let [x, y] = curve(TAU * rng.random::<f64>());
            match kind {
                // Numbers of mean about 1: a gain has no meaning for a mean of 0.
                Kind::Line => [1.0 + x, 0.0, 0.0],
                Kind::TwoViews => {
                    let depth = SCENE.0 * (SCENE.1 * rng.sample::<f64, _>(StandardNormal)).exp();
                    [depth * x, depth * y, depth]
                }
                _ => [x, y, 0.0],
            }
        };
        (0..count).map(&mut point).collect()
    }
}
