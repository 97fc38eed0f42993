//! Estimates from moments of both sets, without their points: registration as a map and a reduction.
//!
//! Polynomial features of a map without projection need sums over the points, and their covariance sums of twice the degree: both
//! are in [`GatheredMoments`]. Whatever needs single points is not there: distances, likelihood, modes, overlap, the sampling. So the
//! verdict is `suspect` at most.

use std::sync::Arc;

use cfpose_kernel::map::Transform;
use cfpose_kernel::means::Execution;
use cfpose_kernel::moments::{GatheredMoments, Moments};
use cfpose_kernel::points::Points;
use cfpose_optim::manifold::Manifold;
use cfpose_optim::{Control, Interrupt, Outcome, Stopping};

use crate::distances::Sampling;
use crate::entry::BuildContext;
use crate::error::{Error, Side};
use crate::estimator::{Estimate, Settings, Stage, StageReport, Start, Supervision, WeightedAt};
use crate::geometry::centred::Centred;
use crate::geometry::free::Freedom;
use crate::model::{LinearKind, Model};
use crate::problem::MomentProblem;
use crate::registry::Registry;
use crate::start::StartContext;
use crate::statistics::Randomness;
use crate::statistics::weighting::{Update, Weighting};

mod covariance;
mod report;
mod representatives;
mod stages;

use covariance::sampling_covariance;
use representatives::representatives;
use stages::stages;

/// Thetas (ambient) this close to each other are one.
const SAME: f64 = 1e-6;

/// An estimate on moments, made ready: built once, solved many times.
///
/// The presets: `paper` is the printed method with polynomial features, one start; `auto` begins at all principal axes (or, for affine
/// maps, whitened sets) and weighs with the covariance of the means. Features that are not named are those the moments were made for.
///
/// ```
/// use cfpose::from_moments::MomentEstimator;
/// use cfpose::moments::GatheredMoments;
/// use cfpose::{Execution, Points, Registry, Settings, Supervision, Verdict};
/// // A bent sheet, turned by a quarter about z and shifted; the order of the points has no meaning.
/// let sheet: Vec<[f64; 3]> = (0..400)
///     .map(|k| (f64::from(k) * 0.618_034 % 1.0, f64::from(k) / 400.0))
///     .map(|(u, v)| [2.0 * u, v * (1.0 + 0.5 * u), 0.6 * u * u + 0.3 * (3.0 * v).sin() * u])
///     .collect();
/// let turned: Vec<[f64; 3]> = sheet.iter().rev().map(|p| [-p[1] + 0.5, p[0], p[2]]).collect();
/// let [source, target] = [sheet, turned].map(|rows| {
///     let mut sums = GatheredMoments::new(3, 6, [0.0; 3], "hermite[degree=3]");
///     sums.add(&Points::from_rows(&rows).unwrap(), &Execution::default()).unwrap();
///     sums
/// });
/// let settings = Settings::preset("auto", "rigid3")?;
/// let estimator = MomentEstimator::new(&Registry::default(), &settings, &source, &target, &Execution::default())?;
/// let estimate = estimator.solve(Supervision::default())?;
/// assert_eq!(estimate.verdict, Some(Verdict::Suspect)); // no test of single points can be made
/// let pose = estimate.pose.unwrap();
/// assert!((pose.translation[0] - 0.5).abs() < 1e-6 && (pose.rotation[3] - 1.0).abs() < 1e-6);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct MomentEstimator {
    settings: Settings,
    model: Arc<Model>,
    stages: Vec<ReadyStage>,
    /// What stands for the points of each side where a mean and a covariance are asked for.
    points: [Points; 2],
    effective: [f64; 2],
    freedom: Option<Freedom>,
    centred: Option<Centred>,
    registry: Registry,
    base: Vec<f64>,
}

/// A stage, ready to be solved from many starts.
struct ReadyStage {
    stage: Stage,
    problem: MomentProblem,
    solver: Box<dyn cfpose_optim::Solver>,
    weighting: Box<dyn Weighting>,
    /// Moments of the source up to twice the degree of the features, where the weighting asks for them.
    squares: Option<Moments>,
}

/// Where the stages led from one start.
struct Found {
    outcome: Outcome,
    problem: MomentProblem,
    weighted_at: Option<WeightedAt>,
}

impl MomentEstimator {
    /// Build all parts of an estimate from their names.
    ///
    /// # Errors
    /// [`Error`] for unknown names, what [`MomentProblem::of_moments`] refuses, stages and weightings that need points, and fewer features
    /// than unknowns.
    pub fn new(
        registry: &Registry,
        settings: &Settings,
        source: &GatheredMoments,
        target: &GatheredMoments,
        execution: &Execution,
    ) -> Result<Self, Error> {
        let context = BuildContext { seed: settings.seed, ..BuildContext::default() };
        let model = Arc::new(registry.model(&settings.model, &context)?);
        for (side, sums, expected) in
            [(Side::Source, source, model.source.point_dim()), (Side::Target, target, model.target.map().point_dim())]
        {
            if sums.dim() != expected {
                let (model, expected) = (settings.model.clone(), expected.to_string());
                return Err(Error::PointDimension { side, model, expected, found: sums.dim() });
            }
        }
        let moments = [source.moments(), target.moments()];
        let points = [representatives(&moments[0], Side::Source)?, representatives(&moments[1], Side::Target)?];
        let base = settings.given_starts().first().unwrap_or(&model.identity).clone();
        model.layout.check_ambient(&base)?;
        let freedom = settings.free.as_ref().map(|free| Freedom::new(&model.layout, free, &base));
        let stages = stages(settings, [source, target])?;
        // As the estimator on points does: `paper` steps as printed.
        let about_centre = settings.preset == "auto" && settings.pipeline.is_none() && freedom.is_none();
        let mean = moments[0].mean();
        let centred = model.linear.as_ref().filter(|_| about_centre).and_then(|group| {
            let centre = mean.get(..group.dim).filter(|_| group.dim == source.dim())?;
            Centred::of(&model.layout, centre)
        });
        let mut estimator = Self {
            settings: settings.clone(),
            stages: Vec::new(),
            points,
            effective: [source.effective(), target.effective()],
            freedom,
            centred,
            registry: registry.clone(),
            base,
            model,
        };
        for stage in stages {
            let ready = estimator.ready(stage, &moments, execution)?;
            ready.problem.require_enough_features()?;
            estimator.stages.push(ready);
        }
        Ok(estimator)
    }

    /// Make a stage ready.
    fn ready(&self, stage: Stage, moments: &[Moments; 2], execution: &Execution) -> Result<ReadyStage, Error> {
        let (registry, model) = (&self.registry, &self.model);
        let name = stage.normaliser.as_deref().or(model.normaliser).unwrap_or("paper").to_string();
        let transform: Transform = registry.normaliser(&name)?.fit(&self.points[1])?;
        let context = BuildContext { seed: self.settings.seed, dim: model.dim(), ..BuildContext::default() };
        let family: Arc<dyn cfpose_kernel::family::DynFamily> = Arc::from(registry.family(&stage.features, &context)?);
        let sides = [&moments[0], &moments[1]];
        let problem =
            MomentProblem::of_moments(Arc::clone(model), Arc::clone(&family), transform, sides, execution.clone())
                .map_err(|error| match error {
                    Error::Unsupported(problem) => Error::Unsupported(format!(
                        "{problem} (model `{}`, features `{}`)",
                        self.settings.model, stage.features
                    )),
                    other => other,
                })?;
        let problem = match self.manifold() {
            Some(manifold) => problem.with_model_manifold(manifold),
            None => problem,
        };
        let weighting = registry.weighting(&stage.weighting)?;
        let squares = match weighting.update() {
            Update::Never => None,
            Update::Steps(_) => Some(self.squares(&problem, &moments[0], &stage.features)?),
            Update::EveryEvaluation => {
                let problem =
                    format!("weighting `{}` needs the points; moments serve identity and two-step", stage.weighting);
                return Err(Error::Unsupported(problem));
            }
        };
        let solver = self.settings.solver_of(&stage, model).to_string();
        let solver_built = registry.solver(&solver)?;
        let stage = Stage { normaliser: Some(name), solver: Some(solver), ..stage };
        Ok(ReadyStage { stage, problem, solver: solver_built, weighting, squares })
    }

    /// Return the moments that the covariance of the features needs.
    fn squares(&self, problem: &MomentProblem, source: &Moments, features: &str) -> Result<Moments, Error> {
        let exponents = problem.family().monomials(self.model.dim()).unwrap_or_default();
        let degree = 2 * exponents.iter().map(|e| e.iter().sum::<usize>()).max().unwrap_or(0);
        if source.degree() < degree {
            let held = source.degree();
            let problem = format!(
                "the covariance of `{features}` needs moments to degree {degree}, the files end at {held}; write them with --features {features}, or give --weighting identity"
            );
            return Err(Error::Unsupported(problem));
        }
        if self.settings.sampling == Some(Sampling::Same) {
            let problem = "--sampling same needs the noise of single points, which moments do not hold; give independent or thinned, or --weighting identity";
            return Err(Error::Unsupported(problem.to_string()));
        }
        Ok(source.up_to(degree))
    }

    /// Return what a step of theta means, where it is not the model's own.
    fn manifold(&self) -> Option<Arc<dyn Manifold>> {
        let free = self.freedom.as_ref().map(|freedom| Arc::new(freedom.manifold().clone()) as Arc<dyn Manifold>);
        free.or_else(|| Some(Arc::new(self.centred.clone()?) as Arc<dyn Manifold>))
    }

    /// Return the model.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// Return the settings.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Return the problem of the last stage, not weighted.
    pub fn problem(&self) -> &MomentProblem {
        &self.last().problem
    }

    fn last(&self) -> &ReadyStage {
        &self.stages[self.stages.len() - 1]
    }

    /// Solve from every start and keep the best; the others that differ become alternatives.
    ///
    /// # Errors
    /// [`Error`] for a start strategy that does not apply and misuse of a solver; not converging is a status.
    pub fn solve(&self, mut supervision: Supervision<'_>) -> Result<Estimate, Error> {
        let interrupt = Interrupt::new(supervision.cancel, supervision.deadline);
        let mut reports: Vec<StageReport> =
            self.stages.iter().map(|ready| StageReport::new(&ready.stage.name)).collect();
        let (mut iterations, mut found): (usize, Vec<Found>) = (0, Vec::new());
        let starts = self.starts()?;
        for start in &starts {
            let start = self.freedom.as_ref().map_or_else(|| start.clone(), |freedom| freedom.hold(start));
            found.push(self.climb(&start, &interrupt, &mut supervision, &mut reports, &mut iterations)?);
            if interrupt.is_raised() {
                break;
            }
        }
        let rank = |found: &Found| {
            (!found.outcome.usable(), if found.outcome.cost.is_nan() { f64::INFINITY } else { found.outcome.cost })
        };
        found.sort_by(|a, b| rank(a).0.cmp(&rank(b).0).then(rank(a).1.total_cmp(&rank(b).1)));
        let starts = found.len();
        let mut found = found.into_iter();
        let Some(mut best) = found.next() else {
            return Err(Error::Unsupported("the start strategy proposed no start; give --start".to_string()));
        };
        if let Some(status) = interrupt.status().filter(|_| best.outcome.usable()) {
            (best.outcome.status, best.outcome.message) = (status, interrupt.words().to_string());
        }
        let others: Vec<Found> = found.collect();
        Ok(self.estimate(best, &others, starts, iterations, reports))
    }

    /// Return where the solves begin.
    fn starts(&self) -> Result<Vec<Vec<f64>>, Error> {
        let name = match (&self.settings.start, &self.model.linear) {
            (Some(Start::Given(thetas)), _) => return Ok(thetas.clone()),
            (Some(Start::Named(name)), _) => name.clone(),
            (None, Some(group)) if self.settings.preset != "paper" && self.freedom.is_none() => match group.kind {
                LinearKind::General => "whitened-affine".to_string(),
                _ => "pca".to_string(),
            },
            _ => "identity".to_string(),
        };
        let problem = &self.stages[0].problem;
        let cost = |theta: &[f64]| problem.try_evaluate(theta).map_or(f64::INFINITY, |evaluation| evaluation.cost);
        let context = StartContext {
            model: &self.model,
            source: &self.points[0],
            target: &self.points[1],
            cost: &cost,
            seed: self.settings.seed,
            freedom: self.freedom.as_ref(),
        };
        self.registry.start(&name)?.starts(&context)
    }

    /// Go through the stages from one start.
    fn climb(
        &self,
        start: &[f64],
        interrupt: &Interrupt<'_>,
        supervision: &mut Supervision<'_>,
        reports: &mut [StageReport],
        iterations: &mut usize,
    ) -> Result<Found, Error> {
        let mut theta = start.to_vec();
        let mut last = None;
        for (ready, report) in self.stages.iter().zip(reports) {
            let mut run = |problem: &MomentProblem, theta: &[f64]| -> Result<Outcome, Error> {
                let given = &self.settings.stopping;
                let most = ready.stage.iterations.min(given.max_iterations);
                let stopping = Stopping { max_iterations: most, deadline: interrupt.left(), ..given.clone() };
                let (seed, cancel) = (self.settings.seed, interrupt.cancel());
                let mut control = Control { stopping, seed, cancel, ..Control::default() };
                if let Some(observer) = supervision.observer.as_deref_mut() {
                    control.observer = Some(observer);
                }
                let outcome = ready.solver.solve(problem, theta, &mut control)?;
                report.solves += 1;
                report.evaluations += outcome.counts.residuals;
                *iterations += outcome.counts.iterations;
                Ok(outcome)
            };
            let outcome = run(&ready.problem, &theta)?;
            theta.clone_from(&outcome.theta);
            let mut found = Found { outcome, problem: ready.problem.clone(), weighted_at: None };
            let steps = match ready.weighting.update() {
                Update::Steps(steps) => steps,
                _ => 0,
            };
            for _ in 0..steps {
                if !found.outcome.usable() || interrupt.is_raised() {
                    break;
                }
                let (problem, weighted_at) = self.weighted(ready, &theta)?;
                let outcome = run(&problem, &theta)?;
                theta.clone_from(&outcome.theta);
                found = Found { outcome, problem, weighted_at: Some(weighted_at) };
            }
            let ended = !found.outcome.usable() || interrupt.is_raised();
            last = Some(found);
            if ended {
                break;
            }
        }
        last.ok_or_else(|| Error::Unsupported("an estimator has at least one stage".to_string()))
    }

    /// Weigh the problem of a stage by the covariance of the means at theta: that of two samples of one shape.
    fn weighted(&self, ready: &ReadyStage, theta: &[f64]) -> Result<(MomentProblem, WeightedAt), Error> {
        let [source, target] = self.effective;
        let kappa = self.sampling().kappa(target, source);
        let randomness = Randomness { noise: [[0.0; 3]; 3], kappa, num_target: target };
        let weighted_at = WeightedAt { theta: theta.to_vec(), randomness };
        let Some(squares) = &ready.squares else { return Ok((ready.problem.clone(), weighted_at)) };
        let covariance = sampling_covariance(&ready.problem, squares, theta, kappa);
        let whitening = ready.weighting.whitening(&covariance, ready.problem.num_features());
        let effective = whitening.as_ref().map(|whitening| whitening.effective);
        let whitened = ready.problem.clone().with_whitening(whitening.map(|whitening| whitening.matrix));
        let problem = whitened.with_effective_rows(effective);
        problem.require_enough_features()?;
        Ok((problem, weighted_at))
    }

    /// Return the sampling: what is given, else two samples of one shape, which only distances could tell from others.
    fn sampling(&self) -> Sampling {
        self.settings.sampling.unwrap_or(Sampling::Independent)
    }
}
