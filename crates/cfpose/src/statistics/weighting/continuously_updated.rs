//! W = S(theta)^-1 at every theta: the continuously updated estimator.

use super::{REGULARISATION, Update, Weighting, WeightingEntry, Whitening, inverse_root, regularisation_of};

struct ContinuouslyUpdated {
    regularisation: f64,
}

impl Weighting for ContinuouslyUpdated {
    fn name(&self) -> &'static str {
        "continuously-updated"
    }

    fn whitening(&self, covariance: &[f64], num_features: usize) -> Option<Whitening> {
        inverse_root(covariance, num_features, self.regularisation)
    }

    fn update(&self) -> Update {
        Update::EveryEvaluation
    }

    fn ridge(&self) -> f64 {
        self.regularisation
    }

    fn has_statistic(&self) -> bool {
        true
    }
}

pub(super) const ENTRY: WeightingEntry = WeightingEntry {
    name: "continuously-updated",
    summary: "inverse covariance as a function of theta, its derivative included; slow, no dependence on the first step",
    parameters: &[REGULARISATION],
    source: "Hansen, Heaton and Yaron 1996",
    build: |parameters| Ok(Box::new(ContinuouslyUpdated { regularisation: regularisation_of(parameters)? })),
};
