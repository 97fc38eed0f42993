//! From a pipeline to an estimate: search, question, refine, and say how sure one may be.

use cfpose_optim::manifold::Manifold;
use cfpose_optim::outcome::Counts;
use cfpose_optim::{Outcome, Status};

use super::engine::{COHERENT, Engine, Hypothesis, PARTIAL};
use super::level::{Ingredients, Solved};
use super::pipeline::{Outliers, Pipeline};
use super::{Alternative, Estimate, Prepared, Start, Supervision, Verdict};
use crate::conditioning::Conditioning;
use crate::entry::Registry;
use crate::error::Error;
use crate::robust::support::Support;
use crate::statistics::Statistics;

/// p-value of J below which a fit is suspect. Smaller than a test's usual level: the models are idealised, and a false alarm
/// costs the user more than the statistic's last digit.
const P_SUSPECT: f64 = 1e-3;
/// Share of outliers above which a fit is suspect whatever else agrees.
const MAX_CLUTTER: f64 = 0.45;

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
        let found = engine.search(&mut supervision)?;
        let Some(best) = found.first() else { return self.nothing(&engine) };
        let mut draft = Draft::of(best);
        if !draft.accepted && pipeline.outliers != Outliers::None {
            let starts = match &self.settings.start {
                Start::Given(thetas) => thetas.clone(),
                Start::Named(_) => Vec::new(),
            };
            self.question(&mut engine, &found, &starts, &mut draft, &mut supervision)?;
        }
        self.refine(&engine, &mut draft)?;
        self.finish(&engine, draft, &found)
    }

    /// Replace the draft where leaving outliers out explains the data better.
    fn question(
        &self,
        engine: &mut Engine<'_>,
        found: &[Hypothesis],
        starts: &[Vec<f64>],
        draft: &mut Draft,
        supervision: &mut Supervision<'_>,
    ) -> Result<(), Error> {
        let Some(repaired) = engine.repair(found, starts, supervision)? else { return Ok(()) };
        let better = draft.support.is_none_or(|s| repaired.support.distance() < s.distance()) || !draft.plausible;
        match repaired.hypothesis {
            Some(hypothesis) if hypothesis.accepted => {
                *draft = Draft::of(&hypothesis);
                draft.clutter = Some(repaired.robust.clutter);
                // What the outliers leave unexplained is known; what the source leaves is not.
                draft.support = Some(repaired.support);
            }
            _ if better => {
                let robust = repaired.robust;
                if let Some(statistics) = &mut draft.statistics {
                    statistics.covariance = robust.covariance;
                    statistics.noise_sigma = Some(robust.sigma);
                }
                draft.theta[..].copy_from_slice(&robust.theta);
                draft.support = Some(repaired.support);
                draft.clutter = Some(robust.clutter);
                draft.plausible = engine.is_plausible(&draft.theta);
            }
            _ => {}
        }
        Ok(())
    }

    /// Refine by closest points where the noise is small: exact without noise, biased with much.
    fn refine(&self, engine: &Engine<'_>, draft: &mut Draft) -> Result<(), Error> {
        let level = engine.last();
        let sigma = draft.statistics.as_ref().and_then(|s| s.noise_sigma).or(level.noise_sigma(&draft.theta));
        let small = sigma.is_some_and(|sigma| sigma < engine.pipeline.refine_below * level.unit());
        if !small || !draft.outcome.usable() {
            return Ok(());
        }
        let Some(fit) = engine.refined(&draft.theta) else { return Ok(()) };
        let support = level.support(&fit.theta)?;
        // Never worse than its start.
        if draft.support.is_some_and(|before| support.target_rms > before.target_rms * 1.001) {
            return Ok(());
        }
        draft.theta = fit.theta;
        draft.support = Some(support);
        draft.refined = true;
        if let Some(statistics) = &mut draft.statistics {
            statistics.covariance = fit.covariance;
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
            draft.statistics.as_ref().map(|statistics| verdict(&draft, statistics))
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
        warnings.extend(reasons(&draft));
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
fn verdict(draft: &Draft, statistics: &Statistics) -> Verdict {
    let partial = draft.support.is_some_and(|s| s.unexplained_source > PARTIAL || s.coherence > COHERENT);
    let cluttered = draft.clutter.is_some_and(|share| share > MAX_CLUTTER);
    let agrees = draft.accepted && statistics.p_value >= P_SUSPECT;
    if agrees && draft.plausible && !partial && !cluttered { Verdict::Good } else { Verdict::Suspect }
}

/// Say in words why an estimate is not good.
fn reasons(draft: &Draft) -> Vec<String> {
    let mut reasons = Vec::new();
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
