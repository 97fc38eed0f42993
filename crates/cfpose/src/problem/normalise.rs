//! Normalisation of the feature space: both sides with the statistics of the target.

use cfpose_kernel::map::Transform;
use cfpose_kernel::points::Points;

use crate::entry::{EntryError, ParameterSpec, Parameters};
use crate::error::Error;

/// Fits the affine transform of the feature space from the target points mapped into it.
///
/// Where the target moves with theta, it is mapped once, at the first given start or else at the model's identity, and the
/// statistics stay fixed from then on: statistics that moved with theta would pull both sides towards each other.
pub trait Normaliser: Send + Sync {
    /// Return the table name.
    fn name(&self) -> &'static str;

    /// Fit the transform.
    ///
    /// # Errors
    /// [`Error::Normalise`] when the points have no spread in a direction that must be scaled.
    fn fit(&self, target: &Points) -> Result<Transform, Error>;
}

/// One line of the normaliser table.
pub struct NormaliserEntry {
    /// Name, kebab-case.
    pub name: &'static str,
    /// One line for lists.
    pub summary: &'static str,
    /// Parameters with defaults.
    pub parameters: &'static [ParameterSpec],
    /// Reference.
    pub source: &'static str,
    /// Build the normaliser.
    pub build: fn(&Parameters) -> Result<Box<dyn Normaliser>, EntryError>,
}

/// All normalisers of the library.
pub const ALL: &[&NormaliserEntry] = &[&PAPER, &PER_AXIS, &WHITEN, &NONE];

const PAPER: NormaliserEntry = NormaliserEntry {
    name: "paper",
    summary: "(x - mean) / (2 sigma), sigma the total standard deviation over all coordinates",
    parameters: &[],
    source: "section IV.A, eqs. Relative1 and Relative2",
    build: |_| Ok(Box::new(Paper)),
};

const PER_AXIS: NormaliserEntry = NormaliserEntry {
    name: "per-axis",
    summary: "(x_i - mean_i) / (2 sigma_i): every coordinate gets standard deviation 1/2",
    parameters: &[],
    source: "the standard deviation that the paper's text assumes; differs from its formula, which is `paper`",
    build: |_| Ok(Box::new(PerAxis)),
};

const WHITEN: NormaliserEntry = NormaliserEntry {
    name: "whiten",
    summary: "full covariance: every direction gets standard deviation 1/2",
    parameters: &[],
    source: "principal axes; differs from the paper, whose text assumes standard deviation 1/2 per coordinate",
    build: |_| Ok(Box::new(Whiten)),
};

const NONE: NormaliserEntry = NormaliserEntry {
    name: "none",
    summary: "coordinates as they are",
    parameters: &[],
    source: "-",
    build: |_| Ok(Box::new(NoNormaliser)),
};

/// The printed normalisation. Its sigma is the *total* standard deviation, so a coordinate has about 0.35, not 0.5.
struct Paper;

impl Normaliser for Paper {
    fn name(&self) -> &'static str {
        "paper"
    }

    fn fit(&self, target: &Points) -> Result<Transform, Error> {
        let covariance = target.covariance();
        let total: f64 = target.weights().iter().sum();
        // sigma^2 = sum |q - mu|^2 / (N - 1): the covariance divides by the total weight.
        let trace = (covariance[0][0] + covariance[1][1] + covariance[2][2]) * total / (total - 1.0);
        if !(trace > 0.0 && trace.is_finite()) {
            return Err(no_spread("paper"));
        }
        let scale = 0.5 / trace.sqrt();
        Ok(Transform::new(target.mean(), [[scale, 0.0, 0.0], [0.0, scale, 0.0], [0.0, 0.0, scale]]))
    }
}

/// x_i -> (x_i - mu_i) / (2 sigma_i), sigma_i the standard deviation of coordinate i.
struct PerAxis;

impl Normaliser for PerAxis {
    fn name(&self) -> &'static str {
        "per-axis"
    }

    fn fit(&self, target: &Points) -> Result<Transform, Error> {
        let covariance = target.covariance();
        let largest = (0..target.dim()).fold(0.0_f64, |a, i| a.max(covariance[i][i]));
        let mut matrix = [[0.0; 3]; 3];
        for i in 0..target.dim() {
            if !(covariance[i][i] > 1e-12 * largest && largest.is_finite()) {
                return Err(no_spread("per-axis"));
            }
            matrix[i][i] = 0.5 / covariance[i][i].sqrt();
        }
        Ok(Transform::new(target.mean(), matrix))
    }
}

/// x -> 1/2 C^(-1/2) (x - mu) with the covariance C and its symmetric root: affine-equivariant up to a rotation.
struct Whiten;

impl Normaliser for Whiten {
    fn name(&self) -> &'static str {
        "whiten"
    }

    fn fit(&self, target: &Points) -> Result<Transform, Error> {
        let dim = target.dim();
        let covariance = target.covariance();
        let (values, vectors) = crate::geometry::linalg::symmetric_eigen(&covariance, dim);
        let largest = values.iter().fold(0.0_f64, |a, b| a.max(*b));
        if !(largest > 0.0 && largest.is_finite()) {
            return Err(no_spread("whiten"));
        }
        let mut matrix = [[0.0; 3]; 3];
        for (value, vector) in values.iter().zip(&vectors).take(dim) {
            if *value <= 1e-12 * largest {
                return Err(no_spread("whiten"));
            }
            for i in 0..dim {
                for j in 0..dim {
                    matrix[i][j] += 0.5 / value.sqrt() * vector[i] * vector[j];
                }
            }
        }
        Ok(Transform::new(target.mean(), matrix))
    }
}

/// No normalisation.
struct NoNormaliser;

impl Normaliser for NoNormaliser {
    fn name(&self) -> &'static str {
        "none"
    }

    fn fit(&self, _target: &Points) -> Result<Transform, Error> {
        Ok(Transform::identity())
    }
}

fn no_spread(name: &'static str) -> Error {
    Error::Normalise {
        name,
        problem: "the target points have no spread in some direction; use more points or another normaliser"
            .to_string(),
    }
}
