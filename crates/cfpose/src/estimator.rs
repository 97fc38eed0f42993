//! From two point sets to an estimate: build the parts by name, normalise, choose starts, solve, read off.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use cfpose_optim::{Control, LeastSquares, Observer, Outcome, Status, Stopping};

use crate::block::Transform;
use crate::conditioning::Conditioning;
use crate::entry::{BuildContext, Registry};
use crate::error::Error;
use crate::means::Execution;
use crate::model::{Model, PointKind};
use crate::points::Points;
use crate::problem::{Evaluation, MomentProblem, map_points};
use crate::readout::{Correspondence, correspond, nearest_neighbours};
use crate::start::StartContext;

mod judge;

/// Where a solve begins.
#[derive(Debug, Clone, PartialEq)]
pub enum Start {
    /// A strategy by name.
    Named(String),
    /// Given thetas in ambient coordinates.
    Given(Vec<Vec<f64>>),
}

/// The names of all parts of an estimate, as the command line and experiment files give them.
///
/// ```
/// use cfpose::Settings;
/// let settings = Settings::preset("paper", "plane-bearing").unwrap();
/// assert_eq!(settings.features, "trig18");
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Preset the others come from.
    pub preset: String,
    /// Transformation model.
    pub model: String,
    /// Feature family.
    pub features: String,
    /// Normaliser; `None` leaves it to the model, then to the preset.
    pub normaliser: Option<String>,
    /// Weighting.
    pub weighting: String,
    /// Solver.
    pub solver: String,
    /// Starts.
    pub start: Start,
    /// Tangent columns that are free, `None` for all.
    pub free: Option<Vec<usize>>,
    /// Seed of everything random.
    pub seed: u64,
    /// Stopping rules of the solver.
    pub stopping: Stopping,
}

/// Names of the presets.
pub const PRESETS: &[&str] = &["paper"];

impl Settings {
    /// Fill in a preset for a model. `paper` is exactly the printed method: `trig18`, normaliser `paper`, weighting
    /// `identity`, Levenberg-Marquardt, one start.
    ///
    /// # Errors
    /// [`Error::Build`] for an unknown preset, with suggestions.
    pub fn preset(preset: &str, model: &str) -> Result<Self, Error> {
        if !PRESETS.contains(&preset) {
            return Err(crate::entry::BuildError::from(crate::entry::EntryError::UnknownName {
                kind: "preset",
                name: preset.to_string(),
                suggestions: PRESETS.iter().map(|name| (*name).to_string()).collect(),
            })
            .into());
        }
        Ok(Self {
            preset: preset.to_string(),
            model: model.to_string(),
            features: "trig18".to_string(),
            normaliser: None,
            weighting: "identity".to_string(),
            solver: "levenberg-marquardt".to_string(),
            start: Start::Named("identity".to_string()),
            free: None,
            seed: 0,
            stopping: Stopping::default(),
        })
    }
}

/// A problem with all its parts, before any solving.
pub struct Prepared {
    /// The moment problem.
    pub problem: MomentProblem,
    /// The model, shared with the problem.
    pub model: Arc<Model>,
    /// Starts in ambient coordinates, at least one.
    pub starts: Vec<Vec<f64>>,
    /// Name of the normaliser that was used.
    pub normaliser: String,
    /// The feature-space transform.
    pub transform: Transform,
    /// Source points as the model takes them.
    pub source: Points,
    /// Target points as the model takes them.
    pub target: Points,
    settings: Settings,
}

/// How sure one may be of an estimate.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// The statistics agree with the fit.
    Good,
    /// Usable, but the statistics do not agree.
    Suspect,
    /// Not usable.
    Failed,
}

impl Verdict {
    /// Return the name used in JSON.
    pub fn name(self) -> &'static str {
        match self {
            Verdict::Good => "good",
            Verdict::Suspect => "suspect",
            Verdict::Failed => "failed",
        }
    }
}

/// Another theta that was found or is implied.
#[derive(Debug, Clone, PartialEq)]
pub struct Alternative {
    /// Ambient theta.
    pub theta: Vec<f64>,
    /// Its cost.
    pub cost: f64,
    /// Its verdict, `None` where the weighting has no statistic.
    pub verdict: Option<Verdict>,
}

/// The result of an estimate.
#[derive(Debug, Clone, PartialEq)]
pub struct Estimate {
    /// Best theta, ambient.
    pub theta: Vec<f64>,
    /// Outcome of the best start's solve.
    pub outcome: Outcome,
    /// Number of starts that were solved.
    pub starts: usize,
    /// Residual evaluations over all starts.
    pub evaluations: usize,
    /// Iterations over all starts.
    pub iterations: usize,
    /// Verdict; `None` where the weighting has no statistic, except `Failed`.
    pub verdict: Option<Verdict>,
    /// Other thetas, best first.
    pub alternatives: Vec<Alternative>,
    /// What is degenerate, undetermined, mirrored or ambiguous at theta: one sentence each.
    pub warnings: Vec<String>,
    /// Rank and conditioning of the Jacobian at theta.
    pub conditioning: Conditioning,
}

impl Estimate {
    /// Say whether the estimate may be used.
    pub fn usable(&self) -> bool {
        self.outcome.usable() && self.verdict != Some(Verdict::Failed)
    }
}

/// Cancel flag, deadline and observer of an estimate.
#[derive(Default)]
pub struct Supervision<'a> {
    /// Raised by another thread to stop.
    pub cancel: Option<&'a AtomicBool>,
    /// Wall-clock limit of each solve.
    pub deadline: Option<Duration>,
    /// Sees every iteration.
    pub observer: Option<&'a mut dyn Observer>,
}

/// Bring a point set into the dimension a side takes: z = 1 is added to image and plane points where the model wants it.
pub(crate) fn adapt(side: &'static str, model: &str, kind: PointKind, points: &Points) -> Result<Points, Error> {
    points.require_spread(2).map_err(|problem| Error::Points { side, problem })?;
    let mismatch = |expected: &str| Error::PointDimension {
        side,
        model: model.to_string(),
        expected: expected.to_string(),
        found: points.dim(),
    };
    match (kind, points.dim()) {
        (PointKind::Plain(dim), found) if dim == found => Ok(points.clone()),
        (PointKind::Plain(dim), _) => Err(mismatch(&dim.to_string())),
        (PointKind::Homogeneous, 3) => Ok(points.clone()),
        (PointKind::Homogeneous, 2) => {
            points.with_constant_coordinate(1.0).map_err(|problem| Error::Points { side, problem })
        }
        (PointKind::Homogeneous, _) => Err(mismatch("2 (image or plane points) or 3")),
    }
}

impl Prepared {
    /// Build all parts of an estimate from their names.
    ///
    /// # Errors
    /// [`Error`] for unknown names, and points that do not fit the model.
    pub fn new(
        registry: &Registry,
        settings: &Settings,
        source: &Points,
        target: &Points,
        execution: &Execution,
    ) -> Result<Self, Error> {
        let context = BuildContext { seed: settings.seed, source: Some(source), ..BuildContext::default() };
        let model = Arc::new(registry.model(&settings.model, &context)?);
        let source = adapt("source", &settings.model, model.source_points, source)?;
        let target = adapt("target", &settings.model, model.target_points, target)?;
        if let Some(name) = model.source.attribute().filter(|name| source.attribute(name).is_none()) {
            let problem = format!("model `{}` needs the attribute `{name}` of every source point", settings.model);
            return Err(Error::Unsupported(problem));
        }
        let target_error = |problem| Error::Points { side: "target", problem };
        // The reference theta fixes the statistics of a target side that moves.
        let reference = match &settings.start {
            Start::Given(thetas) if !thetas.is_empty() => thetas[0].clone(),
            _ => model.identity.clone(),
        };
        let lifted = model.target.map().lift(&target);
        let mapped = map_points(model.target.map(), &lifted, &reference, execution).map_err(target_error)?;
        let normaliser_name =
            settings.normaliser.clone().unwrap_or_else(|| model.normaliser.unwrap_or("paper").to_string());
        let transform = registry.normaliser(&normaliser_name)?.fit(&mapped)?;
        let normalised = transform_points(&mapped, &transform).map_err(target_error)?;
        let context = BuildContext { dim: model.dim(), target: Some(&normalised), ..context };
        let family = Arc::from(registry.family(&settings.features, &context)?);
        let mut problem =
            MomentProblem::new(Arc::clone(&model), family, transform, &source, &target, execution.clone());
        if let Some(free) = &settings.free {
            problem = problem.with_model_manifold(Arc::new(crate::free::manifold(&model.layout, free)));
        }
        registry.weighting(&settings.weighting)?;
        let starts = match &settings.start {
            Start::Given(thetas) => thetas.clone(),
            Start::Named(name) => {
                let cost = |theta: &[f64]| {
                    let mut residual = vec![0.0; problem.num_residuals()];
                    problem.residual(theta, &mut residual);
                    cfpose_optim::problem::half_squared_norm(&residual)
                };
                let (model, seed) = (model.as_ref(), settings.seed);
                let context = StartContext { model, source: &source, target: &mapped, cost: &cost, seed };
                registry.start(name)?.starts(&context)?
            }
        };
        let settings = settings.clone();
        Ok(Self { problem, model, starts, normaliser: normaliser_name, transform, source, target, settings })
    }

    /// Evaluate residual, Jacobian and feature means at one theta (ambient), without solving.
    pub fn evaluate(&self, theta: &[f64]) -> Evaluation {
        self.problem.evaluate(theta)
    }

    /// Solve from every start and keep the best; the others that differ become alternatives.
    ///
    /// # Errors
    /// [`Error`] for an unknown solver, fewer features than unknowns, or a start that is no theta; not converging is a status.
    pub fn solve(&self, registry: &Registry, mut supervision: Supervision<'_>) -> Result<Estimate, Error> {
        let solver = registry.solver(match (self.settings.solver.as_str(), self.model.solver) {
            ("levenberg-marquardt", Some(own)) => own,
            (given, _) => given,
        })?;
        self.problem.require_enough_features()?;
        let mut outcomes: Vec<Outcome> = Vec::new();
        for start in &self.starts {
            let mut control = Control {
                stopping: Stopping { deadline: supervision.deadline, ..self.settings.stopping.clone() },
                seed: self.settings.seed,
                cancel: supervision.cancel,
                ..Control::default()
            };
            if let Some(observer) = supervision.observer.as_deref_mut() {
                control.observer = Some(observer);
            }
            outcomes.push(solver.solve(&self.problem, start, &mut control)?);
        }
        let evaluations = outcomes.iter().map(|o| o.counts.residuals).sum();
        let iterations = outcomes.iter().map(|o| o.counts.iterations).sum();
        let rank = |o: &Outcome| if o.cost.is_finite() { o.cost } else { f64::INFINITY };
        outcomes.sort_by(|a, b| rank(a).total_cmp(&rank(b)));
        let mut outcomes = outcomes.into_iter();
        let Some(best) = outcomes.next() else {
            return Err(Error::Unsupported("the start strategy proposed no start".to_string()));
        };
        let failed = !best.usable();
        let judged = self.judge(&best, outcomes);
        Ok(Estimate {
            theta: judged.theta,
            starts: self.starts.len(),
            evaluations,
            iterations,
            verdict: failed.then_some(Verdict::Failed),
            alternatives: judged.alternatives,
            warnings: judged.warnings,
            conditioning: judged.conditioning,
            outcome: best,
        })
    }

    /// Return for each source point the index (from 0) of its nearest target point at theta.
    ///
    /// # Errors
    /// [`Error::Points`] when a mapped point is not finite.
    pub fn correspondence(&self, theta: &[f64]) -> Result<Vec<usize>, Error> {
        let source = self.problem.mapped_source(theta).map_err(|problem| Error::Points { side: "source", problem })?;
        let target = self.problem.mapped_target(theta).map_err(|problem| Error::Points { side: "target", problem })?;
        Ok(nearest_neighbours(&source, &target))
    }

    /// Match the points at theta, one to one for small sets, with statistics of the distances in the feature space.
    ///
    /// `threshold` is the distance up to which a pair is an inlier; `None` takes half the median spacing of the target.
    ///
    /// # Errors
    /// As [`Prepared::correspondence`].
    pub fn matches(&self, theta: &[f64], threshold: Option<f64>) -> Result<Correspondence, Error> {
        let source = self.problem.mapped_source(theta).map_err(|problem| Error::Points { side: "source", problem })?;
        let target = self.problem.mapped_target(theta).map_err(|problem| Error::Points { side: "target", problem })?;
        Ok(correspond(&source, &target, threshold))
    }

    /// Return the homography (row by row) that a theta applies to image or plane points (x, y, 1) of the source, for models
    /// that do; [`crate::homography`] brings it into the units of the files and decomposes it.
    pub fn homography(&self, theta: &[f64]) -> Option<[f64; 9]> {
        self.model.homography.map(|matrix| matrix(theta))
    }

    /// Return the number of free tangent directions.
    pub fn num_unknowns(&self) -> usize {
        self.problem.manifold().tangent()
    }

    /// Return the settings.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }
}

/// Estimate theta in one call.
///
/// ```
/// use cfpose::{Execution, Points, Registry, Settings, estimate};
/// // The motivation example: theta p = q without correspondences gives theta = 1.
/// let p = Points::from_rows(&[[1.0], [2.0], [3.0], [4.0]]).unwrap();
/// let q = Points::from_rows(&[[2.0], [3.0], [1.0], [4.0]]).unwrap();
/// let settings = Settings { features: "coordinates".into(), ..Settings::preset("paper", "gain1").unwrap() };
/// let estimate = estimate(&Registry::default(), &settings, &p, &q, &Execution::default()).unwrap();
/// assert!((estimate.theta[0] - 1.0).abs() < 1e-12);
/// ```
///
/// # Errors
/// As [`Prepared::new`] and [`Prepared::solve`].
pub fn estimate(
    registry: &Registry,
    settings: &Settings,
    source: &Points,
    target: &Points,
    execution: &Execution,
) -> Result<Estimate, Error> {
    Prepared::new(registry, settings, source, target, execution)?.solve(registry, Supervision::default())
}

/// Apply a transform to mapped points.
pub(crate) fn transform_points(points: &Points, transform: &Transform) -> Result<Points, crate::points::PointsError> {
    let rows: Vec<[f64; 3]> = (0..points.len()).map(|k| transform.apply(points.point(k))).collect();
    let columns = (0..points.dim()).map(|d| rows.iter().map(|row| row[d]).collect()).collect();
    Points::weighted(columns, points.weights().to_vec())
}

/// A status that means a limit was reached and not a tolerance.
pub fn is_limit(status: Status) -> bool {
    matches!(status, Status::MaxIterations | Status::MaxEvaluations | Status::Deadline | Status::Cancelled)
}
