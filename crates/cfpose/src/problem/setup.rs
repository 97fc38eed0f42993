//! Both sides of a problem, made ready once: there is no second way from two point sets to a problem.

use std::sync::Arc;

use crate::entry::BuildContext;
use crate::error::{Error, Side};
use crate::model::{Model, PointKind};
use crate::problem::normalise::Normaliser;
use crate::problem::{MomentProblem, Noise, map_points};
use cfpose_kernel::family::DynFamily;
use cfpose_kernel::map::{LiftedPoints, Transform};
use cfpose_kernel::means::Execution;
use cfpose_kernel::points::{Points, PointsError};
use cfpose_optim::manifold::Manifold;

/// Two point sets as a model takes them, lifted, and the normalised feature space of the target.
///
/// Built once and shared: a clone is a few reference counts, and every problem on the same points takes them from here.
#[derive(Clone)]
pub struct Sides {
    /// The model.
    pub model: Arc<Model>,
    /// Source points as the model takes them.
    pub source: Arc<Points>,
    /// Target points as the model takes them.
    pub target: Arc<Points>,
    /// The target in the feature space, not normalised; of a target that moves, at the reference theta.
    pub mapped_target: Arc<Points>,
    /// The normalisation of the feature space.
    pub transform: Transform,
    lifted_source: Arc<LiftedPoints>,
    lifted_target: Arc<LiftedPoints>,
    execution: Execution,
}

impl Sides {
    /// Make both sides of a model ready. `source` and `target` are as the model takes them; `reference` (ambient) fixes the
    /// statistics of a target side that moves with theta.
    ///
    /// # Errors
    /// [`Error`] for points that the target's map sends to infinity, and a target that cannot be normalised.
    pub fn new(
        model: Arc<Model>,
        normaliser: &dyn Normaliser,
        source: Arc<Points>,
        target: Arc<Points>,
        reference: &[f64],
        execution: &Execution,
    ) -> Result<Self, Error> {
        let lifted_source = Arc::new(model.source.lift(&source));
        let lifted_target = Arc::new(model.target.map().lift(&target));
        let mapped = map_points(model.target.map(), &lifted_target, reference, execution).map_err(of_target)?;
        // Most models compare with the target as it is: one copy is enough.
        let mapped_target = if is_same_place(&mapped, &target) { Arc::clone(&target) } else { Arc::new(mapped) };
        let transform = normaliser.fit(&mapped_target)?;
        let execution = execution.clone();
        Ok(Self { model, source, target, mapped_target, transform, lifted_source, lifted_target, execution })
    }

    /// Build a family for this feature space: some depend on its dimension, some on the normalised target.
    ///
    /// # Errors
    /// What `build` returns, and [`Error::Points`] where a normalised point is not finite.
    pub fn family(
        &self,
        context: &BuildContext<'_>,
        build: impl FnOnce(&BuildContext<'_>) -> Result<Box<dyn DynFamily>, Error>,
    ) -> Result<Arc<dyn DynFamily>, Error> {
        let normalised = transformed(&self.mapped_target, &self.transform).map_err(of_target)?;
        let context = BuildContext { dim: self.model.dim(), target: Some(&normalised), ..*context };
        Ok(Arc::from(build(&context)?))
    }

    /// Set up the problem of a family on these points: noise as nuisance parameters, steps as a manifold of theta says (`None`: the model's).
    pub fn problem(
        &self,
        family: &Arc<dyn DynFamily>,
        noise: Noise,
        manifold: Option<&Arc<dyn Manifold>>,
    ) -> MomentProblem {
        self.assemble(family, noise, manifold, Arc::clone(&self.lifted_source), Arc::clone(&self.lifted_target))
    }

    /// Set up the same problem on other points (as the model takes them) in the same normalised space.
    pub fn problem_on(
        &self,
        family: &Arc<dyn DynFamily>,
        noise: Noise,
        manifold: Option<&Arc<dyn Manifold>>,
        source: &Points,
        target: &Points,
    ) -> MomentProblem {
        let (source, target) = (self.model.source.lift(source), self.model.target.map().lift(target));
        self.assemble(family, noise, manifold, Arc::new(source), Arc::new(target))
    }

    fn assemble(
        &self,
        family: &Arc<dyn DynFamily>,
        noise: Noise,
        manifold: Option<&Arc<dyn Manifold>>,
        source: Arc<LiftedPoints>,
        target: Arc<LiftedPoints>,
    ) -> MomentProblem {
        let (model, family) = (Arc::clone(&self.model), Arc::clone(family));
        let problem = MomentProblem::without_points(model, family, self.transform, self.execution.clone())
            .with_lifted(source, target)
            .with_noise(noise);
        match manifold {
            Some(manifold) => problem.with_model_manifold(Arc::clone(manifold)),
            None => problem,
        }
    }

    /// Return the source, lifted.
    pub(crate) fn lifted_source(&self) -> Arc<LiftedPoints> {
        Arc::clone(&self.lifted_source)
    }

    /// Map all source points into the feature space at theta (the model's own part), not normalised.
    ///
    /// # Errors
    /// [`Error::Points`] when a mapped point is not finite.
    pub fn mapped_source(&self, theta: &[f64]) -> Result<Points, Error> {
        map_points(self.model.source.as_ref(), &self.lifted_source, theta, &self.execution)
            .map_err(|problem| Error::Points { side: Side::Source, problem })
    }

    /// Map all target points into the feature space at theta (the model's own part), not normalised.
    ///
    /// # Errors
    /// As [`Sides::mapped_source`].
    pub fn mapped_target_at(&self, theta: &[f64]) -> Result<Arc<Points>, Error> {
        if !self.model.target.is_moving() {
            return Ok(Arc::clone(&self.mapped_target));
        }
        map_points(self.model.target.map(), &self.lifted_target, theta, &self.execution)
            .map(Arc::new)
            .map_err(of_target)
    }
}

fn of_target(problem: PointsError) -> Error {
    Error::Points { side: Side::Target, problem }
}

/// Say whether two sets have the same coordinates and weights.
fn is_same_place(a: &Points, b: &Points) -> bool {
    a.dim() == b.dim() && (0..a.dim()).all(|d| a.column(d) == b.column(d)) && a.weights() == b.weights()
}

/// Bring a point set into the dimension a side takes: z = 1 is added to image and plane points where the model wants it.
///
/// # Errors
/// [`Error::Points`] for fewer than two distinct points, [`Error::PointDimension`] for another dimension.
pub(crate) fn adapt(side: Side, model: &str, kind: PointKind, points: &Arc<Points>) -> Result<Arc<Points>, Error> {
    points.require_spread(2).map_err(|problem| Error::Points { side, problem })?;
    let mismatch = |expected: &str| Error::PointDimension {
        side,
        model: model.to_string(),
        expected: expected.to_string(),
        found: points.dim(),
    };
    match (kind, points.dim()) {
        (PointKind::Plain(dim), found) if dim == found => Ok(Arc::clone(points)),
        (PointKind::Plain(dim), _) => Err(mismatch(&dim.to_string())),
        (PointKind::Homogeneous, 3) => Ok(Arc::clone(points)),
        (PointKind::Homogeneous, 2) => {
            points.with_constant_coordinate(1.0).map(Arc::new).map_err(|problem| Error::Points { side, problem })
        }
        (PointKind::Homogeneous, _) => Err(mismatch("2 (image or plane points) or 3")),
    }
}

/// Apply a transform to mapped points.
///
/// # Errors
/// [`PointsError`] when a coordinate overflows.
pub(crate) fn transformed(points: &Points, transform: &Transform) -> Result<Points, PointsError> {
    let mut columns = vec![Vec::with_capacity(points.len()); points.dim()];
    for k in 0..points.len() {
        let place = transform.apply(points.point(k));
        columns.iter_mut().zip(place).for_each(|(column, value)| column.push(value));
    }
    Points::weighted(columns, points.weights().to_vec())
}
