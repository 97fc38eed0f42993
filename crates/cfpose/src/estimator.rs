//! From two point sets to an estimate: parts by name, stages made ready once, starts, solves, and how sure one may be.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use cfpose_optim::manifold::Manifold;
use cfpose_optim::{Interrupt, LeastSquares, Observer, Outcome, Status};

use crate::criteria::Criteria;
use crate::entry::{BuildContext, BuildError};
use crate::error::Error;
use crate::geometry::bounds::{Bounds, Inside};
use crate::geometry::centred::Centred;
use crate::geometry::free::Freedom;
use crate::geometry::linalg::congruent;
use crate::geometry::pose::Pose;
use crate::model::Model;
use crate::problem::MomentProblem;
use crate::registry::Registry;
use crate::statistics::conditioning::{Conditioning, observe};
use cfpose_kernel::means::Execution;
use cfpose_kernel::points::Points;

mod alternatives;
mod candidate;
mod continuous;
mod estimate;
mod evaluate;
pub mod from_moments;
mod likelihoods;
mod misfits;
mod modes;
mod others;
mod outliers;
mod pipeline;
mod points;
mod preset;
mod prior;
mod ransac;
mod read_off;
mod run;
mod schedule;
mod search;
mod settings;
mod solve;
mod stage;
mod symmetry;
mod undetermined;
mod verdict;
mod workbench;

pub use candidate::{By, Minimised, WeightedAt};
pub use estimate::{Alternative, Estimate, StageReport};
pub use pipeline::{NoiseModel, Outliers, Pipeline, PointsStage, Stage};
pub use points::Evidence;
pub use prior::{Prior, PriorReport};
pub use settings::{PRESETS, Settings, Start};
pub use undetermined::Undetermined;
pub use verdict::Verdict;

use prior::ReadyPrior;
use search::{Search, Stages};
use workbench::Data;

/// Cancel flag, deadline and observer of an estimate.
#[derive(Default)]
pub struct Supervision<'a> {
    /// Raised by another thread to stop.
    pub cancel: Option<&'a AtomicBool>,
    /// Wall-clock limit of the whole estimate: search, solves, likelihood and statistics.
    pub deadline: Option<Duration>,
    /// Sees every iteration.
    pub observer: Option<&'a mut dyn Observer>,
}

/// What interrupts a search, and what sees its iterations.
struct Watch<'a> {
    interrupt: Interrupt<'a>,
    observer: Option<&'a mut dyn Observer>,
}

/// What every stage of an estimate shares.
struct Parts {
    registry: Registry,
    settings: Settings,
    criteria: Criteria,
    /// What is free, and the values of the rest.
    freedom: Option<Freedom>,
    /// Where theta may be.
    bounds: Option<Arc<Bounds>>,
    /// What is known of theta beforehand.
    prior: Option<ReadyPrior>,
    /// What a step of theta means, where it is not the model's own: some parameters free, turns about the centre, bounds.
    manifold: Option<Arc<dyn Manifold>>,
    /// The latter.
    centred: Option<Centred>,
    /// Theta (ambient) that fixes the statistics of a target side that moves.
    reference: Vec<f64>,
    execution: Execution,
}

impl Parts {
    /// Give what is fixed its value and move what is outside of the bounds inside.
    fn hold(&self, theta: &[f64]) -> Vec<f64> {
        let mut held = self.freedom.as_ref().map_or_else(|| theta.to_vec(), |freedom| freedom.hold(theta));
        if let Some(bounds) = &self.bounds {
            bounds.clip(&mut held);
        }
        held
    }

    /// The same for the start of a number that a strategy proposed: it keeps its place among the others.
    fn hold_start(&self, theta: &[f64], number: usize) -> Vec<f64> {
        let mut inside = theta.to_vec();
        if let Some(bounds) = &self.bounds {
            bounds.draw_inside(&mut inside, self.settings.seed, number);
        }
        self.hold(&inside)
    }

    /// Say whether theta is within the bounds.
    fn admits(&self, theta: &[f64]) -> bool {
        self.bounds.as_ref().is_none_or(|bounds| bounds.violated(theta).is_empty())
    }
}

/// An estimate made ready: built once, solved many times.
///
/// It owns all of its parts, so that it may move to another thread and outlive what it was built from. A second solve repeats
/// none of the set-up, except that of the part that many points are explored on.
///
/// ```
/// use cfpose::{Estimator, Execution, Points, Registry, Settings, Supervision};
/// // The motivation example: theta p = q without correspondences gives theta = 1.
/// let p = Points::from_rows(&[[1.0], [2.0], [3.0], [4.0]])?;
/// let q = Points::from_rows(&[[2.0], [3.0], [1.0], [4.0]])?;
/// let settings = Settings::preset("paper", "gain1")?.features("coordinates");
/// let estimator = Estimator::new(&Registry::default(), &settings, &p, &q, &Execution::default())?;
/// let estimate = estimator.solve(Supervision::default())?;
/// assert!((estimate.theta[0] - 1.0).abs() < 1e-12);
/// // The same estimator from another start.
/// let again = estimator.solve_from(&[vec![0.5]], Supervision::default())?;
/// assert!((again.theta[0] - 1.0).abs() < 1e-12);
/// // What was minimised last can be evaluated again: the same cost.
/// assert_eq!(estimator.evaluate_minimised(&estimate.minimised)?.cost, estimate.outcome.cost);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Estimator {
    parts: Parts,
    pipeline: Pipeline,
    stages: Stages,
    /// The points as they were given; stray ones are left out of the stages.
    whole: Data,
}

impl Estimator {
    /// Build all parts of an estimate from their names.
    ///
    /// # Errors
    /// [`Error`] for unknown names, points that do not fit the model, and fewer features than unknowns.
    pub fn new(
        registry: &Registry,
        settings: &Settings,
        source: &Points,
        target: &Points,
        execution: &Execution,
    ) -> Result<Self, Error> {
        let data = Data::whole(Arc::new(source.clone()), Arc::new(target.clone()));
        let context = BuildContext { seed: settings.seed, source: Some(&data.source), ..BuildContext::default() };
        let model = registry.model(&settings.model, &context)?;
        let mut settings = settings.clone();
        if let Some(Start::Given(thetas)) = &mut settings.start {
            thetas.iter().try_for_each(|theta| model.layout.check_ambient(theta))?;
            thetas.iter_mut().for_each(|theta| onto_manifold(&model, theta));
        }
        let base = settings.given_starts().first().unwrap_or(&model.identity).clone();
        let freedom = settings.free.as_ref().map(|free| Freedom::new(&model.layout, free, &base));
        let pipeline = settings.resolve(&model, freedom.as_ref());
        let criteria = pipeline.criteria.clone();
        let centred = (freedom.is_none() && pipeline.points.is_some()).then(|| centred(&model, &data.source)).flatten();
        let free = freedom.as_ref().map(|freedom| Arc::new(freedom.manifold().clone()) as Arc<dyn Manifold>);
        let manifold = free.or_else(|| Some(Arc::new(centred.clone()?) as Arc<dyn Manifold>));
        let bounds = bounds_of(&model, &settings)?;
        let manifold = match &bounds {
            Some(bounds) => {
                let inner = manifold.unwrap_or_else(|| Arc::new(model.layout.manifold().clone()));
                Some(Arc::new(Inside { inner, bounds: bounds.clone() }) as Arc<dyn Manifold>)
            }
            None => manifold,
        };
        let prior = settings.prior.as_ref().map(|prior| ReadyPrior::new(prior, &model.layout)).transpose()?;
        let (registry, execution) = (registry.clone(), execution.clone());
        let reference = base;
        let parts =
            Parts { registry, settings, criteria, freedom, bounds, prior, manifold, centred, reference, execution };
        // Means, scales and extents are those of the points that belong together.
        let whole = data;
        let data = if pipeline.points.is_some() { whole.without_stray()? } else { whole.clone() };
        let stages = Stages::new(&parts, data, &pipeline, 0)?;
        Ok(Self { parts, pipeline, stages, whole })
    }

    /// Solve from every start and keep the best; the others that differ become alternatives.
    ///
    /// # Errors
    /// [`Error`] for fewer features than unknowns, a start strategy that does not apply, and points that a theta maps to
    /// infinity; not converging is a status.
    pub fn solve(&self, supervision: Supervision<'_>) -> Result<Estimate, Error> {
        self.search(None, supervision)
    }

    /// Solve from these thetas (ambient) instead of the starts of the settings: for streams, and for many starts.
    ///
    /// What is fixed keeps the values it had when the estimator was built.
    ///
    /// # Errors
    /// As [`Estimator::solve`].
    pub fn solve_from(&self, starts: &[Vec<f64>], supervision: Supervision<'_>) -> Result<Estimate, Error> {
        starts.iter().try_for_each(|theta| self.model().layout.check_ambient(theta))?;
        let starts: Vec<Vec<f64>> = starts.iter().map(|theta| self.parts.hold(theta)).collect();
        self.search(Some(starts), supervision)
    }

    /// Make the same estimator for another target: the next frame of a stream.
    ///
    /// # Errors
    /// As [`Estimator::new`].
    pub fn with_target(&self, target: &Points) -> Result<Self, Error> {
        let parts = &self.parts;
        Self::new(&parts.registry, &parts.settings, &self.whole.source, target, &parts.execution)
    }

    /// Run the pipeline, refine the best, compare it with what else was found, judge it.
    fn search(&self, starts: Option<Vec<Vec<f64>>>, supervision: Supervision<'_>) -> Result<Estimate, Error> {
        let interrupt = Interrupt::new(supervision.cancel, supervision.deadline);
        let mut watch = Watch { interrupt, observer: supervision.observer };
        for stage in &self.stages.ready {
            stage.problem.require_enough_features()?;
        }
        let mut search = Search::new(&self.parts, &self.pipeline, &self.stages, interrupt);
        let given = match starts {
            Some(starts) => starts,
            None => search.given()?,
        };
        let found = search.run(&given, &mut watch)?;
        let Some(mut best) = found.best else { return Ok(self.nothing(&search, &given)) };
        let stage = self.stages.last();
        let usable = best.outcome.usable();
        if let Some(status) = interrupt.status().filter(|_| usable && !found.finished) {
            (best.outcome.status, best.outcome.message) = (status, interrupt.words().to_string());
        }
        let (mut warnings, alternatives) = if usable && !best.outcome.status.is_interruption() {
            search.compare(&mut best, &found.all)
        } else {
            (Vec::new(), Vec::new())
        };
        // Cost and status are those of the theta that is returned.
        if usable {
            let theta = best.theta.clone();
            best.move_to(&theta);
            search.join_prior(&mut best);
        }
        let theta = best.theta.clone();
        if let Some(statistics) = best.statistics.as_mut().filter(|_| best.evidence.is_some()) {
            best.deviation = Some(search.deviation(&theta, &statistics.covariance));
            if let Some(centred) = &self.parts.centred {
                let here = statistics.covariance.clone();
                statistics.covariance = congruent(centred.tangent(), &centred.to_own(&theta), &here);
                statistics.covariance_at_centroid = Some(here);
            }
            undetermined::without(&best.undetermined, &mut statistics.covariance);
        }
        if best.outcome.status.is_interruption() {
            warnings.push(interrupt.words().to_string());
        }
        for (side, rows) in ["source", "target"].iter().zip(self.stray()).filter(|(_, rows)| !rows.is_empty()) {
            let first = rows.iter().take(5).map(usize::to_string).collect::<Vec<_>>().join(", ");
            let more = if rows.len() > 5 { ", ..." } else { "" };
            warnings
                .push(format!("{} stray {side} point(s), far outside, take no part: rows {first}{more}", rows.len()));
        }
        warnings.extend(verdict::reasons(&best, stage, &self.parts).into_iter().map(|(words, _)| words));
        let conditioning = if usable { self.conditioning(&best) } else { self.unknown() };
        warnings.extend(conditioning.warnings());
        let counts = [self.whole.source.len(), self.whole.target.len()];
        let own = theta[..stage.own()].to_vec();
        Ok(Estimate {
            pose: Pose::of_theta(&stage.model().layout, &own),
            by: best.by,
            verdict: verdict::verdict(&best, stage, &self.parts),
            minimised: best.minimised(stage, &self.parts, counts),
            theta: own,
            starts: search.starts,
            evaluations: search.reports.iter().map(|r| r.evaluations).sum(),
            iterations: search.iterations,
            alternatives,
            warnings,
            conditioning,
            statistics: best.statistics,
            support: best.support,
            clutter: best.clutter,
            refined: best.by == By::Points,
            undetermined: best.undetermined,
            prior: best.prior,
            evidence: best.evidence,
            stray: self.stray(),
            sampling: best.sampling.map(|s| s.name()),
            stages: search.reports,
            outcome: best.outcome,
        })
    }

    /// Return the rows (from 1) of both sides that are left out because they lie far outside.
    fn stray(&self) -> [Vec<usize>; 2] {
        let rest = |whole: &Points, kept: &Option<Arc<Vec<usize>>>| match kept {
            Some(kept) => (0..whole.len()).filter(|k| kept.binary_search(k).is_err()).map(|k| k + 1).collect(),
            None => Vec::new(),
        };
        let data = &self.stages.data;
        [rest(&self.whole.source, &data.kept_source), rest(&self.whole.target, &data.kept_target)]
    }

    /// Return rank and conditioning of the Jacobian at a candidate's theta.
    fn conditioning(&self, candidate: &candidate::Candidate) -> Conditioning {
        let stage = self.stages.last();
        let evaluation = candidate.problem.evaluate(&candidate.theta);
        let (unknowns, free) = (candidate.problem.manifold().tangent(), self.parts.settings.free.as_deref());
        observe(&evaluation.jacobian, unknowns, &stage.model().layout, free, &candidate.theta)
    }

    fn unknown(&self) -> Conditioning {
        Conditioning::unknown(self.stages.last().problem.manifold().tangent())
    }

    /// No start survived the gates: an estimate that says so.
    fn nothing(&self, search: &Search<'_>, given: &[Vec<f64>]) -> Estimate {
        let stage = self.stages.last();
        let theta = given.first().unwrap_or(&self.parts.reference).clone();
        let ambient = stage.adopt(&theta, &self.parts);
        let message = if search.interrupt.is_raised() {
            search.interrupt.words()
        } else if search.starts == 0 {
            "the start strategy proposed no start"
        } else {
            "no start led to a plausible theta: in front of the camera, facing it"
        };
        let status = search.interrupt.status().unwrap_or(Status::Stalled);
        let outcome = Outcome::unsolved(ambient.clone(), f64::INFINITY, status, message);
        let minimised = Minimised {
            stage: stage.stage.clone(),
            theta: ambient,
            reference: self.parts.reference.clone(),
            weighted_at: None,
            left_out_source: Vec::new(),
            left_out_target: Vec::new(),
            free: self.parts.settings.free.clone(),
            seed: self.parts.settings.seed,
        };
        Estimate {
            pose: Pose::of_theta(&stage.model().layout, &theta),
            by: By::Moments,
            theta,
            evaluations: search.reports.iter().map(|r| r.evaluations).sum(),
            iterations: search.iterations,
            starts: search.starts,
            verdict: Some(Verdict::Failed),
            alternatives: Vec::new(),
            warnings: Vec::new(),
            conditioning: self.unknown(),
            statistics: None,
            support: None,
            clutter: None,
            refined: false,
            undetermined: Vec::new(),
            prior: None,
            evidence: None,
            stray: self.stray(),
            sampling: None,
            stages: search.reports.clone(),
            outcome,
            minimised,
        }
    }

    /// Return the problem of the last stage, not weighted, with its nuisance parameters.
    pub fn problem(&self) -> &MomentProblem {
        &self.stages.last().problem
    }

    /// Return the model of the last stage.
    pub fn model(&self) -> &Model {
        self.stages.last().model()
    }

    /// Return the stage that is reported last, every choice filled in.
    pub fn last_stage(&self) -> &Stage {
        &self.stages.last().stage
    }

    /// Return the starts that a solve begins with; none where the pipeline searches by itself.
    ///
    /// # Errors
    /// [`Error::Unsupported`] for a strategy that does not apply to the model.
    pub fn starts(&self) -> Result<Vec<Vec<f64>>, Error> {
        Search::new(&self.parts, &self.pipeline, &self.stages, Interrupt::default()).given()
    }

    /// Return the step that leads from one theta to another (ambient) in the coordinates of
    /// [`Statistics::covariance_at_centroid`](crate::statistics::Statistics): turns about the middle of the source, shifts of its image; `None`
    /// for models without it.
    pub fn step_at_centroid(&self, from: &[f64], to: &[f64]) -> Option<Vec<f64>> {
        let centred = self.parts.centred.as_ref()?;
        let mut step = vec![0.0; centred.tangent()];
        centred.local(from, to, &mut step);
        Some(step)
    }

    /// Return the number of free tangent directions of the model.
    pub fn num_unknowns(&self) -> usize {
        self.stages.last().own_tangent()
    }

    /// Return the pipeline, every choice filled in.
    pub fn pipeline(&self) -> &Pipeline {
        &self.pipeline
    }

    /// Return the target points as they were given.
    pub fn target(&self) -> &Points {
        &self.whole.target
    }

    /// Return the settings as they were given; starts are on the manifold.
    pub fn settings(&self) -> &Settings {
        &self.parts.settings
    }
}

/// Make the bounds of the settings; a given start has to be inside.
fn bounds_of(model: &Model, settings: &Settings) -> Result<Option<Arc<Bounds>>, Error> {
    if settings.bounds.is_empty() {
        return Ok(None);
    }
    let bounds = Bounds::new(&model.layout, &settings.bounds)?;
    for start in settings.given_starts() {
        if let Some(column) = bounds.violated(start).first() {
            let problem =
                format!("the start is outside the bounds of {}: move it inside or widen them", bounds.name(*column));
            return Err(BuildError::Data { name: "bounds".to_string(), problem }.into());
        }
    }
    Ok(Some(Arc::new(bounds)))
}

/// Return the manifold of turns about the middle of the source, for linear maps of points as they are.
fn centred(model: &Model, source: &Points) -> Option<Centred> {
    let group = model.linear.as_ref().filter(|group| group.dim == source.dim())?;
    let middle = |d: usize| {
        let mut column = source.column(d).to_vec();
        let at = column.len() / 2;
        *column.select_nth_unstable_by(at, f64::total_cmp).1
    };
    Centred::of(&model.layout, &(0..group.dim).map(middle).collect::<Vec<f64>>())
}

/// Move a theta that is off its manifold by more than rounding (a matrix from a file that is no rotation) onto it.
fn onto_manifold(model: &Model, theta: &mut Vec<f64>) {
    let mut projected = theta.clone();
    if projected.len() == model.layout.manifold().ambient() {
        model.layout.manifold().project(&mut projected);
    }
    let size = theta.iter().fold(1.0_f64, |size, value| size.max(value.abs()));
    if theta.iter().zip(&projected).any(|(a, b)| (a - b).abs() > 1e-12 * size) {
        *theta = projected;
    }
}

/// Estimate theta in one call.
///
/// ```
/// use cfpose::{Execution, Points, Registry, Settings, estimate};
/// let p = Points::from_rows(&[[1.0], [2.0], [3.0], [4.0]]).unwrap();
/// let q = Points::from_rows(&[[2.0], [3.0], [1.0], [4.0]]).unwrap();
/// let settings = Settings::preset("paper", "gain1").unwrap().features("coordinates");
/// let estimate = estimate(&Registry::default(), &settings, &p, &q, &Execution::default()).unwrap();
/// assert!((estimate.theta[0] - 1.0).abs() < 1e-12);
/// ```
///
/// # Errors
/// As [`Estimator::new`] and [`Estimator::solve`].
pub fn estimate(
    registry: &Registry,
    settings: &Settings,
    source: &Points,
    target: &Points,
    execution: &Execution,
) -> Result<Estimate, Error> {
    Estimator::new(registry, settings, source, target, execution)?.solve(Supervision::default())
}
