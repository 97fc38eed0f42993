//! What an author of a transformation model writes, and the model that programs use.

use std::sync::Arc;

use cfpose_kernel::map::{DynMap, Factored, General};
use cfpose_kernel::points::Points;

use crate::entry::{BuildContext, BuildError, ParameterSpec, Parameters};
use crate::geometry::theta::Layout;

mod rows;

pub use cfpose_kernel::author::{Identity, Map, PointMap, UnitRay, unit3};
pub use rows::{DynRows, ResidualRows};

/// The target side of a model.
pub enum TargetSide {
    /// g(q) does not depend on theta: its means are computed once.
    Fixed(Box<dyn DynMap>),
    /// g(q, theta) moves with theta (eq. `2dto2d`).
    Moving(Box<dyn DynMap>),
}

/// Which point files a side accepts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PointKind {
    /// Exactly this many coordinates.
    Plain(usize),
    /// Three coordinates, or two to which z = 1 is added (image or plane points).
    Homogeneous,
}

/// A theta that was found, and the points on which it was found.
pub struct Scene<'a> {
    /// Ambient theta.
    pub theta: &'a [f64],
    /// Source points as the model takes them.
    pub source: &'a Points,
    /// Target points as the model takes them.
    pub target: &'a Points,
}

/// What a model knows about a theta beyond its cost.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Findings {
    /// A theta that explains the data equally well and is to be preferred: the canonical form, the scene in front.
    pub theta: Option<Vec<f64>>,
    /// Other thetas that may explain the data as well; whoever asks evaluates their cost.
    pub candidates: Vec<Vec<f64>>,
    /// The scene is behind the camera, seen from its back, or mirrored: a candidate of equal cost is preferred.
    pub implausible: bool,
    /// What is degenerate, undetermined or mirrored: one sentence each.
    pub warnings: Vec<String>,
}

/// A model's own examination of a theta: sign ambiguities, mirror solutions, degenerate scenes.
pub type Examine = Box<dyn Fn(&Scene<'_>) -> Findings + Send + Sync>;

/// Write an affine map, A row by row and b, as ambient theta.
pub type ThetaOfAffine = Box<dyn Fn(&[f64], &[f64]) -> Vec<f64> + Send + Sync>;

/// Return the homography of a theta, row by row.
pub type HomographyOf = fn(&[f64]) -> [f64; 9];

/// Where the documented convergence holds: on clean, permuted points in general position.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Basin {
    /// Feature family.
    pub features: &'static str,
    /// Norm of the tangent step from the truth to the start (radians, and source units for clouds of unit size).
    pub distance: f64,
}

/// Which linear maps A a model x -> A x + b can take.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LinearKind {
    /// Rotations.
    Rotation,
    /// Rotations times a positive scale.
    Similarity,
    /// All matrices.
    General,
}

/// The affine maps that a model contains: start strategies propose A and b and need not know its theta.
pub struct LinearGroup {
    /// Which A the model can take.
    pub kind: LinearKind,
    /// Dimension of x; homogeneous points have one coordinate more.
    pub dim: usize,
    /// Return ambient theta of A (row by row) and b; A is of the kind.
    pub theta: ThetaOfAffine,
}

/// Names of the two relations of a projective model; both have the same theta.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Relations {
    /// Rays on the unit sphere: smooth everywhere, a wide basin.
    pub sphere: String,
    /// The image plane: noise of image points is additive there.
    pub plane: String,
}

/// A built transformation model: the manifold of theta and two maps.
pub struct Model {
    /// Layout of theta and its manifold.
    pub layout: Layout,
    /// h(p, theta).
    pub source: Box<dyn DynMap>,
    /// g(q) or g(q, theta).
    pub target: TargetSide,
    /// Accepted source points.
    pub source_points: PointKind,
    /// Accepted target points.
    pub target_points: PointKind,
    /// Start of the strategy `identity`, ambient.
    pub identity: Vec<f64>,
    /// A generic theta far from every degenerate case, ambient: where checks and benches evaluate.
    pub typical: Vec<f64>,
    /// Normaliser that presets choose instead of their own, where the model needs one.
    pub normaliser: Option<&'static str>,
    /// Levenberg-Marquardt with the parameters that the model needs, used where the solver is named without any.
    pub solver: Option<&'static str>,
    /// The model's own examination of a theta; finds nothing by default.
    pub examine: Examine,
    /// Documented convergence.
    pub basin: Basin,
    /// The affine maps that the model contains.
    pub linear: Option<LinearGroup>,
    /// The homography (row by row, any scale) that a theta applies to points (x, y, 1) of the source, for models that do.
    pub homography: Option<HomographyOf>,
    /// Extra residual rows that belong to the model: bending energy.
    pub regulariser: Option<Arc<dyn DynRows>>,
    /// The two relations of a projective model, as names with parameters: the estimator moves from one to the other.
    pub relations: Option<Relations>,
    /// Equalities that theta must meet, for solvers with constraints: every row 0.
    pub equality: Option<Arc<dyn DynRows>>,
}

impl Model {
    /// Make a model whose target side is the target point itself.
    pub fn new<const POINT: usize, const ROWS: usize, const DIM: usize>(
        layout: Layout,
        source: impl Map<POINT, ROWS, DIM>,
    ) -> Self {
        let target: Box<dyn DynMap> = match DIM {
            1 => Box::new(Factored::<_, 1, 1, 1>::new(Identity)),
            2 => Box::new(Factored::<_, 2, 2, 2>::new(Identity)),
            _ => Box::new(Factored::<_, 3, 3, 3>::new(Identity)),
        };
        Self::from_sides(layout, Box::new(Factored::new(source)), TargetSide::Fixed(target))
    }

    /// Make a model in fully general form whose target side is the target point itself.
    pub fn general<const POINT: usize, const DIM: usize>(layout: Layout, source: impl PointMap<POINT, DIM>) -> Self {
        let target: Box<dyn DynMap> = match DIM {
            1 => Box::new(Factored::<_, 1, 1, 1>::new(Identity)),
            2 => Box::new(Factored::<_, 2, 2, 2>::new(Identity)),
            _ => Box::new(Factored::<_, 3, 3, 3>::new(Identity)),
        };
        Self::from_sides(layout, Box::new(General::new(source)), TargetSide::Fixed(target))
    }

    /// Make a model from erased sides.
    pub fn from_sides(layout: Layout, source: Box<dyn DynMap>, target: TargetSide) -> Self {
        let (source_points, target_points) =
            (PointKind::Plain(source.point_dim()), PointKind::Plain(target.map().point_dim()));
        Self {
            identity: layout.neutral(),
            typical: layout.neutral(),
            layout,
            source,
            target,
            source_points,
            target_points,
            normaliser: None,
            solver: None,
            examine: Box::new(|_| Findings::default()),
            basin: Basin { features: "hermite[degree=3]", distance: 0.1 },
            linear: None,
            homography: None,
            regulariser: None,
            relations: None,
            equality: None,
        }
    }

    /// Replace the target side by a fixed map.
    #[must_use]
    pub fn with_target<const POINT: usize, const ROWS: usize, const DIM: usize>(
        mut self,
        target: impl Map<POINT, ROWS, DIM>,
    ) -> Self {
        self.target = TargetSide::Fixed(Box::new(Factored::new(target)));
        self.target_points = PointKind::Plain(POINT);
        self
    }

    /// Replace the target side by a map that moves with theta.
    #[must_use]
    pub fn with_moving_target<const POINT: usize, const ROWS: usize, const DIM: usize>(
        mut self,
        target: impl Map<POINT, ROWS, DIM>,
    ) -> Self {
        self.target = TargetSide::Moving(Box::new(Factored::new(target)));
        self.target_points = PointKind::Plain(POINT);
        self
    }

    /// State which point files the sides accept.
    #[must_use]
    pub fn with_points(mut self, source: PointKind, target: PointKind) -> Self {
        self.source_points = source;
        self.target_points = target;
        self
    }

    /// Return the dimension of the feature space.
    pub fn dim(&self) -> usize {
        self.source.dim()
    }
}

impl TargetSide {
    /// Return the map.
    pub fn map(&self) -> &dyn DynMap {
        match self {
            TargetSide::Fixed(map) | TargetSide::Moving(map) => map.as_ref(),
        }
    }

    /// Say whether the side moves with theta.
    pub fn is_moving(&self) -> bool {
        matches!(self, TargetSide::Moving(_))
    }
}

/// One line of the model table.
pub struct ModelEntry {
    /// Name, kebab-case, equal to its file name.
    pub name: &'static str,
    /// One line for lists.
    pub summary: &'static str,
    /// Parameters with defaults.
    pub parameters: &'static [ParameterSpec],
    /// Paper equation or reference.
    pub source: &'static str,
    /// Markdown for the generated reference page: formula, theta with units, degenerate cases, distance from which it converges.
    pub details: &'static str,
    /// Build the model.
    pub build: fn(&Parameters, &BuildContext<'_>) -> Result<Model, BuildError>,
}
