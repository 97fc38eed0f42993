//! Weighting of the residual: W in 1/2 r'Wr. A new weighting is one file here and one line in [`ALL`].

use crate::entry::{EntryError, ParameterSpec, Parameters};

mod continuously_updated;
mod diagonal;
mod identity;
mod two_step;

/// When the covariance of the feature means enters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Update {
    /// Never: the weighting does not read it.
    Never,
    /// So many times: solve, compute the covariance at the solution, weight, solve again.
    Steps(usize),
    /// At every theta that the solver visits: W is a function of theta, and its derivative enters the Jacobian.
    EveryEvaluation,
}

/// A square root of W and its rank.
#[derive(Debug, Clone, PartialEq)]
pub struct Whitening {
    /// Rows x features, row by row: the weighted residual is this matrix times r.
    pub matrix: Vec<f64>,
    /// Rank of the covariance: the number of rows.
    pub rank: usize,
    /// Expected squared norm of the whitened residual: each row has the variance value / (value + ridge), 1 without a ridge.
    pub effective: f64,
}

/// A weighting of the feature means. The identity is the paper's; statistical weightings replace it through the same trait.
pub trait Weighting: Send + Sync {
    /// Return the table name.
    fn name(&self) -> &'static str;

    /// Return the square root of W for the covariance of the feature means (features x features, row by row), `None` for
    /// the identity, or where the covariance has no positive eigenvalue.
    fn whitening(&self, covariance: &[f64], num_features: usize) -> Option<Whitening>;

    /// Say when the covariance is computed.
    fn update(&self) -> Update;

    /// Return what is added to the eigenvalues of the covariance, relative to their mean, before it is inverted.
    fn ridge(&self) -> f64 {
        0.0
    }

    /// Say whether r'Wr is chi-square where the model holds, so that there is a J statistic and a verdict.
    fn has_statistic(&self) -> bool;
}

/// One line of the weighting table.
pub struct WeightingEntry {
    /// Name, kebab-case.
    pub name: &'static str,
    /// One line for lists.
    pub summary: &'static str,
    /// Parameters with defaults.
    pub parameters: &'static [ParameterSpec],
    /// Reference.
    pub source: &'static str,
    /// Build the weighting.
    pub build: fn(&Parameters) -> Result<Box<dyn Weighting>, EntryError>,
}

/// All weightings of the library.
pub const ALL: &[&WeightingEntry] =
    &[&identity::ENTRY, &diagonal::ENTRY, &two_step::ENTRY, &continuously_updated::ENTRY];

/// The parameter `regularisation` of weightings that invert the covariance.
const REGULARISATION: ParameterSpec = ParameterSpec {
    name: "regularisation",
    default: "1e-7",
    meaning: "added to the eigenvalues of the covariance, relative to their mean, 0 to 1; 1e-4 costs a factor 4 in accuracy",
};

fn regularisation_of(parameters: &Parameters) -> Result<f64, EntryError> {
    parameters.number("regularisation", "a number from 0 to 1", |v| (0.0..=1.0).contains(&v))
}

/// Eigenvalues below this share of the largest are rounding: features that depend on each other (polynomials on the unit sphere).
const RANK_TOLERANCE: f64 = 1e-13;

/// Return S^(-1/2) on the range of S, rows by ascending eigenvalue; `None` where nothing is positive.
fn inverse_root(covariance: &[f64], num_features: usize, regularisation: f64) -> Option<Whitening> {
    let (values, vectors) = cfpose_optim::linear::symmetric_eigen(num_features, covariance)?;
    let largest = values.last().copied().filter(|value| *value > 0.0)?;
    let floor = regularisation * values.iter().map(|v| v.max(0.0)).sum::<f64>() / num_features as f64;
    let mut matrix = Vec::with_capacity(num_features * num_features);
    let (mut rank, mut effective) = (0, 0.0);
    for (column, value) in values.iter().enumerate().filter(|(_, value)| **value > RANK_TOLERANCE * largest) {
        let scale = (value + floor).sqrt().recip();
        matrix.extend((0..num_features).map(|i| scale * vectors[i * num_features + column]));
        rank += 1;
        effective += value / (value + floor);
    }
    Some(Whitening { matrix, rank, effective })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dependent_features_lower_the_rank_and_the_root_inverts_the_rest() {
        // Features (a, b, a + b) with independent a, b of variance 4 and 1.
        let covariance = [4.0, 0.0, 4.0, 0.0, 1.0, 1.0, 4.0, 1.0, 5.0];
        let root = inverse_root(&covariance, 3, 0.0).unwrap();
        assert_eq!(root.rank, 2);
        // The statistic of the draw (2, 0, 2) is (2 / 2)^2.
        let whitened: f64 = root.matrix.chunks_exact(3).map(|w| (2.0 * w[0] + 2.0 * w[2]).powi(2)).sum();
        assert!((whitened - 1.0).abs() < 1e-12);
        assert!(inverse_root(&[0.0; 9], 3, 1e-7).is_none());
    }
}
