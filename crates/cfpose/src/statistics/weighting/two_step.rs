//! W = S^-1 at the last solution: two-step generalised method of moments.

use super::{REGULARISATION, Update, Weighting, WeightingEntry, Whitening, inverse_root, regularisation_of};
use crate::entry::ParameterSpec;

struct TwoStep {
    regularisation: f64,
    steps: usize,
}

impl Weighting for TwoStep {
    fn name(&self) -> &'static str {
        "two-step"
    }

    fn whitening(&self, covariance: &[f64], num_features: usize) -> Option<Whitening> {
        inverse_root(covariance, num_features, self.regularisation)
    }

    fn update(&self) -> Update {
        Update::Steps(self.steps)
    }

    fn ridge(&self) -> f64 {
        self.regularisation
    }

    fn has_statistic(&self) -> bool {
        true
    }
}

pub(super) const ENTRY: WeightingEntry = WeightingEntry {
    name: "two-step",
    summary: "inverse covariance of the feature means at the last solution; gives a J statistic and a covariance",
    parameters: &[
        REGULARISATION,
        ParameterSpec {
            name: "steps",
            default: "2",
            meaning: "how often the covariance is computed anew, 1 to 50; many steps: iterated until nothing changes",
        },
    ],
    source: "Hansen 1982, generalised method of moments",
    build: |parameters| {
        Ok(Box::new(TwoStep {
            regularisation: regularisation_of(parameters)?,
            steps: parameters.count("steps", 1, 50)?,
        }))
    },
};
