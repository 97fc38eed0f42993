//! What another program found, measured against the truth as any estimate is.

use cfpose::BuildContext;
use cfpose::theta::RotationForm;

use super::{Bench, judge, nearest_score};
use crate::record::Record;
use crate::scenario::{Scenario, Trial};

impl Bench<'_> {
    /// Fill in the record from the imported row; a theta that is none leaves its reason.
    pub(super) fn take(&self, scenario: &dyn Scenario, trial: &Trial, record: &mut Record) {
        let Some(row) = self.rows.and_then(|rows| rows.get(&record.key, &record.method)) else { return };
        record.status = "external".to_string();
        record.verdict.clone_from(&row.verdict);
        record.message.clone_from(&row.message);
        record.seconds = row.seconds;
        record.evaluations = row.evaluations;
        // The scenario's model built once already, when the experiment was read.
        let Ok(model) = self.lab.registry.model(scenario.model(), &BuildContext::default()) else { return };
        let Some(list) = row.theta.as_ref().filter(|_| row.usable) else {
            record.verdict = Some("failed".to_string());
            return;
        };
        let theta = match model.layout.from_list(list, RotationForm::Vector) {
            Ok(theta) => theta,
            Err(problem) => {
                record.verdict = Some("failed".to_string());
                record.message = Some(problem.to_string());
                return;
            }
        };
        record.usable = true;
        record.theta = Some(model.layout.to_list(&theta, RotationForm::Vector));
        if let Some((score, _)) = nearest_score(scenario, &model.layout, &theta, trial) {
            judge(scenario, trial, &score, record);
        }
    }
}
