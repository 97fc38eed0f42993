//! One method on one least-squares problem.

use std::time::Duration;

use cfpose::Settings;
use cfpose_optim::{Control, Outcome, Stopping};

use super::{Bench, write_score};
use crate::method::Method;
use crate::plan::PlannedTrial;
use crate::record::Record;
use crate::scenario::Scenario;
use crate::scenario::problems::{Ended, Posed};
use crate::seed::method_seed;

impl Bench<'_> {
    /// Solve and fill in the record; a solver that does not apply leaves its reason.
    pub(super) fn solve_problem(
        &self,
        scenario: &dyn Scenario,
        posed: &Posed,
        planned: &PlannedTrial,
        method: &Method,
        record: &mut Record,
    ) {
        match self.outcome(posed, planned, method) {
            Ok(outcome) => score(scenario, &outcome, record),
            Err(problem) => record.message = Some(problem),
        }
    }

    fn outcome(&self, posed: &Posed, planned: &PlannedTrial, method: &Method) -> Result<Outcome, String> {
        let seed = method_seed(self.experiment.seed, planned.key);
        let solver = self.lab.registry.solver(method.solver_alone()).map_err(|problem| problem.to_string())?;
        let mut control = Control { stopping: stopping(method), seed, cancel: self.cancel, ..Control::default() };
        control.stopping.deadline = self.experiment.deadline_secs.map(Duration::from_secs_f64);
        solver.solve(posed.problem.as_ref(), &posed.start, &mut control).map_err(|problem| problem.to_string())
    }
}

/// Return the stopping rules of the preset with the method's budgets.
fn stopping(method: &Method) -> Stopping {
    let mut stopping = Settings::preset(&method.preset, "").map_or_else(|_| Stopping::default(), |s| s.stopping);
    method.limit(&mut stopping);
    stopping
}

fn score(scenario: &dyn Scenario, outcome: &Outcome, record: &mut Record) {
    record.status = outcome.status.name().to_string();
    record.usable = outcome.status.usable() && outcome.cost.is_finite();
    // A solver gives no verdict about the data.
    record.verdict = (!record.usable).then(|| "failed".to_string());
    record.cost = Some(outcome.cost).filter(|cost| cost.is_finite());
    record.evaluations = outcome.counts.residuals;
    record.iterations = outcome.counts.iterations;
    record.starts = 1;
    if !record.usable {
        record.message = Some(outcome.message.clone());
    }
    record.theta = Some(outcome.theta.clone()).filter(|theta| theta.iter().all(|v| v.is_finite()));
    let ended = Ended { theta: &outcome.theta, cost: outcome.cost, violation: outcome.violation };
    let Some(problems) = scenario.problems() else { return };
    let Some(score) = problems.score(&ended) else { return };
    write_score(scenario, &score, record);
    record.success = record.usable && problems.succeeds(&ended, &score);
    record.success_sum = record.success;
}
