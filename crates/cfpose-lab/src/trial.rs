//! One trial: data from its stream, every method on the same data.

use std::any::Any;
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
use crate::method::Method;
use crate::plan::{Cell, PlannedTrial};
use crate::record::{DataHashes, Record, VERSION};
use crate::scenario::{Determined, Scenario, ScenarioError, Trial};
use crate::seed::{data_stream, method_seed};
use crate::value::json_of;

/// What all trials of a run share.
pub(crate) struct Bench<'a> {
    pub lab: &'a Lab,
    pub experiment: &'a Experiment,
    pub fingerprint: &'a str,
    pub execution: Execution,
    pub cancel: Option<&'a AtomicBool>,
    /// Hashes of the files of every cell's scenario.
    pub data: &'a [DataHashes],
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
                Ok(trial) => {
                    record.conditions =
                        trial.conditions.iter().map(|(name, value)| (name.to_string(), json_of(value))).collect();
                    record.determined = trial.determined == Determined::Theta;
                    // Code of entries that a program added may panic: that costs its own row, not the run.
                    let before = record.clone();
                    let solve = AssertUnwindSafe(|| self.solve(scenario, trial, planned, method, &mut record));
                    if let Err(panic) = catch_unwind(solve) {
                        record = Record { message: Some(format!("a panic: {}", words(panic.as_ref()))), ..before };
                    }
                }
                Err(problem) => record.message = Some(problem.to_string()),
            }
            record.seconds = begin.elapsed().as_secs_f64();
            record.timed_out = self.experiment.deadline_secs.is_some_and(|limit| record.seconds >= limit);
            record.seal();
            record
        };
        methods.iter().map(record).collect()
    }

    /// Draw the data of a trial.
    pub(crate) fn draw(&self, scenario: &dyn Scenario, planned: &PlannedTrial) -> Result<Trial, ScenarioError> {
        let draw = || scenario.trial(&mut data_stream(self.experiment.seed, planned.key));
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
        let settings = method.settings(scenario.model(), trial.start.as_deref(), seed)?;
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
            let estimate = estimator.solve(Supervision { cancel: self.cancel, deadline, observer: None })?;
            Ok((estimator, estimate))
        });
        match solved {
            Ok((estimator, estimate)) => self.score(scenario, trial, &estimator, &estimate, record),
            Err(problem) => record.message = Some(problem.to_string()),
        }
    }

    fn score(
        &self,
        scenario: &dyn Scenario,
        trial: &Trial,
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
        record.theta = Some(model.layout.to_list(&estimate.theta, RotationForm::Vector))
            .filter(|list| list.iter().all(|v| v.is_finite()));
        let Some((error, truth)) = nearest_truth(scenario, &model.layout, &estimate.theta, trial) else { return };
        record.rotation_deg = Some(error.angle.to_degrees());
        record.translation = Some(error.translation);
        record.error = Some(error.total());
        record.e_sum = Some(error.angle + error.translation);
        let possible = record.usable && trial.determined != Determined::Nothing;
        record.success = possible && trial.success.holds(&error);
        record.success_sum = possible && trial.success.holds_for_sum(&error);
        if let Some(statistics) = &estimate.statistics {
            let manifold = model.layout.manifold();
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

/// Compare an estimate with the nearest of the true thetas of a trial; return that theta too.
pub fn nearest_truth<'a>(
    scenario: &dyn Scenario,
    layout: &Layout,
    estimate: &[f64],
    trial: &'a Trial,
) -> Option<(PoseError, &'a [f64])> {
    std::iter::once(&trial.truth)
        .chain(&trial.equally_true)
        .filter_map(|truth| Some((scenario.error(layout, estimate, truth)?, truth.as_slice())))
        .min_by(|a, b| a.0.total().total_cmp(&b.0.total()))
}
