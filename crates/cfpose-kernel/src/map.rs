//! Erasure per block of points: models and families written over `Scalar` become objects that work on plain `f64` rows.
//!
//! A dynamic call is made once per block of [`BLOCK`] points, never per point, and it dispatches to the instruction set inside
//! the call. The rows are also the interface for models and families of another language.

use num_dual::HyperDual64;

use crate::isa::Isa;
use crate::points::{BLOCK, Points};

mod factored;
mod general;

pub use factored::Factored;
pub use factored::{SEEDS, seed_theta};
pub use general::General;

/// [`BLOCK`] values on a cache-line boundary, and one cache line of padding.
///
/// Without it the same place of all rows would fall into 8 of the 64 sets of the cache, and a hundred rows would evict each other.
#[repr(align(64))]
#[derive(Debug, Clone, Copy)]
#[allow(dead_code)] // the padding is there to be skipped
pub struct Row(pub [f64; BLOCK], [f64; 8]);

impl Row {
    /// A row of zeros.
    pub const ZERO: Row = Row([0.0; BLOCK], [0.0; 8]);
}

/// The affine normalisation x -> matrix (x - mean) of the feature space.
///
/// ```
/// use cfpose_kernel::map::Transform;
/// let halved = Transform::new([1.0, 0.0, 0.0], [[0.5, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
/// assert_eq!(halved.apply([3.0, 2.0, 0.0]), [1.0, 2.0, 0.0]);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Transform {
    mean: [f64; 3],
    matrix: [[f64; 3]; 3],
    diagonal: bool,
}

impl Transform {
    /// Make a transform; rows and columns beyond the feature dimension are not read.
    pub fn new(mean: [f64; 3], matrix: [[f64; 3]; 3]) -> Self {
        let diagonal = (0..3).all(|i| (0..3).all(|j| i == j || matrix[i][j] == 0.0));
        Self { mean, matrix, diagonal }
    }

    /// The transform that changes nothing.
    pub fn identity() -> Self {
        Self::new([0.0; 3], [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    }

    /// Return the mean that is subtracted.
    #[inline]
    pub fn mean(&self) -> [f64; 3] {
        self.mean
    }

    /// Return the matrix, row by row.
    #[inline]
    pub fn matrix(&self) -> [[f64; 3]; 3] {
        self.matrix
    }

    /// Transform one point; missing coordinates must be 0 and stay 0 for a matrix that leaves them alone.
    #[inline]
    pub fn apply(&self, x: [f64; 3]) -> [f64; 3] {
        let mut out = [0.0; 3];
        for q in 0..3 {
            for c in 0..3 {
                out[q] += self.matrix[q][c] * (x[c] - self.mean[c]);
            }
        }
        out
    }

    /// Transform a covariance: matrix * covariance * matrix'.
    pub fn apply_covariance(&self, covariance: [[f64; 3]; 3]) -> [[f64; 3]; 3] {
        let mut out = [[0.0; 3]; 3];
        for a in 0..3 {
            for b in 0..3 {
                for c in 0..3 {
                    for d in 0..3 {
                        out[a][b] += self.matrix[a][c] * covariance[c][d] * self.matrix[b][d];
                    }
                }
            }
        }
        out
    }
}

/// One block of points after a map: coordinates in the feature space, weights, and their derivatives.
pub struct MapBlock {
    /// Feature coordinates, `dim` rows.
    pub x: Vec<Row>,
    /// d x_q / d theta_j *times the weight*, row q * tangent + j.
    pub dx: Vec<Row>,
    /// Weight times density.
    pub weight: Row,
    /// d weight / d theta_j, row j; meaningful when `moving_weight`.
    pub dweight: Vec<Row>,
    /// Whether the density depends on theta.
    pub moving_weight: bool,
    /// Whether all weights of the block are 1.
    pub unit_weight: bool,
}

impl MapBlock {
    /// Make a block for a feature space of `dim` dimensions and `tangent` derivatives.
    pub fn new(dim: usize, tangent: usize) -> Self {
        Self {
            x: vec![Row::ZERO; dim],
            dx: vec![Row::ZERO; dim * tangent],
            weight: Row::ZERO,
            dweight: vec![Row::ZERO; tangent],
            moving_weight: false,
            unit_weight: false,
        }
    }

    /// Copy the weights of a block of points and note whether all are 1.
    #[inline]
    pub(crate) fn set_weights(&mut self, weights: &[f64]) {
        self.weight.0.copy_from_slice(weights);
        self.unit_weight = weights.iter().all(|w| *w == 1.0);
        self.moving_weight = false;
    }
}

/// Points after `lift`: padded columns that do not depend on theta.
#[derive(Debug, Clone)]
pub struct LiftedPoints {
    /// Number of real points.
    pub len: usize,
    /// Columns of the lifted coordinates, padded to a multiple of [`BLOCK`].
    pub columns: Vec<Vec<f64>>,
    /// Weights, 0 in the padding.
    pub weights: Vec<f64>,
}

impl LiftedPoints {
    /// Return lifted point `k` (from 0).
    pub fn point(&self, k: usize) -> Vec<f64> {
        self.columns.iter().map(|column| column[k]).collect()
    }
}

/// Everything of a map that depends on theta but on no point: computed once per evaluation.
#[derive(Debug, Clone, Default)]
pub struct PreparedMap {
    /// Number of derivatives.
    pub tangent: usize,
    /// A, rows x lift_len.
    pub a: Vec<f64>,
    /// b, rows.
    pub b: Vec<f64>,
    /// dA/dtheta_j, tangent x rows x lift_len.
    pub da: Vec<f64>,
    /// db/dtheta_j, tangent x rows.
    pub db: Vec<f64>,
    /// Whether dA/dtheta_j = 0, as for a translation: no point changes that derivative before the projection.
    pub constant: Vec<bool>,
    /// Ambient theta.
    pub theta: Vec<f64>,
    /// Tangent basis, ambient x tangent.
    pub basis: Vec<f64>,
}

/// A map of one side, erased. Implemented by [`Factored`] and [`General`] for every author type.
pub trait DynMap: Send + Sync {
    /// Return the dimension of the points it takes.
    fn point_dim(&self) -> usize;

    /// Return the dimension of the feature space.
    fn dim(&self) -> usize;

    /// Return the factored form's facts, `None` for a general map.
    fn factored(&self) -> Option<FactoredFacts>;

    /// Return the name of the vector attribute that lifting reads.
    fn attribute(&self) -> Option<&'static str> {
        None
    }

    /// Lift points once; an attribute that is missing reads as zeros; `points.dim()` must equal [`DynMap::point_dim`].
    fn lift(&self, points: &Points) -> LiftedPoints;

    /// Compute what depends on theta alone; `basis` is ambient x `tangent`.
    fn prepare(&self, theta: &[f64], basis: &[f64], tangent: usize) -> PreparedMap;

    /// Map the block that starts at point `start`; derivatives are written when the block was made for them.
    fn block(
        &self,
        isa: Isa,
        prepared: &PreparedMap,
        transform: &Transform,
        points: &LiftedPoints,
        start: usize,
        out: &mut MapBlock,
    );

    /// Map one lifted point over second-order duals: feature coordinates (not normalised) into `out`; returns the density.
    ///
    /// The slow, exact path: Hessians, and the oracle of the tests.
    fn hyper(&self, theta: &[HyperDual64], lifted: &[f64], out: &mut [HyperDual64]) -> HyperDual64;
}

/// Facts of a factored map.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FactoredFacts {
    /// Rows of A.
    pub rows: usize,
    /// Columns of A.
    pub lift_len: usize,
    /// Whether `project` is the identity.
    pub identity_projection: bool,
    /// Whether there is an area element.
    pub has_density: bool,
}
