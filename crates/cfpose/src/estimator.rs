//! From two point sets to an estimate: build the parts by name, normalise, choose starts, solve, read off.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use cfpose_kernel::map::Transform;
use cfpose_kernel::means::Execution;
use cfpose_kernel::points::Points;
use cfpose_optim::{Control, LeastSquares, Observer, Outcome, Status, Stopping};

use crate::distances::correspondence::{Correspondence, correspond, nearest_neighbours};
use crate::distances::sampling::Sampling;
use crate::distances::support::Support;
use crate::entry::BuildContext;
use crate::error::Error;
use crate::model::{Model, PointKind};
use crate::problem::{Evaluation, MomentProblem, map_points};
use crate::registry::Registry;
use crate::start::StartContext;
use crate::statistics::Statistics;
use crate::statistics::conditioning::Conditioning;

mod auto;
mod clusters;
mod continuous;
mod engine;
mod judge;
mod level;
mod overlap;
mod pipeline;
mod repair;
mod run;
mod schedule;

pub use engine::StageReport;
pub use pipeline::{NoiseModel, Outliers, Pipeline, Stage};

/// The word that leaves a choice to the preset.
const AUTO: &str = "auto";

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
    /// How the two sets were sampled; `None` finds out by distances between the points, never from the residual.
    pub sampling: Option<Sampling>,
    /// Stages and what surrounds them; `None` leaves them to the preset and the model.
    pub pipeline: Option<Pipeline>,
}

/// Names of the presets.
pub const PRESETS: &[&str] = &["auto", "paper"];

impl Settings {
    /// Fill in a preset for a model. `paper` is exactly the printed method: `trig18`, normaliser `paper`, weighting
    /// `identity`, Levenberg-Marquardt, one start. `auto` leaves features, weighting and starts to the model's pipeline.
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
        let choose = |paper: &str| if preset == "auto" { AUTO.to_string() } else { paper.to_string() };
        Ok(Self {
            preset: preset.to_string(),
            model: model.to_string(),
            features: choose("trig18"),
            normaliser: None,
            weighting: choose("identity"),
            solver: "levenberg-marquardt".to_string(),
            start: Start::Named(choose("identity")),
            free: None,
            seed: 0,
            stopping: Stopping::default(),
            sampling: None,
            pipeline: None,
        })
    }

    /// Return the theta that fixes the statistics of a target side that moves.
    fn reference(&self, model: &Model) -> Vec<f64> {
        match &self.start {
            Start::Given(thetas) if !thetas.is_empty() => thetas[0].clone(),
            _ => model.identity.clone(),
        }
    }

    /// Choose the pipeline, put what was given beside the preset into its last stage, and fill in what the preset left open.
    ///
    /// `None` for a single solve without a statistic: the printed method and its variants.
    fn resolve(&mut self, model: &Model) -> Option<Pipeline> {
        let single =
            || Pipeline::new(vec![Stage { iterations: self.stopping.max_iterations, ..Stage::new("only", AUTO) }]);
        let mut pipeline = match &self.pipeline {
            Some(pipeline) => pipeline.clone(),
            None if self.preset == "auto" => auto::pipeline(model),
            None if self.weighting == "identity" => return None,
            None => single(),
        };
        let last = pipeline.stages.last_mut()?;
        for (given, stage) in [(&mut self.features, &mut last.features), (&mut self.weighting, &mut last.weighting)] {
            if given == AUTO { given.clone_from(stage) } else { stage.clone_from(given) }
        }
        match &self.normaliser {
            None => self.normaliser.clone_from(&last.normaliser),
            given => last.normaliser.clone_from(given),
        }
        Some(pipeline)
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
    pipeline: Option<Pipeline>,
    raw_source: Points,
    raw_target: Points,
    execution: Execution,
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
    /// J statistic, covariance, noise; where the weighting has them.
    pub statistics: Option<Statistics>,
    /// Distances between the points at theta; where the pipeline looks at them.
    pub support: Option<Support>,
    /// Share of the target points that were left out as outliers.
    pub clutter: Option<f64>,
    /// Whether theta was refined by closest points.
    pub refined: bool,
    /// How the sets were sampled, given or found.
    pub sampling: Option<&'static str>,
    /// What each stage of the pipeline did; empty for a single solve.
    pub stages: Vec<StageReport>,
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
        let (raw_source, raw_target) = (source.clone(), target.clone());
        let context = BuildContext { seed: settings.seed, source: Some(&raw_source), ..BuildContext::default() };
        let mut model = Arc::new(registry.model(&settings.model, &context)?);
        let mut settings = settings.clone();
        let pipeline = settings.resolve(&model);
        if let Some(variant) = pipeline.as_ref().and_then(|p| p.stages.last()).and_then(|stage| stage.model.as_deref())
        {
            model = Arc::new(registry.model(variant, &context)?);
        }
        let source = adapt("source", &settings.model, model.source_points, source)?;
        let target = adapt("target", &settings.model, model.target_points, target)?;
        if let Some(name) = model.source.attribute().filter(|name| source.attribute(name).is_none()) {
            let problem = format!("model `{}` needs the attribute `{name}` of every source point", settings.model);
            return Err(Error::Unsupported(problem));
        }
        let target_error = |problem| Error::Points { side: "target", problem };
        // The reference theta fixes the statistics of a target side that moves.
        let reference = settings.reference(&model);
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
            problem = problem.with_model_manifold(Arc::new(crate::geometry::free::manifold(&model.layout, free)));
        }
        registry.weighting(&settings.weighting)?;
        let starts = match &settings.start {
            Start::Given(thetas) => thetas.clone(),
            // The pipeline searches for itself.
            Start::Named(name) if name == AUTO && pipeline.is_some() => Vec::new(),
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
        let (normaliser, execution) = (normaliser_name, execution.clone());
        Ok(Self {
            problem,
            model,
            starts,
            normaliser,
            transform,
            source,
            target,
            settings,
            pipeline,
            raw_source,
            raw_target,
            execution,
        })
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
        if let Some(pipeline) = &self.pipeline {
            return self.run(registry, pipeline, supervision);
        }
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
            statistics: None,
            support: None,
            clutter: None,
            refined: false,
            sampling: None,
            stages: Vec::new(),
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

    /// Return the pipeline, `None` for a single solve.
    pub fn pipeline(&self) -> Option<&Pipeline> {
        self.pipeline.as_ref()
    }

    /// Return the settings; what the preset left open is filled in.
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
pub(crate) fn transform_points(
    points: &Points,
    transform: &Transform,
) -> Result<Points, cfpose_kernel::points::PointsError> {
    let rows: Vec<[f64; 3]> = (0..points.len()).map(|k| transform.apply(points.point(k))).collect();
    let columns = (0..points.dim()).map(|d| rows.iter().map(|row| row[d]).collect()).collect();
    Points::weighted(columns, points.weights().to_vec())
}

/// A status that means a limit was reached and not a tolerance.
pub fn is_limit(status: Status) -> bool {
    matches!(status, Status::MaxIterations | Status::MaxEvaluations | Status::Deadline | Status::Cancelled)
}
