//! W = diag(S)^-1: every feature mean in units of its own standard deviation.

use super::{REGULARISATION, Update, Weighting, WeightingEntry, Whitening, regularisation_of};

struct Diagonal {
    regularisation: f64,
}

impl Weighting for Diagonal {
    fn name(&self) -> &'static str {
        "diagonal"
    }

    fn whitening(&self, covariance: &[f64], num_features: usize) -> Option<Whitening> {
        let diagonal = |i: usize| covariance[i * num_features + i].max(0.0);
        let mean = (0..num_features).map(diagonal).sum::<f64>() / num_features as f64;
        if mean.is_nan() || mean <= 0.0 {
            return None;
        }
        let mut matrix = vec![0.0; num_features * num_features];
        for i in 0..num_features {
            let variance = diagonal(i) + self.regularisation * mean;
            matrix[i * num_features + i] = if variance > 0.0 { variance.sqrt().recip() } else { 0.0 };
        }
        Some(Whitening { matrix, rank: num_features, effective: num_features as f64 })
    }

    fn update(&self) -> Update {
        Update::Steps(1)
    }

    /// Correlated residuals have no chi-square sum of squares.
    fn has_statistic(&self) -> bool {
        false
    }
}

pub(super) const ENTRY: WeightingEntry = WeightingEntry {
    name: "diagonal",
    summary: "every feature mean by its own variance, correlations ignored; no statistic",
    parameters: &[REGULARISATION],
    source: "weighted least squares",
    build: |parameters| Ok(Box::new(Diagonal { regularisation: regularisation_of(parameters)? })),
};
