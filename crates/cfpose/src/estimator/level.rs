//! A stage made ready: its problem on its points, its solver, its weighting.

use std::sync::{Arc, OnceLock};

use cfpose_kernel::family::DynFamily;
use cfpose_kernel::map::{LiftedPoints, Transform};
use cfpose_kernel::means::Execution;
use cfpose_kernel::points::Points;
use cfpose_optim::manifold::Manifold;
use cfpose_optim::problem::LeastSquares;
use cfpose_optim::{Control, Outcome, Solver, Stopping};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::pipeline::Stage;
use super::{Settings, Supervision, adapt};
use crate::distances::Mover;
use crate::distances::closest_point::{self, ClosestPoint};
use crate::distances::neighbours::Neighbours;
use crate::distances::sampling::{Sampling, thin};
use crate::distances::support::Support;
use crate::entry::BuildContext;
use crate::error::Error;
use crate::model::Model;
use crate::problem::{MomentProblem, Noise, map_points};
use crate::registry::Registry;
use crate::statistics::weighting::{Update, Weighting};
use crate::statistics::{self, Randomness, Statistics, feature_covariance};

/// Standard deviation of the noise, in normalised units, that a stage begins with.
const FIRST_NOISE: f64 = 0.0125;
/// Standard deviation, in normalised units, below which noise counts as this: identical sets would give S = 0.
pub(super) const LEAST_NOISE: f64 = 0.00125;

/// Target points of the first steps of a refinement.
const REFINE_POINTS: usize = 500;

/// What every stage is built from.
pub(super) struct Ingredients<'a> {
    pub registry: &'a Registry,
    pub settings: &'a Settings,
    /// Points as the files hold them.
    pub source: &'a Points,
    pub target: &'a Points,
    pub execution: &'a Execution,
}

/// A theta with its nuisance parameters after a stage.
#[derive(Debug, Clone)]
pub(super) struct Solved {
    /// Ambient theta, nuisance parameters included.
    pub theta: Vec<f64>,
    pub outcome: Outcome,
    pub evaluations: usize,
    pub iterations: usize,
    pub statistics: Option<Statistics>,
    pub support: Option<Support>,
    pub sampling: Option<Sampling>,
}

/// A stage, ready to be solved from many starts.
pub(super) struct Level {
    pub stage: Stage,
    pub problem: MomentProblem,
    pub model: Arc<Model>,
    pub transform: Transform,
    /// Source points of the stage, as the model takes them.
    pub source: Points,
    /// All source points: distances are to the whole shape, not to what a quadrature keeps of it.
    pub all_source: Points,
    all_lifted: LiftedPoints,
    /// Target points of the stage, as the model takes them.
    pub target: Points,
    /// The same in the feature space, not normalised.
    pub mapped_target: Points,
    pub solver: Box<dyn Solver>,
    pub weighting: Box<dyn Weighting>,
    build: Build,
    /// The target's search structure, built when it is first asked.
    target_tree: OnceLock<Neighbours>,
    execution: Execution,
    num_source: f64,
    num_target: f64,
    counts: [usize; 2],
}

/// What a problem of the stage is made of, whatever its points.
struct Build {
    model: Arc<Model>,
    family: Arc<dyn DynFamily>,
    transform: Transform,
    noise: Noise,
    free: Option<Vec<usize>>,
}

impl Build {
    fn problem(&self, source: &Points, target: &Points, execution: &Execution) -> MomentProblem {
        let (model, family) = (Arc::clone(&self.model), Arc::clone(&self.family));
        let problem =
            MomentProblem::new(model, family, self.transform, source, target, execution.clone()).with_noise(self.noise);
        match &self.free {
            Some(free) => {
                problem.with_model_manifold(Arc::new(crate::geometry::free::manifold(&self.model.layout, free)))
            }
            None => problem,
        }
    }
}

impl Level {
    /// Return the problem of the stage on other points.
    pub fn problem_on(&self, source: &Points, target: &Points) -> MomentProblem {
        self.build.problem(source, target, &self.execution)
    }

    /// Build the stage.
    pub fn new(ingredients: &Ingredients<'_>, stage: &Stage) -> Result<Self, Error> {
        let Ingredients { registry, settings, execution, .. } = *ingredients;
        let spec = stage.model.as_deref().unwrap_or(&settings.model);
        let context = BuildContext { seed: settings.seed, source: Some(ingredients.source), ..BuildContext::default() };
        let model = Arc::new(registry.model(spec, &context)?);
        let all_source = adapt("source", &settings.model, model.source_points, ingredients.source)?;
        let all_target = adapt("target", &settings.model, model.target_points, ingredients.target)?;
        let weighting = registry.weighting(&stage.weighting)?;
        let exact = weighting.has_statistic() || Noise::from(stage.noise) != Noise::None;
        let mut rng = ChaCha8Rng::seed_from_u64(settings.seed);
        let points_error = |side| move |problem| Error::Points { side, problem };
        // A random choice of points has a sampling error of its own: fine for a start, not for the statistics.
        let mut choose = |side, points: &Points, limit: usize| {
            let limit = if exact && !points.is_in_curve_order() { 0 } else { limit };
            thin(points, limit, &mut rng).map_err(points_error(side))
        };
        let source = choose("source", &all_source, stage.source_points)?;
        let target = choose("target", &all_target, stage.target_points)?;
        // The reference theta fixes the statistics of a target side that moves.
        let reference = settings.reference(&model);
        let lifted = model.target.map().lift(&target);
        let mapped_target =
            map_points(model.target.map(), &lifted, &reference, execution).map_err(points_error("target"))?;
        let normaliser = stage.normaliser.clone().unwrap_or_else(|| model.normaliser.unwrap_or("paper").to_string());
        let transform = registry.normaliser(&normaliser)?.fit(&mapped_target)?;
        let normalised = super::transform_points(&mapped_target, &transform).map_err(points_error("target"))?;
        let context = BuildContext { dim: model.dim(), target: Some(&normalised), ..context };
        let family: Arc<dyn DynFamily> = Arc::from(registry.family(&stage.features, &context)?);
        let build = Build {
            model: Arc::clone(&model),
            family,
            transform,
            noise: stage.noise.into(),
            free: settings.free.clone(),
        };
        let problem = build.problem(&source, &target, execution);
        let solver_name = match (stage.solver.as_deref().unwrap_or(&settings.solver), model.solver) {
            ("levenberg-marquardt", Some(own)) => own,
            (given, _) => given,
        };
        let solver = registry.solver(solver_name)?;
        problem.require_enough_features()?;
        Ok(Self {
            stage: stage.clone(),
            build,
            problem,
            transform,
            mapped_target,
            solver,
            weighting,
            target_tree: OnceLock::new(),
            execution: execution.clone(),
            num_source: effective(&all_source),
            num_target: effective(&all_target),
            counts: [all_target.len(), all_source.len()],
            all_lifted: model.source.lift(&all_source),
            all_source,
            model,
            source,
            target,
        })
    }

    /// Map all source points into the feature space at theta, not normalised.
    pub fn mapped_source(&self, theta: &[f64]) -> Result<Points, Error> {
        let own = &theta[..self.own()];
        map_points(self.model.source.as_ref(), &self.all_lifted, own, &self.execution)
            .map_err(|problem| Error::Points { side: "source", problem })
    }

    /// Return the unweighted cost at theta of any stage.
    pub fn cost(&self, theta: &[f64]) -> f64 {
        let (residual, _) = self.problem.unweighted(&self.adopt(theta), false);
        cfpose_optim::problem::half_squared_norm(&residual)
    }

    /// Return the ambient length of the model's own theta.
    fn own(&self) -> usize {
        self.model.layout.manifold().ambient()
    }

    /// Return the number of points of the smaller set.
    pub fn fewest_points(&self) -> usize {
        self.counts[0].min(self.counts[1])
    }

    /// Return the number of the model's own free tangent coordinates.
    pub fn own_tangent(&self) -> usize {
        self.problem.manifold().tangent() - self.num_nuisance()
    }

    fn num_nuisance(&self) -> usize {
        self.problem.noise().num_parameters(self.model.dim())
    }

    /// Return the size of a normalised unit in the feature space.
    pub fn unit(&self) -> f64 {
        let matrix = self.transform.matrix();
        let trace: f64 = (0..self.model.dim()).map(|d| matrix[d][d].abs()).sum();
        self.model.dim() as f64 / trace
    }

    /// Take theta from another stage: its nuisance parameters serve where the numbers agree.
    pub fn adopt(&self, theta: &[f64]) -> Vec<f64> {
        let mut own = theta[..self.own()].to_vec();
        let (needed, dim) = (self.num_nuisance(), self.model.dim());
        let first = (FIRST_NOISE * self.unit()).powi(2);
        let carried = &theta[self.own()..];
        if carried.len() == needed {
            own.extend_from_slice(carried);
        } else if needed == 1 {
            own.push(first);
        } else if needed > 1 {
            let variance = carried.first().copied().unwrap_or(first);
            for a in 0..dim {
                own.extend((a..dim).map(|b| if a == b { variance } else { 0.0 }));
            }
        }
        own
    }

    /// Return the noise covariance at theta (nuisance parameters included), at least the floor; `None` where not modelled.
    pub fn noise(&self, theta: &[f64]) -> Option<[[f64; 3]; 3]> {
        let dim = self.model.dim();
        let floor = (LEAST_NOISE * self.unit()).powi(2);
        let nuisance = &theta[self.own()..];
        let mut covariance = [[0.0; 3]; 3];
        match self.problem.noise() {
            Noise::None => return None,
            Noise::Isotropic => (0..dim).for_each(|d| covariance[d][d] = nuisance[0].max(floor)),
            Noise::Full => {
                let mut next = 0;
                for a in 0..dim {
                    for b in a..dim {
                        covariance[a][b] = nuisance[next];
                        covariance[b][a] = nuisance[next];
                        next += 1;
                    }
                }
                (0..dim).for_each(|d| covariance[d][d] = covariance[d][d].max(floor));
            }
        }
        Some(covariance)
    }

    /// Return the standard deviation of the noise in one coordinate, 0 where its variance is negative.
    pub fn noise_sigma(&self, theta: &[f64]) -> Option<f64> {
        let (dim, nuisance) = (self.model.dim(), &theta[self.own()..]);
        match self.problem.noise() {
            Noise::None => None,
            Noise::Isotropic => Some(nuisance[0].max(0.0).sqrt()),
            Noise::Full => {
                let diagonal = |d: usize| nuisance[d * dim - d * d.saturating_sub(1) / 2];
                Some((diagonal_mean(dim, diagonal)).max(0.0).sqrt())
            }
        }
    }

    /// Compare the points at theta.
    pub fn support(&self, theta: &[f64]) -> Result<Support, Error> {
        let source = self.mapped_source(theta)?;
        if self.model.target.is_moving() {
            let target =
                self.problem.mapped_target(theta).map_err(|problem| Error::Points { side: "target", problem })?;
            return Ok(Support::of(&source, &target, self.noise_sigma(theta)));
        }
        let tree = self.target_tree.get_or_init(|| Neighbours::new(self.mapped_target.rows(), self.model.dim()));
        Ok(Support::against(&source, tree, self.noise_sigma(theta)))
    }

    /// Refine theta by trimmed closest points: some points until it stands, then all.
    pub fn refined(&self, theta: &[f64]) -> Option<ClosestPoint> {
        let (mover, all) = (Mover::new(&self.problem, &self.all_source), self.mapped_target.rows());
        let step = all.len().div_ceil(REFINE_POINTS);
        let some: Vec<[f64; 3]> = all.iter().step_by(step).copied().collect();
        let options = closest_point::Options { tolerance: 1e-8, ..Default::default() };
        let first = closest_point::refine(&mover, &some, theta, &options)?;
        if step == 1 {
            return Some(first);
        }
        let options = closest_point::Options { max_iterations: 3, ..options };
        closest_point::refine(&mover, &all, &first.theta, &options)
    }

    /// Compare the points at theta, or, where its misfit may hide the sampling, at a theta that is refined a little.
    fn near_support(&self, theta: &[f64]) -> Result<Support, Error> {
        let support = self.support(theta)?;
        if self.model.target.is_moving() || support.mutual > 0.75 || support.normal_sigma > 3.0 * support.source_spacing
        {
            return Ok(support);
        }
        let all = self.mapped_target.rows();
        let some: Vec<[f64; 3]> = all.iter().step_by(all.len().div_ceil(REFINE_POINTS)).copied().collect();
        let options = closest_point::Options { tolerance: 1e-3, max_iterations: 6, ..Default::default() };
        match closest_point::refine(&Mover::new(&self.problem, &self.all_source), &some, theta, &options) {
            Some(fit) => self.support(&fit.theta),
            None => Ok(support),
        }
    }

    /// Solve from theta of another stage (or a start): once, and again with each weighting.
    pub fn solve(
        &mut self,
        start: &[f64],
        settings: &Settings,
        supervision: &mut Supervision<'_>,
    ) -> Result<Solved, Error> {
        self.problem.set_whitening(None);
        let seed = settings.seed;
        let stopping = Stopping {
            max_iterations: self.stage.iterations.min(settings.stopping.max_iterations),
            deadline: supervision.deadline,
            ..settings.stopping.clone()
        };
        let mut run = |problem: &dyn LeastSquares, theta: &[f64], solver: &dyn Solver| {
            let mut control =
                Control { stopping: stopping.clone(), seed, cancel: supervision.cancel, ..Control::default() };
            if let Some(observer) = supervision.observer.as_deref_mut() {
                control.observer = Some(observer);
            }
            solver.solve(problem, theta, &mut control)
        };
        let mut theta = self.adopt(start);
        let mut before = Vec::new();
        if self.stage.coarse_to_fine {
            let mut step = |problem: &MomentProblem, theta: &[f64]| run(problem, theta, self.solver.as_ref());
            (theta, before) = self.coarse_to_fine(&theta, &mut step, seed)?;
        }
        let outcome = run(&self.problem, &theta, self.solver.as_ref())?;
        let mut solved = Solved {
            theta: outcome.theta.clone(),
            evaluations: before.iter().chain([&outcome]).map(|o| o.counts.residuals).sum(),
            iterations: before.iter().chain([&outcome]).map(|o| o.counts.iterations).sum(),
            outcome,
            statistics: None,
            support: None,
            sampling: None,
        };
        let steps = match self.weighting.update() {
            Update::Never => return Ok(solved),
            Update::Steps(steps) => steps,
            Update::EveryEvaluation => 1,
        };
        if !solved.outcome.usable() {
            return Ok(solved);
        }
        let support = self.near_support(&solved.theta)?;
        let sampling = settings.sampling.unwrap_or_else(|| Sampling::detect(&support, self.model.dim(), self.counts));
        let mut kappa = 0.0;
        for _ in 0..steps {
            let randomness = self.randomness(&solved.theta, &support, sampling);
            kappa = randomness.kappa;
            self.whiten(&solved.theta, &randomness, seed)?;
            let outcome = run(&self.problem, &solved.theta, self.solver.as_ref())?;
            solved.evaluations += outcome.counts.residuals;
            solved.iterations += outcome.counts.iterations;
            let usable = outcome.usable();
            solved.theta.clone_from(&outcome.theta);
            solved.outcome = outcome;
            if !usable {
                return Ok(solved);
            }
        }
        if self.weighting.update() == Update::EveryEvaluation {
            let (theta, randomness) = (solved.theta.clone(), self.randomness(&solved.theta, &support, sampling));
            let continuous = super::continuous::Continuous::new(self, randomness, seed);
            let outcome = run(&continuous, &theta, self.solver.as_ref())?;
            solved.evaluations += outcome.counts.residuals;
            solved.iterations += outcome.counts.iterations;
            solved.theta.clone_from(&outcome.theta);
            solved.outcome = outcome;
            let randomness = self.randomness(&solved.theta, &support, sampling);
            self.whiten(&solved.theta, &randomness, seed)?;
        }
        if self.weighting.has_statistic() && self.problem.whitening().is_some() {
            solved.statistics = self.statistics(&solved.theta, kappa);
        }
        solved.support = Some(support);
        solved.sampling = Some(sampling);
        Ok(solved)
    }

    /// Return where the randomness of the residual comes from at theta.
    ///
    /// The noise is the nuisance parameter where the weighted fit so far determines it to a fifth; else, and before any
    /// weighting, it is what the distances along the normals say.
    pub fn randomness(&self, theta: &[f64], support: &Support, sampling: Sampling) -> Randomness {
        let floor = LEAST_NOISE * self.unit();
        let noise = self.noise(theta).filter(|_| self.noise_is_determined(theta)).unwrap_or_else(|| {
            let variance = support.normal_sigma.max(floor).powi(2);
            let mut covariance = [[0.0; 3]; 3];
            (0..self.model.dim()).for_each(|d| covariance[d][d] = variance);
            covariance
        });
        Randomness { noise, kappa: sampling.kappa(self.num_target, self.num_source), num_target: self.num_target }
    }

    /// Say whether the weighted fit at theta determines the variance of the noise to a fifth.
    fn noise_is_determined(&self, theta: &[f64]) -> bool {
        let own = self.own_tangent();
        let (Some(sigma), Some(_)) = (self.noise_sigma(theta), self.problem.whitening()) else { return false };
        statistics::deviation(&self.problem, theta, own).is_some_and(|deviation| deviation < 0.2 * sigma * sigma)
    }

    /// Weight the problem by the covariance at theta.
    fn whiten(&mut self, theta: &[f64], randomness: &Randomness, seed: u64) -> Result<(), Error> {
        let covariance = feature_covariance(&self.problem, theta, randomness, seed)
            .map_err(|problem| Error::Points { side: "source", problem })?;
        let whitening = self.weighting.whitening(&covariance, self.problem.num_features());
        self.problem.set_whitening(whitening.map(|whitening| whitening.matrix));
        self.problem.require_enough_features()
    }

    /// Return J, its p-value and the covariance of theta for the weighting as it stands.
    pub fn statistics(&self, theta: &[f64], kappa: f64) -> Option<Statistics> {
        let statistics = statistics::of_whitened(&self.problem, theta, self.own_tangent())?;
        Some(Statistics { noise_sigma: self.noise_sigma(theta), kappa, ..statistics })
    }
}

fn diagonal_mean(dim: usize, entry: impl Fn(usize) -> f64) -> f64 {
    (0..dim).map(entry).sum::<f64>() / dim as f64
}

/// Return (sum w)^2 / sum w^2, the number of equally weighted points with the same variance of a mean.
fn effective(points: &Points) -> f64 {
    let (sum, squares) = points.weights().iter().fold((0.0, 0.0), |(s, t), w| (s + w, t + w * w));
    sum * sum / squares
}
