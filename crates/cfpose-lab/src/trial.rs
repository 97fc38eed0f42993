//! One trial: data from its stream, every method on the same data.

use std::any::Any;
use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use cfpose::theta::{Layout, RotationForm};
use cfpose::{BuildContext, Estimate, Estimator, Execution, PoseError, Supervision};
use cfpose_optim::Manifold;
use serde_json::Map;

use crate::calibration::estimate_mahalanobis;
use crate::config::Experiment;
use crate::data::of_method;
use crate::lab::Lab;
use crate::method::{Method, SCENARIO_START};
use crate::metric::Score;
use crate::path::{Trace, start_offset};
use crate::plan::{Cell, PlannedTrial};
use crate::record::{DataHashes, Record, VERSION};
use crate::rows::Rows;
use crate::scenario::problems::Posed;
use crate::scenario::{Determined, Scenario, ScenarioError, Success, Trial};
use crate::seed::{data_stream, method_seed};
use crate::value::json_of;

mod external;
mod problem;

/// The data of a trial.
pub(crate) enum Drawn {
    /// Two point sets.
    Points(Box<Trial>),
    /// A least-squares problem.
    Problem(Posed),
}

/// What all trials of a run share.
pub(crate) struct Bench<'a> {
    pub lab: &'a Lab,
    pub experiment: &'a Experiment,
    pub fingerprint: &'a str,
    pub execution: Execution,
    pub cancel: Option<&'a AtomicBool>,
    /// Hashes of the files of every cell's scenario.
    pub data: &'a [DataHashes],
    /// What other programs found.
    pub rows: Option<&'a Rows>,
}

impl Bench<'_> {
    /// Compute the records of one trial for the given methods.
    pub(crate) fn records(
        &self,
        scenario: &dyn Scenario,
        cell: &Cell,
        planned: &PlannedTrial,
        methods: &[&Method],
    ) -> Vec<Record> {
        let data = self.draw(scenario, planned);
        let record = |method: &&Method| {
            let begin = Instant::now();
            let mut record = self.blank(cell, planned, method);
            match &data {
                Ok(drawn) => {
                    if let Drawn::Points(trial) = drawn {
                        (record.num_source, record.num_target) = (trial.source.len(), trial.target.len());
                        record.conditions =
                            trial.conditions.iter().map(|(name, value)| (name.to_string(), json_of(value))).collect();
                        record.determined = trial.determined == Determined::Theta;
                    }
                    // Code of entries that a program added may panic: that costs its own row, not the run.
                    let before = record.clone();
                    let solve = AssertUnwindSafe(|| match drawn {
                        Drawn::Points(trial) if method.external => self.take(scenario, trial, &mut record),
                        Drawn::Points(trial) => self.solve(scenario, trial, planned, method, &mut record),
                        Drawn::Problem(posed) => self.solve_problem(scenario, posed, planned, method, &mut record),
                    });
                    if let Err(panic) = catch_unwind(solve) {
                        record = Record { message: Some(format!("a panic: {}", words(panic.as_ref()))), ..before };
                    }
                }
                Err(problem) => record.message = Some(problem.to_string()),
            }
            if !method.external {
                record.seconds = begin.elapsed().as_secs_f64();
                record.timed_out = self.experiment.deadline_secs.is_some_and(|limit| record.seconds >= limit);
            }
            record.seal();
            record
        };
        methods.iter().map(record).collect()
    }

    /// Draw the data of a trial.
    pub(crate) fn draw(&self, scenario: &dyn Scenario, planned: &PlannedTrial) -> Result<Drawn, ScenarioError> {
        let draw = || {
            let mut rng = data_stream(self.experiment.seed, planned.key);
            match scenario.problems() {
                Some(problems) => problems.posed(&mut rng).map(Drawn::Problem),
                None => scenario.trial(&mut rng).map(|trial| Drawn::Points(Box::new(trial))),
            }
        };
        catch_unwind(AssertUnwindSafe(draw)).unwrap_or_else(|panic| Err(ScenarioError::Panicked(words(panic.as_ref()))))
    }

    /// Build a method's problem on the data of a trial.
    pub(crate) fn prepare(
        &self,
        scenario: &dyn Scenario,
        trial: &Trial,
        planned: &PlannedTrial,
        method: &Method,
    ) -> Result<Estimator, cfpose::Error> {
        let seed = method_seed(self.experiment.seed, planned.key);
        let settings = method.resolved(&self.lab.registry, scenario.model(), trial.start.as_deref(), seed)?;
        let estimator = Estimator::new(&self.lab.registry, &settings, &trial.source, &trial.target, &self.execution)?;
        estimator.problem().require_enough_features()?;
        Ok(estimator)
    }

    /// Make the record of a trial that has no estimate.
    fn blank(&self, cell: &Cell, planned: &PlannedTrial, method: &Method) -> Record {
        let parameters: Map<_, _> = cell.parameters.iter().map(|(key, text)| (key.clone(), json_of(text))).collect();
        Record {
            experiment: self.fingerprint.to_string(),
            scenario: cell.scenario.clone(),
            parameters,
            method: method.name.clone(),
            conditions: Map::new(),
            determined: true,
            repetition: planned.repetition,
            key: format!("{:016x}", planned.key),
            success: false,
            success_sum: false,
            rotation_deg: None,
            translation: None,
            error: None,
            e_sum: None,
            metrics: BTreeMap::new(),
            theta: None,
            status: "unsupported".to_string(),
            usable: false,
            verdict: Some("failed".to_string()),
            by: None,
            noise_sigma: None,
            j_statistic: None,
            degrees_of_freedom: None,
            p_value: None,
            mahalanobis: None,
            mahalanobis_dof: None,
            cost: None,
            evaluations: 0,
            iterations: 0,
            starts: 0,
            timed_out: false,
            num_source: 0,
            num_target: 0,
            unknowns: 0,
            start_offset: BTreeMap::new(),
            trace: Vec::new(),
            message: None,
            isa: self.execution.isa.name().to_string(),
            seconds: 0.0,
            data: self.data[planned.cell]
                .iter()
                .map(|(name, hash)| (name.clone(), hash.clone()))
                .chain(of_method(&self.lab.registry, method))
                .collect(),
            version: VERSION.to_string(),
            checksum: String::new(),
        }
    }

    /// Estimate and fill in the record; a method that does not apply leaves its reason.
    fn solve(
        &self,
        scenario: &dyn Scenario,
        trial: &Trial,
        planned: &PlannedTrial,
        method: &Method,
        record: &mut Record,
    ) {
        let solved = self.prepare(scenario, trial, planned, method).and_then(|estimator| {
            let deadline = self.experiment.deadline_secs.map(Duration::from_secs_f64);
            let mut trace = Trace::default();
            let estimate =
                estimator.solve(Supervision { cancel: self.cancel, deadline, observer: Some(&mut trace) })?;
            record.trace = trace.costs();
            Ok((estimator, estimate))
        });
        match solved {
            Ok((estimator, estimate)) => self.score(scenario, trial, method, &estimator, &estimate, record),
            Err(problem) => record.message = Some(problem.to_string()),
        }
    }

    fn score(
        &self,
        scenario: &dyn Scenario,
        trial: &Trial,
        method: &Method,
        estimator: &Estimator,
        estimate: &Estimate,
        record: &mut Record,
    ) {
        record.status = estimate.outcome.status.name().to_string();
        record.usable = estimate.usable();
        record.verdict = estimate.verdict.map(|verdict| verdict.name().to_string());
        record.by = Some(if estimate.refined { "points" } else { "moments" }.to_string());
        record.cost = Some(estimate.outcome.cost).filter(|cost| cost.is_finite());
        record.evaluations = estimate.evaluations;
        record.iterations = estimate.iterations;
        record.starts = estimate.starts;
        if !record.usable {
            record.message = Some(estimate.outcome.message.clone());
        }
        // The scenario's model built once already, when the experiment was read.
        let Ok(model) = self.lab.registry.model(scenario.model(), &BuildContext::default()) else { return };
        record.unknowns = model.layout.manifold().tangent();
        if method.start == SCENARIO_START {
            record.start_offset = start_offset(&model.layout, trial);
        }
        record.theta = Some(model.layout.to_list(&estimate.theta, RotationForm::Vector))
            .filter(|list| list.iter().all(|v| v.is_finite()));
        let layout = &estimator.model().layout;
        let Some((score, truth)) = nearest_score(scenario, layout, &estimate.theta, trial) else { return };
        judge(scenario, trial, &score, record);
        if let Some(statistics) = &estimate.statistics {
            let manifold = layout.manifold();
            record.noise_sigma = statistics.noise_sigma;
            record.j_statistic = Some(statistics.j_statistic).filter(|value| value.is_finite());
            record.degrees_of_freedom = Some(statistics.degrees_of_freedom);
            record.p_value = Some(statistics.p_value);
            record.mahalanobis = estimate_mahalanobis(estimator, estimate, truth);
            record.mahalanobis_dof = record.mahalanobis.map(|_| manifold.tangent());
        }
    }
}

/// Return the message of a panic on one line.
fn words(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<String>().map(String::as_str).or_else(|| panic.downcast_ref::<&str>().copied());
    text.unwrap_or("without a message").split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Write the metrics of a usable or unusable estimate, and whether it is a success.
fn judge(scenario: &dyn Scenario, trial: &Trial, score: &Score, record: &mut Record) {
    write_score(scenario, score, record);
    let possible = record.usable && trial.determined != Determined::Nothing;
    record.success = possible && scenario.succeeds(score, trial);
    record.success_sum = match (&score.pose, trial.success) {
        (Some(error), Success::Error(_)) => possible && trial.success.holds_for_sum(error),
        _ => record.success,
    };
}

/// Write the metrics into a record: those of a pose into their columns, the others by name.
fn write_score(scenario: &dyn Scenario, score: &Score, record: &mut Record) {
    if let Some(error) = &score.pose {
        record.rotation_deg = Some(error.angle.to_degrees());
        record.translation = Some(error.translation);
        record.error = Some(error.total());
        record.e_sum = Some(error.angle + error.translation);
    }
    let named = scenario.metrics().iter().zip(&score.values);
    for (metric, value) in named.filter(|(metric, value)| !metric.is_of_pose() && value.is_finite()) {
        record.metrics.insert(metric.name.to_string(), *value);
    }
    if let (None, Some(first)) = (&score.pose, scenario.metrics().first())
        && first.smaller_is_better
    {
        record.error = score.values.first().copied().filter(|value| value.is_finite());
    }
}

/// Measure an estimate against the nearest of the true thetas of a trial; return that theta too.
pub fn nearest_score<'a>(
    scenario: &dyn Scenario,
    layout: &Layout,
    estimate: &[f64],
    trial: &'a Trial,
) -> Option<(Score, &'a [f64])> {
    let metrics = scenario.metrics();
    std::iter::once(&trial.truth)
        .chain(&trial.equally_true)
        .filter_map(|truth| Some((scenario.score(layout, estimate, truth, trial)?, truth.as_slice())))
        .min_by(|a, b| a.0.miss(metrics).total_cmp(&b.0.miss(metrics)))
}

/// Compare an estimate with the nearest of the true thetas of a trial as poses; return that theta too.
pub fn nearest_truth<'a>(
    scenario: &dyn Scenario,
    layout: &Layout,
    estimate: &[f64],
    trial: &'a Trial,
) -> Option<(PoseError, &'a [f64])> {
    nearest_score(scenario, layout, estimate, trial).and_then(|(score, truth)| Some((score.pose?, truth)))
}
