//! From a pipeline to an estimate: search, question, refine, and say how sure one may be.

use cfpose_optim::manifold::Manifold;
use cfpose_optim::outcome::Counts;
use cfpose_optim::problem::LeastSquares;
use cfpose_optim::{Outcome, Status};

use super::engine::{COHERENT, Engine, Hypothesis, PARTIAL, ranked};
use super::level::{Ingredients, Solved};
use super::pipeline::{Outliers, Pipeline};
use super::{Alternative, Estimate, Prepared, Start, Supervision, Verdict};
use crate::distances::sampling::Sampling;
use crate::distances::support::Support;
use crate::error::Error;
use crate::registry::Registry;
use crate::statistics::Statistics;
use crate::statistics::conditioning::Conditioning;

/// p-value of J below which a fit is suspect. Smaller than a test's usual level: the models are idealised, and a false alarm
/// costs the user more than the statistic's last digit.
const P_SUSPECT: f64 = 1e-3;
/// Share of outliers above which a fit is suspect whatever else agrees.
const MAX_CLUTTER: f64 = 0.45;

/// Global starts that are climbed from before outliers are suspected.
const FIRST_GLOBAL: usize = 2;

/// A refinement is tried where the noise seems to be below so many times its limit.
const NEARLY: f64 = 4.0;

/// The state of an estimate while it is made.
struct Draft {
    theta: Vec<f64>,
    outcome: Outcome,
    statistics: Option<Statistics>,
    support: Option<Support>,
    accepted: bool,
    plausible: bool,
    clutter: Option<f64>,
    refined: bool,
    sampling: Option<&'static str>,
}

impl Draft {
    fn of(hypothesis: &Hypothesis) -> Self {
        let Solved { theta, outcome, statistics, support, sampling, .. } = hypothesis.solved.clone();
        Self {
            theta,
            outcome,
            statistics,
            support,
            accepted: hypothesis.accepted,
            plausible: hypothesis.plausible,
            clutter: None,
            refined: false,
            sampling: sampling.map(|s| s.name()),
        }
    }
}

/// One thing to try; the next is tried only while nothing is accepted.
enum Step {
    /// Climb from the given starts.
    Given(Vec<Vec<f64>>),
    /// Climb from perturbed copies of a start.
    Restarts(Vec<f64>, std::ops::Range<usize>),
    /// Climb from the next so many starts of the global strategy.
    Global(usize),
    /// Look for outliers, from the hypotheses so far and these thetas.
    Outliers(Vec<Vec<f64>>),
    /// Look for a pose that explains a part of both sets.
    Overlap,
}

/// Order what is tried by its cost: a start that fails for its own sake is cheaper to replace than outliers are to find,
/// and both are cheaper than a search everywhere.
fn plan(pipeline: &Pipeline, given: &[Vec<f64>]) -> Vec<Step> {
    let mut steps = vec![Step::Given(given.to_vec())];
    let restarts = if given.len() == 1 { pipeline.restarts } else { 0 };
    if let (Some(start), true) = (given.first(), restarts > 0) {
        steps.push(Step::Restarts(start.clone(), 0..1));
        steps.push(Step::Outliers(given.to_vec()));
        steps.push(Step::Restarts(start.clone(), 1..restarts));
    }
    if given.is_empty() && pipeline.outliers != Outliers::None {
        steps.push(Step::Global(FIRST_GLOBAL));
        steps.push(Step::Outliers(Vec::new()));
    }
    if given.is_empty() || pipeline.global_start.is_some() {
        steps.push(Step::Global(usize::MAX));
    }
    steps.push(Step::Outliers(Vec::new()));
    if pipeline.overlap {
        steps.push(Step::Overlap);
    }
    steps
}

/// Hypotheses so far, and the best of them as a draft.
struct Search {
    found: Vec<Hypothesis>,
    draft: Option<Draft>,
}

impl Search {
    /// Take one step.
    fn take(&mut self, engine: &mut Engine<'_>, step: Step, supervision: &mut Supervision<'_>) -> Result<(), Error> {
        let more = match step {
            Step::Given(starts) => engine.climb_given(&starts, supervision)?,
            Step::Restarts(start, range) => engine.restarts(&start, range, supervision)?,
            Step::Global(count) => engine.global(count, supervision)?,
            Step::Outliers(starts) => return self.question(engine, &starts, supervision),
            Step::Overlap => return self.look_for_overlap(engine, supervision),
        };
        if more.is_empty() {
            return Ok(());
        }
        let repaired = self.draft.as_ref().filter(|draft| draft.clutter.is_some()).and_then(|draft| draft.support);
        self.found.extend(more);
        self.found = ranked(std::mem::take(&mut self.found));
        let best = &self.found[0];
        let closer = |support: Support| best.solved.support.is_some_and(|s| s.distance() < support.distance());
        if best.accepted || repaired.is_none_or(closer) {
            self.draft = Some(Draft::of(best));
        }
        Ok(())
    }

    /// Replace the draft where another pose gives more points of both sides a partner.
    fn look_for_overlap(&mut self, engine: &mut Engine<'_>, supervision: &mut Supervision<'_>) -> Result<(), Error> {
        let Some(draft) = &mut self.draft else { return Ok(()) };
        if !draft.support.is_some_and(|s| s.unexplained_source.max(s.unexplained_target) > PARTIAL) {
            return Ok(());
        }
        let Some(robust) = engine.by_overlap(&draft.theta, supervision)? else { return Ok(()) };
        draft.support = Some(engine.last().support(&robust.theta)?);
        draft.plausible = engine.is_plausible(&robust.theta);
        draft.theta = robust.theta;
        draft.clutter = Some(robust.clutter);
        if let Some(statistics) = &mut draft.statistics {
            statistics.covariance = robust.covariance;
            statistics.noise_sigma = Some(robust.sigma);
        }
        Ok(())
    }

    /// Replace the draft where leaving outliers out explains the data better.
    fn question(
        &mut self,
        engine: &mut Engine<'_>,
        starts: &[Vec<f64>],
        supervision: &mut Supervision<'_>,
    ) -> Result<(), Error> {
        let Some(repaired) = engine.repair(&self.found, starts, supervision)? else { return Ok(()) };
        let (robust, support) = (repaired.robust, repaired.support);
        let closer =
            |draft: &Draft| draft.support.is_none_or(|s| support.distance() < s.distance()) || !draft.plausible;
        let better = self.draft.as_ref().is_none_or(closer);
        let Some(hypothesis) = repaired.hypothesis else { return Ok(()) };
        if !hypothesis.accepted && !better {
            return Ok(());
        }
        let mut draft = Draft::of(&hypothesis);
        draft.clutter = Some(robust.clutter);
        if !hypothesis.accepted {
            // The moments of what is left still disagree: the robust fit itself is the estimate.
            draft.theta.copy_from_slice(&robust.theta);
            draft.plausible = engine.is_plausible(&draft.theta);
            if let Some(statistics) = &mut draft.statistics {
                statistics.covariance = robust.covariance;
                statistics.noise_sigma = Some(robust.sigma);
            }
        }
        // What the outliers leave unexplained is known; what the source leaves is not.
        draft.support = Some(support);
        self.draft = Some(draft);
        Ok(())
    }
}

impl Prepared {
    /// Run the pipeline.
    pub(super) fn run(
        &self,
        registry: &Registry,
        pipeline: &Pipeline,
        mut supervision: Supervision<'_>,
    ) -> Result<Estimate, Error> {
        let ingredients = Ingredients {
            registry,
            settings: &self.settings,
            source: &self.raw_source,
            target: &self.raw_target,
            execution: &self.execution,
        };
        let mut engine = Engine::new(ingredients, pipeline)?;
        let mut search = Search { found: Vec::new(), draft: None };
        for step in plan(pipeline, &engine.given()?) {
            search.take(&mut engine, step, &mut supervision)?;
            if search.draft.as_ref().is_some_and(|draft| draft.accepted) {
                break;
            }
        }
        let Search { found, draft } = search;
        let Some(mut draft) = draft else { return self.nothing(&engine) };
        self.refine(&engine, &mut draft)?;
        self.finish(&engine, draft, &found)
    }

    /// Refine by closest points where the noise is small: exact without noise, biased with much.
    ///
    /// Distances along the normals say how large the noise is, whatever the sampling; a pose that is still off adds its
    /// misfit, so the gate is asked again after the refinement.
    fn refine(&self, engine: &Engine<'_>, draft: &mut Draft) -> Result<(), Error> {
        let level = engine.last();
        let Some(before) = draft.support.filter(|_| draft.outcome.usable() && engine.pipeline.refine_below > 0.0)
        else {
            return Ok(());
        };
        // Noise below half the spacing does not change who is nearest, however large it is against the shape.
        let limit = (engine.pipeline.refine_below * level.unit()).max(0.5 * before.source_spacing);
        if before.normal_sigma > NEARLY * limit {
            return Ok(());
        }
        let Some(fit) = level.refined(&draft.theta) else { return Ok(()) };
        let support = level.support(&fit.theta)?;
        // Never worse than its start; below the spacing, distances between points do not rank thetas.
        let bound = (1.001 * before.target_rms).max(before.source_spacing);
        if support.normal_sigma > limit || support.target_rms > bound {
            return Ok(());
        }
        draft.theta = fit.theta;
        draft.support = Some(support);
        draft.refined = true;
        if let Some(statistics) = &mut draft.statistics {
            // The scatter of the residuals is that of one sampling; where there are two, both move the estimate.
            let samplings = if draft.sampling == Some(Sampling::Independent.name()) { 2.0 } else { 1.0 };
            statistics.covariance = fit.covariance.iter().map(|v| samplings * v).collect();
            statistics.noise_sigma = Some(support.normal_sigma);
        }
        Ok(())
    }

    /// Put the estimate together.
    fn finish(&self, engine: &Engine<'_>, draft: Draft, found: &[Hypothesis]) -> Result<Estimate, Error> {
        let own = self.model.layout.manifold().ambient();
        let theta = draft.theta[..own].to_vec();
        let examined = self.examination(&theta);
        let verdict = if !draft.outcome.usable() {
            Some(Verdict::Failed)
        } else {
            draft.statistics.as_ref().map(|statistics| verdict(engine, &draft, statistics))
        };
        let mut alternatives = Vec::new();
        for other in found.iter().filter(|h| h.solved.outcome.usable()) {
            let other_theta = other.solved.theta[..own].to_vec();
            let distinct = |known: &[f64]| engine.distance(known, &other_theta) > 0.05;
            if distinct(&theta) && alternatives.iter().all(|known: &Alternative| distinct(&known.theta)) {
                let verdict = other.solved.statistics.as_ref().map(|_| match other.accepted {
                    true => Verdict::Good,
                    false => Verdict::Suspect,
                });
                alternatives.push(Alternative { theta: other_theta, cost: other.solved.outcome.cost, verdict });
            }
        }
        let mut warnings = examined.0;
        warnings.extend(reasons(engine, &draft));
        warnings.extend(examined.1.warnings());
        Ok(Estimate {
            theta,
            evaluations: engine.reports.iter().map(|r| r.evaluations).sum(),
            iterations: engine.iterations,
            starts: engine.starts,
            verdict,
            alternatives,
            warnings,
            conditioning: examined.1,
            statistics: draft.statistics,
            support: draft.support,
            clutter: draft.clutter,
            refined: draft.refined,
            sampling: draft.sampling,
            stages: engine.reports.clone(),
            outcome: draft.outcome,
        })
    }

    /// No start survived the gates: an estimate that says so.
    fn nothing(&self, engine: &Engine<'_>) -> Result<Estimate, Error> {
        let start = match &self.settings.start {
            Start::Given(thetas) if !thetas.is_empty() => thetas[0].clone(),
            _ => self.model.identity.clone(),
        };
        let outcome = Outcome {
            theta: start.clone(),
            cost: f64::INFINITY,
            violation: 0.0,
            status: Status::Stalled,
            message: "no start led to a plausible theta: in front of the camera, facing it".to_string(),
            gradient_norm: f64::NAN,
            counts: Counts::default(),
            seconds: 0.0,
            trace: Vec::new(),
        };
        Ok(Estimate {
            theta: start,
            evaluations: engine.reports.iter().map(|r| r.evaluations).sum(),
            iterations: engine.iterations,
            starts: engine.starts,
            verdict: Some(Verdict::Failed),
            alternatives: Vec::new(),
            warnings: Vec::new(),
            conditioning: Conditioning::unknown(self.num_unknowns()),
            statistics: None,
            support: None,
            clutter: None,
            refined: false,
            sampling: None,
            stages: engine.reports.clone(),
            outcome,
        })
    }
}

/// Say how sure one may be.
fn verdict(engine: &Engine<'_>, draft: &Draft, statistics: &Statistics) -> Verdict {
    let partial = draft.support.is_some_and(|s| s.unexplained_source > PARTIAL || s.coherence > COHERENT);
    let cluttered = draft.clutter.is_some_and(|share| share > MAX_CLUTTER);
    let agrees = draft.accepted && statistics.p_value >= P_SUSPECT;
    if agrees && draft.plausible && !partial && !cluttered && is_informative(engine, statistics) {
        Verdict::Good
    } else {
        Verdict::Suspect
    }
}

/// Say whether the points outnumber the feature means by far: a handful of points can match any means.
fn is_informative(engine: &Engine<'_>, statistics: &Statistics) -> bool {
    let level = engine.last();
    let means = statistics.degrees_of_freedom + level.problem.manifold().tangent();
    level.fewest_points() * level.model.dim() >= 2 * means
}

/// Say in words why an estimate is not good.
fn reasons(engine: &Engine<'_>, draft: &Draft) -> Vec<String> {
    let mut reasons = Vec::new();
    if draft.statistics.as_ref().is_some_and(|s| !is_informative(engine, s)) {
        let few = engine.last().fewest_points();
        reasons.push(format!("{few} points are too few for the statistics of so many feature means"));
    }
    if let Some(statistics) = draft.statistics.as_ref().filter(|s| s.p_value < P_SUSPECT) {
        reasons.push(format!(
            "the statistics refuse the fit: J = {:.0} with {} degrees of freedom",
            statistics.j_statistic, statistics.degrees_of_freedom
        ));
    }
    if let Some(support) = &draft.support {
        if support.coherence > COHERENT {
            reasons.push(format!(
                "neighbouring points miss the shape together ({:.0} % of the variance)",
                100.0 * support.coherence
            ));
        }
        if support.unexplained_source > PARTIAL {
            reasons.push(format!(
                "partial overlap: {:.0} % of the source has no target near it",
                100.0 * support.unexplained_source
            ));
        }
    }
    if let Some(share) = draft.clutter.filter(|share| *share > 0.0) {
        reasons.push(format!("{:.1} % of the target points are outliers", 100.0 * share));
    }
    reasons
}
