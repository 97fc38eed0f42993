//! Weighting of the residual: W in 1/2 r'Wr.

use crate::entry::{EntryError, ParameterSpec, Parameters};

/// A weighting of the feature means. The identity is the paper's; statistical weightings replace it through the same trait.
pub trait Weighting: Send + Sync {
    /// Return the table name.
    fn name(&self) -> &'static str;

    /// Return the square root of W as a whitening matrix (rows x features, row by row) for the feature covariance given
    /// (features x features), or `None` for the identity.
    fn whitening(&self, covariance: &[f64], num_features: usize) -> Option<Vec<f64>>;

    /// Say whether [`Weighting::whitening`] reads the covariance, so that nobody computes it in vain.
    fn needs_covariance(&self) -> bool;
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
pub const ALL: &[&WeightingEntry] = &[&IDENTITY];

/// W = I, as the paper prints it (eq. `optimization0`).
struct Identity;

impl Weighting for Identity {
    fn name(&self) -> &'static str {
        "identity"
    }
    fn whitening(&self, _covariance: &[f64], _num_features: usize) -> Option<Vec<f64>> {
        None
    }
    fn needs_covariance(&self) -> bool {
        false
    }
}

const IDENTITY: WeightingEntry = WeightingEntry {
    name: "identity",
    summary: "every feature mean counts the same; no statistic",
    parameters: &[],
    source: "eq. optimization0",
    build: |_| Ok(Box::new(Identity)),
};
