//! A stage made ready: its problem on its points, its solver, its weighting. How it is solved: `solve.rs`.

use std::sync::{Arc, OnceLock};

use cfpose_optim::Solver;
use cfpose_optim::manifold::Manifold;
use cfpose_optim::problem::LeastSquares;

use super::Parts;
use super::pipeline::{NoiseModel, Stage};
use crate::distances::Mover;
use crate::distances::neighbours::Neighbours;
use crate::distances::sampling::Sampling;
use crate::distances::sampling::thin;
use crate::distances::support::Support;
use crate::entry::BuildContext;
use crate::error::Error;
use crate::model::Model;
use crate::problem::{MomentProblem, Sides, adapt, map_points};
use crate::statistics::weighting::Weighting;
use crate::statistics::{self, Randomness};
use crate::streams::stream;
use cfpose_kernel::family::DynFamily;
use cfpose_kernel::map::LiftedPoints;
use cfpose_kernel::points::Points;

/// Point sets of an estimate, as the files hold them or a part of that.
#[derive(Clone)]
pub(super) struct Data {
    pub source: Arc<Points>,
    pub target: Arc<Points>,
    /// Rows of the files (from 0) that are left, `None` for all.
    pub kept_source: Option<Arc<Vec<usize>>>,
    pub kept_target: Option<Arc<Vec<usize>>>,
}

impl Data {
    /// Take all rows.
    pub fn whole(source: Arc<Points>, target: Arc<Points>) -> Self {
        Self { source, target, kept_source: None, kept_target: None }
    }

    /// Keep some rows (indices into what is left), `None` for all of a side.
    pub fn keep(&self, source: Option<&[usize]>, target: Option<&[usize]>) -> Result<Self, Error> {
        let mut kept = self.clone();
        let compose = |before: &Option<Arc<Vec<usize>>>, rows: &[usize]| match before {
            Some(before) => Arc::new(rows.iter().map(|k| before[*k]).collect::<Vec<_>>()),
            None => Arc::new(rows.to_vec()),
        };
        if let Some(rows) = source {
            kept.source = Arc::new(self.source.select(rows).map_err(of_side("source"))?);
            kept.kept_source = Some(compose(&self.kept_source, rows));
        }
        if let Some(rows) = target {
            kept.target = Arc::new(self.target.select(rows).map_err(of_side("target"))?);
            kept.kept_target = Some(compose(&self.kept_target, rows));
        }
        Ok(kept)
    }
}

/// Name the side of a fault in points.
pub(super) fn of_side(side: &'static str) -> impl Fn(cfpose_kernel::points::PointsError) -> Error {
    move |problem| Error::Points { side, problem }
}

/// What the stages of one pipeline share while they are built: models and sides that several of them ask for.
pub(super) struct Workbench<'a> {
    parts: &'a Parts,
    data: &'a Data,
    models: Vec<(String, Arc<Model>)>,
    sides: Vec<(SidesKey, Sides)>,
}

/// What decides the sides of a stage: model, normaliser, points of each side at most.
type SidesKey = (String, String, [usize; 2]);

impl<'a> Workbench<'a> {
    /// Build stages on these points.
    pub fn new(parts: &'a Parts, data: &'a Data) -> Self {
        Self { parts, data, models: Vec::new(), sides: Vec::new() }
    }

    fn context(&self) -> BuildContext<'a> {
        BuildContext { seed: self.parts.settings.seed, source: Some(&self.data.source), ..BuildContext::default() }
    }

    fn model(&mut self, spec: &str) -> Result<Arc<Model>, Error> {
        if let Some((_, model)) = self.models.iter().find(|(known, _)| known == spec) {
            return Ok(Arc::clone(model));
        }
        let model = Arc::new(self.parts.registry.model(spec, &self.context())?);
        self.models.push((spec.to_string(), Arc::clone(&model)));
        Ok(model)
    }

    /// Return the sides of a stage: its points, thinned where it asks for that.
    fn sides(&mut self, spec: &str, stage: &Stage, model: &Arc<Model>, limits: [usize; 2]) -> Result<Sides, Error> {
        let normaliser = stage.normaliser.as_deref().or(model.normaliser).unwrap_or("paper");
        let key = (spec.to_string(), normaliser.to_string(), limits);
        if let Some((_, sides)) = self.sides.iter().find(|(known, _)| *known == key) {
            return Ok(sides.clone());
        }
        let (name, settings) = (&self.parts.settings.model, &self.parts.settings);
        let mut rng = stream(settings.seed, "thin");
        let mut choose = |side, points: Arc<Points>, limit: usize| -> Result<Arc<Points>, Error> {
            if limit == 0 || points.len() <= limit {
                return Ok(points);
            }
            thin(&points, limit, &mut rng).map(Arc::new).map_err(of_side(side))
        };
        if let Some(key) = model.source.attribute().filter(|key| self.data.source.attribute(key).is_none()) {
            let problem = format!("model `{name}` needs the attribute `{key}` of every source point");
            return Err(Error::Unsupported(problem));
        }
        let source = choose("source", adapt("source", name, model.source_points, &self.data.source)?, limits[0])?;
        let target = choose("target", adapt("target", name, model.target_points, &self.data.target)?, limits[1])?;
        let built = self.parts.registry.normaliser(normaliser)?;
        let (model, reference) = (Arc::clone(model), &self.parts.reference);
        let sides = Sides::new(model, built.as_ref(), source, target, reference, &self.parts.execution)?;
        self.sides.push((key, sides.clone()));
        Ok(sides)
    }

    /// Build a stage.
    pub fn stage(&mut self, stage: &Stage) -> Result<ReadyStage, Error> {
        let (parts, data) = (self.parts, self.data);
        let spec = stage.model.clone().unwrap_or_else(|| parts.settings.model.clone());
        let model = self.model(&spec)?;
        let weighting = parts.registry.weighting(&stage.weighting)?;
        // A random choice of points has a sampling error of its own: fine for a start, not for the statistics.
        let exact = weighting.has_statistic() || stage.noise != NoiseModel::None;
        let limit = |points: &Points, limit: usize| if exact && !points.is_in_curve_order() { 0 } else { limit };
        let limits = [limit(&data.source, stage.source_points), limit(&data.target, stage.target_points)];
        let sides = self.sides(&spec, stage, &model, limits)?;
        let all_source = match limits[0] {
            0 => Arc::clone(&sides.source),
            _ => adapt("source", &parts.settings.model, model.source_points, &data.source)?,
        };
        let family = sides.family(&self.context(), |context| parts.registry.family(&stage.features, context))?;
        let problem = sides.problem(&family, stage.noise.into(), parts.freedom.as_ref());
        let solver = parts.settings.solver_of(stage, &model).to_string();
        Ok(ReadyStage {
            stage: Stage {
                model: Some(spec),
                normaliser: stage.normaliser.clone().or(model.normaliser.map(str::to_string)).or(Some("paper".into())),
                solver: Some(solver.clone()),
                ..stage.clone()
            },
            solver: parts.registry.solver(&solver)?,
            weighting,
            problem,
            family,
            sides,
            all_source,
            all_lifted: OnceLock::new(),
            target_tree: OnceLock::new(),
            num_source: effective(&data.source),
            num_target: effective(&data.target),
            counts: [data.target.len(), data.source.len()],
        })
    }
}

/// A stage, ready to be solved from many starts; every choice of its `stage` is filled in.
pub(super) struct ReadyStage {
    pub stage: Stage,
    pub sides: Sides,
    /// The problem, not weighted.
    pub problem: MomentProblem,
    pub solver: Box<dyn Solver>,
    pub weighting: Box<dyn Weighting>,
    family: Arc<dyn DynFamily>,
    /// All source points: distances are to the whole shape, not to what a quadrature keeps of it.
    pub all_source: Arc<Points>,
    all_lifted: OnceLock<Arc<LiftedPoints>>,
    /// The target's search structure, built when it is first asked.
    target_tree: OnceLock<Neighbours>,
    num_source: f64,
    pub num_target: f64,
    counts: [usize; 2],
}

impl ReadyStage {
    /// Return the model.
    pub fn model(&self) -> &Model {
        &self.sides.model
    }

    /// Return the problem of the stage on other points.
    pub fn problem_on(&self, parts: &Parts, source: &Points, target: &Points) -> MomentProblem {
        self.sides.problem_on(&self.family, self.stage.noise.into(), parts.freedom.as_ref(), source, target)
    }

    /// Return all source points, lifted.
    fn lifted(&self) -> &Arc<LiftedPoints> {
        self.all_lifted.get_or_init(|| match Arc::ptr_eq(&self.all_source, &self.sides.source) {
            true => self.sides.lifted_source(),
            false => Arc::new(self.model().source.lift(&self.all_source)),
        })
    }

    /// Return what moves all source points.
    pub fn mover(&self) -> Mover<'_> {
        Mover::over(&self.problem, Arc::clone(self.lifted()))
    }

    /// Map all source points into the feature space at theta, not normalised.
    pub fn mapped_source(&self, theta: &[f64]) -> Result<Points, Error> {
        map_points(self.model().source.as_ref(), self.lifted(), &theta[..self.own()], self.problem.execution())
            .map_err(of_side("source"))
    }

    /// Return the ambient length of the model's own theta.
    pub fn own(&self) -> usize {
        self.model().layout.manifold().ambient()
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
        self.problem.noise().num_parameters(self.model().dim())
    }

    /// Return kappa of a sampling for the effective numbers of points.
    pub fn kappa(&self, sampling: Sampling) -> f64 {
        sampling.kappa(self.num_target, self.num_source)
    }

    /// Choose the sampling by distances between the points.
    pub fn detect(&self, support: &Support, parts: &Parts) -> Sampling {
        Sampling::detect(support, self.model().dim(), self.counts, &parts.criteria)
    }

    /// Return the size of a normalised unit in the feature space.
    pub fn unit(&self) -> f64 {
        let matrix = self.sides.transform.matrix();
        let trace: f64 = (0..self.model().dim()).map(|d| matrix[d][d].abs()).sum();
        self.model().dim() as f64 / trace
    }

    /// Take theta from another stage: its nuisance parameters serve where the numbers agree.
    pub fn adopt(&self, theta: &[f64], parts: &Parts) -> Vec<f64> {
        let mut own = theta[..self.own()].to_vec();
        let (needed, dim) = (self.num_nuisance(), self.model().dim());
        let first = (parts.criteria.first_noise * self.unit()).powi(2);
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
    pub fn noise(&self, theta: &[f64], parts: &Parts) -> Option<[[f64; 3]; 3]> {
        let dim = self.model().dim();
        let floor = (parts.criteria.least_noise * self.unit()).powi(2);
        let mut covariance = self.problem.noise().covariance(dim, &theta[self.own()..])?;
        (0..dim).for_each(|d| covariance[d][d] = covariance[d][d].max(floor));
        Some(covariance)
    }

    /// Return the standard deviation of the noise in one coordinate, 0 where its variance is negative.
    pub fn noise_sigma(&self, theta: &[f64]) -> Option<f64> {
        let dim = self.model().dim();
        let covariance = self.problem.noise().covariance(dim, &theta[self.own()..])?;
        let mean = (0..dim).map(|d| covariance[d][d]).sum::<f64>() / dim as f64;
        Some(mean.max(0.0).sqrt())
    }

    /// Return the standard deviation of the noise as [`ReadyStage::noise_sigma`], `None` where the weighted fit does not
    /// determine a full covariance: a variance of many parameters may be far off, or negative, and still fit.
    pub fn known_noise_sigma(&self, weighted: &MomentProblem, theta: &[f64], parts: &Parts) -> Option<f64> {
        let sigma = self.noise_sigma(theta)?;
        if self.stage.noise != NoiseModel::Full {
            return Some(sigma);
        }
        let dim = self.model().dim();
        let diagonal = |at: usize| (0..dim).any(|d| at == d * dim - d * d.saturating_sub(1) / 2);
        let weights: Vec<f64> =
            (0..self.num_nuisance()).map(|at| if diagonal(at) { (dim as f64).recip() } else { 0.0 }).collect();
        let deviation = statistics::deviation_of(weighted, theta, self.own_tangent(), &weights)?;
        (deviation <= parts.criteria.noise_reported * sigma * sigma).then_some(sigma)
    }

    /// Compare the points at theta.
    pub fn support(&self, theta: &[f64]) -> Result<Support, Error> {
        let source = self.mapped_source(theta)?;
        if self.model().target.is_moving() {
            let target = self.sides.mapped_target_at(&theta[..self.own()])?;
            return Ok(Support::of(&source, &target, self.noise_sigma(theta)));
        }
        Ok(Support::against(&source, self.target_tree(), self.noise_sigma(theta)))
    }

    /// Return the search structure of a target that does not move.
    pub fn target_tree(&self) -> &Neighbours {
        self.target_tree.get_or_init(|| Neighbours::new(self.sides.mapped_target.rows(), self.model().dim()))
    }

    /// Return the share of the source's nearest distances that are equal: a lattice has nearly all.
    pub fn source_spacing_share(&self) -> f64 {
        Neighbours::new(self.all_source.rows(), self.all_source.dim()).equal_spacing_share()
    }

    /// Return where the randomness of the residual comes from at theta; `weighted` is the weighted problem so far.
    ///
    /// The noise is the nuisance parameter where the weighted fit so far determines it; else, and before any weighting, it is
    /// what the distances along the normals say.
    pub fn randomness(
        &self,
        theta: &[f64],
        weighted: Option<&MomentProblem>,
        support: &Support,
        kappa: f64,
        parts: &Parts,
    ) -> Randomness {
        let floor = parts.criteria.least_noise * self.unit();
        let determined = weighted.is_some_and(|problem| self.noise_is_determined(problem, theta, parts));
        let noise = self.noise(theta, parts).filter(|_| determined).unwrap_or_else(|| {
            let variance = support.normal_sigma.max(floor).powi(2);
            let mut covariance = [[0.0; 3]; 3];
            (0..self.model().dim()).for_each(|d| covariance[d][d] = variance);
            covariance
        });
        Randomness { noise, kappa, num_target: self.num_target }
    }

    /// Say whether the weighted fit at theta determines the variance of the noise.
    fn noise_is_determined(&self, weighted: &MomentProblem, theta: &[f64], parts: &Parts) -> bool {
        let own = self.own_tangent();
        let Some(sigma) = self.noise_sigma(theta) else { return false };
        statistics::deviation(weighted, theta, own)
            .is_some_and(|deviation| deviation < parts.criteria.noise_known * sigma * sigma)
    }

    /// Weight the problem by the covariance of the means at theta.
    ///
    /// # Errors
    /// [`Error`] where a mapped point is not finite or the weighted rows are fewer than the unknowns.
    pub fn weighted_at(&self, theta: &[f64], randomness: &Randomness, seed: u64) -> Result<MomentProblem, Error> {
        let covariance =
            statistics::feature_covariance(&self.problem, theta, randomness, seed).map_err(of_side("source"))?;
        let whitening = self.weighting.whitening(&covariance, self.problem.num_features());
        let problem = self.problem.clone().with_whitening(whitening.map(|whitening| whitening.matrix));
        problem.require_enough_features()?;
        Ok(problem)
    }
}

/// Return (sum w)^2 / sum w^2, the number of equally weighted points with the same variance of a mean.
fn effective(points: &Points) -> f64 {
    let (sum, squares) = points.weights().iter().fold((0.0, 0.0), |(s, t), w| (s + w, t + w * w));
    sum * sum / squares
}
