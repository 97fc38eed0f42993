//! Conformance of a model and a family: derivatives against two independent ways, order invariance, lanes against scalars.
//!
//! The same checks serve the test suite, `cfpose check`, and authors of their own entries.

use std::sync::Arc;

use cfpose_kernel::isa::Isa;
use cfpose_kernel::map::Transform;
use cfpose_kernel::means::Execution;
use cfpose_kernel::points::Points;
use cfpose_optim::manifold::Manifold;
use cfpose_optim::problem::LeastSquares;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha12Rng;

use crate::entry::BuildContext;
use crate::error::{Error, Side};
use crate::model::{Model, PointKind};
use crate::problem::{MomentProblem, Noise, Sides, adapt, map_points};
use crate::registry::Registry;

/// Random points and a random theta on which a model can be checked.
pub struct Sample {
    /// The model.
    pub model: Arc<Model>,
    /// Source points.
    pub source: Points,
    /// Target points.
    pub target: Points,
    /// Ambient theta, a random step of length about `spread` from the model's typical theta.
    pub theta: Vec<f64>,
    /// Transform fitted to the target.
    pub transform: Transform,
}

/// Draw points of one side, coordinates uniform in -0.5..0.5, the last one 1 for image and plane points.
fn draw_points(kind: PointKind, count: usize, rng: &mut ChaCha12Rng) -> Result<Points, Error> {
    let (dim, constant) = match kind {
        PointKind::Plain(dim) => (dim, false),
        PointKind::Homogeneous => (2, true),
    };
    let columns = (0..dim).map(|_| (0..count).map(|_| rng.random::<f64>() - 0.5).collect()).collect();
    let points = Points::from_columns(columns);
    let points = if constant { points.and_then(|p| p.with_constant_coordinate(1.0)) } else { points };
    points.map_err(|problem| Error::Points { side: Side::Source, problem })
}

impl Sample {
    /// Draw a sample for a model by name.
    ///
    /// # Errors
    /// [`Error`] when the model cannot be built or maps a point to infinity.
    pub fn draw(registry: &Registry, model: &str, count: usize, spread: f64, seed: u64) -> Result<Self, Error> {
        let model = Arc::new(registry.model(model, &BuildContext { seed, ..BuildContext::default() })?);
        let mut rng = ChaCha12Rng::seed_from_u64(seed);
        let source = draw_points(model.source_points, count, &mut rng)?;
        let target = draw_points(model.target_points, count - count / 10, &mut rng)?;
        let manifold = model.layout.manifold();
        let step: Vec<f64> = (0..manifold.tangent()).map(|_| spread * (rng.random::<f64>() - 0.5)).collect();
        let mut theta = vec![0.0; manifold.ambient()];
        manifold.retract(&model.typical, &step, &mut theta);
        let lifted = model.target.map().lift(&target);
        let mapped = map_points(model.target.map(), &lifted, &theta, &Execution::default())
            .map_err(|problem| Error::Points { side: Side::Target, problem })?;
        let normaliser = model.normaliser.unwrap_or("paper");
        let transform = registry.normaliser(normaliser)?.fit(&mapped)?;
        Ok(Self { model, source, target, theta, transform })
    }

    /// Make a sample of given points: they are the source, and their image at theta the target (the points themselves where
    /// the target side moves).
    ///
    /// # Errors
    /// [`Error`] when the model cannot be built, takes points of another dimension or maps one to infinity.
    pub fn on(registry: &Registry, model: &str, points: &Points, spread: f64, seed: u64) -> Result<Self, Error> {
        let drawn = Self::draw(registry, model, 2, spread, seed)?;
        let source = adapt(Side::Source, model, drawn.model.source_points, &Arc::new(points.clone()))?.as_ref().clone();
        let execution = Execution::default();
        let place = |problem| Error::Points { side: Side::Source, problem };
        let lifted = drawn.model.source.lift(&source);
        let image = map_points(drawn.model.source.as_ref(), &lifted, &drawn.theta, &execution).map_err(place)?;
        let moving = drawn.model.target.is_moving();
        let target = if moving { source.clone() } else { image.clone() };
        let transform = registry.normaliser(drawn.model.normaliser.unwrap_or("paper"))?.fit(&image)?;
        Ok(Self { source, target, transform, ..drawn })
    }

    /// Set up the problem of this sample with a family by name; `None` when the family does not exist in that dimension or
    /// has too few functions for the model.
    ///
    /// # Errors
    /// [`Error`] when the family cannot be built.
    pub fn problem(
        &self,
        registry: &Registry,
        family: &str,
        execution: &Execution,
    ) -> Result<Option<MomentProblem>, Error> {
        let normaliser = registry.normaliser(self.model.normaliser.unwrap_or("paper"))?;
        let (source, target) = (Arc::new(self.source.clone()), Arc::new(self.target.clone()));
        let model = Arc::clone(&self.model);
        let mut sides = Sides::new(model, normaliser.as_ref(), source, target, &self.theta, execution)?;
        // The sample's own: of given points it is that of their image.
        sides.transform = self.transform;
        let family = match sides.family(&BuildContext::default(), |context| registry.family(family, context)) {
            Err(Error::Build(crate::entry::BuildError::Data { .. })) => return Ok(None),
            family => family?,
        };
        let problem = sides.problem(&family, Noise::None, None);
        Ok(problem.require_enough_features().is_ok().then_some(problem))
    }
}

/// Largest relative deviations of one problem at one theta.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DerivativeReport {
    /// Jacobian against central finite differences along the retraction.
    pub finite_difference: f64,
    /// Residual and Jacobian against one long derivative by num-dual through everything.
    pub oracle: f64,
    /// Residual and Jacobian of the other instruction sets against the problem's own.
    pub lanes: f64,
}

/// Compare the Jacobian with finite differences and with num-dual; deviations are relative to the largest entry (at least 1).
///
/// ```
/// use cfpose::check::{Sample, derivatives};
/// use cfpose::{Execution, Registry};
/// let registry = Registry::default();
/// let sample = Sample::draw(&registry, "rigid3", 100, 0.4, 1).unwrap();
/// let problem = sample.problem(&registry, "trig18", &Execution::default()).unwrap().unwrap();
/// let report = derivatives(&problem, &sample.theta);
/// assert!(report.finite_difference < 1e-6 && report.oracle < 1e-12);
/// ```
pub fn derivatives(problem: &MomentProblem, theta: &[f64]) -> DerivativeReport {
    let manifold = problem.manifold();
    let m = manifold.tangent();
    let evaluation = problem.evaluate(theta);
    let scale = |values: &[f64]| values.iter().fold(1.0_f64, |a, b| a.max(b.abs()));
    let jacobian_scale = scale(&evaluation.jacobian);
    let rows = evaluation.residual.len();
    let (mut finite_difference, mut oracle) = (0.0_f64, 0.0_f64);
    let (mut plus, mut minus) = (vec![0.0; rows], vec![0.0; rows]);
    let mut moved = vec![0.0; theta.len()];
    let h = 1e-5;
    for j in 0..m {
        let mut step = vec![0.0; m];
        for (sign, out) in [(h, &mut plus), (-h, &mut minus)] {
            step[j] = sign;
            manifold.retract(theta, &step, &mut moved);
            problem.residual(&moved, out);
        }
        let exact = problem.hyper_residual(theta, j, j);
        for i in 0..rows {
            let entry = evaluation.jacobian[i * m + j];
            let difference = (plus[i] - minus[i]) / (2.0 * h);
            finite_difference = finite_difference.max((difference - entry).abs() / jacobian_scale);
            oracle = oracle.max((exact[i].eps1 - entry).abs() / jacobian_scale);
            oracle = oracle.max((exact[i].re - evaluation.residual[i]).abs() / scale(&evaluation.source_means));
        }
    }
    let mut lanes = 0.0_f64;
    for isa in Isa::available() {
        let other = problem.evaluate_on(theta, isa);
        for (a, b) in evaluation.jacobian.iter().zip(&other.jacobian) {
            lanes = lanes.max((a - b).abs() / jacobian_scale);
        }
        for (a, b) in evaluation.residual.iter().zip(&other.residual) {
            lanes = lanes.max((a - b).abs() / scale(&evaluation.source_means));
        }
    }
    DerivativeReport { finite_difference, oracle, lanes }
}
