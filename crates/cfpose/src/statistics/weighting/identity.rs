//! W = I, as the paper prints it (eq. `optimization0`).

use super::{Update, Weighting, WeightingEntry, Whitening};

struct Identity;

impl Weighting for Identity {
    fn name(&self) -> &'static str {
        "identity"
    }
    fn whitening(&self, _covariance: &[f64], _num_features: usize) -> Option<Whitening> {
        None
    }
    fn update(&self) -> Update {
        Update::Never
    }
    fn has_statistic(&self) -> bool {
        false
    }
}

pub(super) const ENTRY: WeightingEntry = WeightingEntry {
    name: "identity",
    summary: "every feature mean counts the same; no statistic",
    parameters: &[],
    source: "eq. optimization0",
    build: |_| Ok(Box::new(Identity)),
};
