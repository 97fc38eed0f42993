//! Weighted point sets, stored as structure of arrays and validated once.

use std::collections::BTreeMap;
use std::sync::OnceLock;

/// Number of points that travel together through an erased model and family.
///
/// A multiple of every lane width; columns are padded to it, padding has weight 0.
pub const BLOCK: usize = 64;

/// What is wrong with a set of points; rows count from 1, as a reader of the file would.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PointsError {
    /// There is no point at all.
    #[error("there are no points")]
    Empty,
    /// The number of coordinates is not 1, 2 or 3.
    #[error("points have {dim} coordinates; 1, 2 or 3 are possible")]
    Dimension {
        /// Number of columns found.
        dim: usize,
    },
    /// Columns differ in length.
    #[error("column {column} holds {found} values, the first column {expected}")]
    Ragged {
        /// Column, from 1.
        column: usize,
        /// Length of the first column.
        expected: usize,
        /// Length of this column.
        found: usize,
    },
    /// A coordinate is NaN or infinite.
    #[error("row {row}, column {column}: {value} is not a finite number")]
    NotFinite {
        /// Row, from 1.
        row: usize,
        /// Column, from 1.
        column: usize,
        /// The value.
        value: f64,
    },
    /// A weight is negative or not finite.
    #[error("row {row}: weight {value} is not a finite number >= 0")]
    Weight {
        /// Row, from 1.
        row: usize,
        /// The value.
        value: f64,
    },
    /// The weights sum to zero.
    #[error("all weights are zero")]
    NoWeight,
    /// Too few points for an estimate.
    #[error("only {found} distinct point(s); an estimate needs at least {needed}")]
    TooFew {
        /// Number of distinct points found.
        found: usize,
        /// Number needed.
        needed: usize,
    },
}

/// A named column of values that travels with the points and no map reads by default.
#[derive(Debug, Clone, PartialEq)]
pub enum Attribute {
    /// One value a point: grey value, label.
    Scalar(Vec<f64>),
    /// One vector a point, one inner `Vec` per coordinate: normal, tangent.
    Vector(Vec<Vec<f64>>),
}

/// A validated, weighted set of points of dimension 1, 2 or 3.
///
/// Storage: one column per coordinate, padded to a multiple of [`BLOCK`] with copies of the last point that have weight 0,
/// so the kernel never meets a partial block and padded lanes never meet a singularity that no real point has.
///
/// ```
/// use cfpose_kernel::Points;
/// let points = Points::from_rows(&[[0.0, 1.0], [2.0, 3.0]]).unwrap();
/// assert_eq!((points.len(), points.dim()), (2, 2));
/// assert_eq!(points.point(1)[..2], [2.0, 3.0]);
/// assert!(Points::from_rows(&[[f64::NAN, 1.0]]).is_err());
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Points {
    len: usize,
    columns: Vec<Vec<f64>>,
    weights: Vec<f64>,
    uniform: bool,
    in_curve_order: bool,
    attributes: BTreeMap<String, Attribute>,
    spread: Spread,
}

/// Mean and covariance, computed when first asked for: of many points they cost, and a search asks often. They follow from the rest, so
/// sets are equal whether they are known or not.
#[derive(Debug, Clone, Default)]
struct Spread(OnceLock<([f64; 3], [[f64; 3]; 3])>);

impl PartialEq for Spread {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl Points {
    /// Validate columns (one `Vec` per coordinate, equal lengths); every weight is 1.
    ///
    /// # Errors
    /// [`PointsError`] naming the first offending row and column.
    pub fn from_columns(columns: Vec<Vec<f64>>) -> Result<Self, PointsError> {
        let len = columns.first().map_or(0, Vec::len);
        Self::weighted(columns, vec![1.0; len]).map(|points| Self { uniform: true, ..points })
    }

    /// Validate rows of D coordinates; every weight is 1.
    ///
    /// # Errors
    /// As [`Points::from_columns`].
    pub fn from_rows<const D: usize>(rows: &[[f64; D]]) -> Result<Self, PointsError> {
        Self::from_columns((0..D).map(|d| rows.iter().map(|row| row[d]).collect()).collect())
    }

    /// Validate columns with one weight a point.
    ///
    /// # Errors
    /// As [`Points::from_columns`]; also for weights that are negative, not finite or all zero.
    pub fn weighted(mut columns: Vec<Vec<f64>>, mut weights: Vec<f64>) -> Result<Self, PointsError> {
        let dim = columns.len();
        if !(1..=3).contains(&dim) {
            return Err(PointsError::Dimension { dim });
        }
        let len = columns[0].len();
        for (index, column) in columns.iter().enumerate() {
            if column.len() != len {
                return Err(PointsError::Ragged { column: index + 1, expected: len, found: column.len() });
            }
        }
        if weights.len() != len {
            return Err(PointsError::Ragged { column: dim + 1, expected: len, found: weights.len() });
        }
        if len == 0 {
            return Err(PointsError::Empty);
        }
        for row in 0..len {
            for (index, column) in columns.iter().enumerate() {
                if !column[row].is_finite() {
                    return Err(PointsError::NotFinite { row: row + 1, column: index + 1, value: column[row] });
                }
            }
            if !(weights[row].is_finite() && weights[row] >= 0.0) {
                return Err(PointsError::Weight { row: row + 1, value: weights[row] });
            }
        }
        if weights.iter().all(|w| *w == 0.0) {
            return Err(PointsError::NoWeight);
        }
        let padded = len.div_ceil(BLOCK) * BLOCK;
        for column in &mut columns {
            let last = column[len - 1];
            column.resize(padded, last);
        }
        weights.resize(padded, 0.0);
        Ok(Self {
            len,
            columns,
            weights,
            uniform: false,
            in_curve_order: false,
            attributes: BTreeMap::new(),
            spread: Spread::default(),
        })
    }

    /// Replace the weights.
    ///
    /// # Errors
    /// As [`Points::weighted`].
    ///
    /// ```
    /// use cfpose_kernel::Points;
    /// let points = Points::from_rows(&[[0.0], [1.0]]).unwrap().with_weights(vec![3.0, 1.0]).unwrap();
    /// assert_eq!(points.mean()[0], 0.25);
    /// ```
    pub fn with_weights(&self, weights: Vec<f64>) -> Result<Self, PointsError> {
        let columns = (0..self.dim()).map(|d| self.column(d).to_vec()).collect();
        let weighted = Self::weighted(columns, weights)?;
        Ok(Self { in_curve_order: self.in_curve_order, attributes: self.attributes.clone(), ..weighted })
    }

    /// Give every point the weight 1: for points that were drawn in proportion to their weights.
    ///
    /// ```
    /// use cfpose_kernel::Points;
    /// let points = Points::weighted(vec![vec![0.0, 1.0]], vec![3.0, 0.5]).unwrap().with_equal_weights();
    /// assert_eq!(points.weights(), [1.0, 1.0]);
    /// ```
    #[must_use]
    pub fn with_equal_weights(mut self) -> Self {
        let len = self.len;
        self.weights[..len].fill(1.0);
        self.uniform = true;
        self.spread = Spread::default();
        self
    }

    /// State that consecutive points are neighbours on a curve, so that thinning is a quadrature.
    #[must_use]
    pub fn in_curve_order(mut self) -> Self {
        self.in_curve_order = true;
        self
    }

    /// Say whether consecutive points are neighbours on a curve.
    pub fn is_in_curve_order(&self) -> bool {
        self.in_curve_order
    }

    /// Attach a named attribute.
    ///
    /// # Errors
    /// [`PointsError::Ragged`] when its length is not the number of points.
    pub fn with_attribute(mut self, name: &str, attribute: Attribute) -> Result<Self, PointsError> {
        let lengths: Vec<usize> = match &attribute {
            Attribute::Scalar(values) => vec![values.len()],
            Attribute::Vector(columns) => columns.iter().map(Vec::len).collect(),
        };
        if let Some((index, found)) = lengths.iter().enumerate().find(|(_, length)| **length != self.len) {
            return Err(PointsError::Ragged { column: index + 1, expected: self.len, found: *found });
        }
        self.attributes.insert(name.to_string(), attribute);
        Ok(self)
    }

    /// Return a named attribute.
    pub fn attribute(&self, name: &str) -> Option<&Attribute> {
        self.attributes.get(name)
    }

    /// Return the number of points.
    #[allow(clippy::len_without_is_empty)] // never empty by construction
    #[inline]
    pub fn len(&self) -> usize {
        self.len
    }

    /// Return the number of coordinates: 1, 2 or 3.
    #[inline]
    pub fn dim(&self) -> usize {
        self.columns.len()
    }

    /// Return coordinate `d` of all points, without padding.
    #[inline]
    pub fn column(&self, d: usize) -> &[f64] {
        &self.columns[d][..self.len]
    }

    /// Return the weights, without padding.
    #[inline]
    pub fn weights(&self) -> &[f64] {
        &self.weights[..self.len]
    }

    /// Say whether every weight is 1.
    #[inline]
    pub fn is_uniform(&self) -> bool {
        self.uniform
    }

    /// Return point `k` (from 0), missing coordinates as 0.
    #[inline]
    pub fn point(&self, k: usize) -> [f64; 3] {
        let mut point = [0.0; 3];
        for (value, column) in point.iter_mut().zip(&self.columns) {
            *value = column[k];
        }
        point
    }

    /// Return all points as rows, missing coordinates as 0.
    pub fn rows(&self) -> Vec<[f64; 3]> {
        (0..self.len).map(|k| self.point(k)).collect()
    }

    /// Return the number of points with padding, a multiple of [`BLOCK`].
    #[inline]
    pub fn padded_len(&self) -> usize {
        self.weights.len()
    }

    /// Return coordinate `d` with padding.
    #[inline]
    pub fn padded_column(&self, d: usize) -> &[f64] {
        &self.columns[d]
    }

    /// Return the weights with padding (0 there).
    #[inline]
    pub fn padded_weights(&self) -> &[f64] {
        &self.weights
    }

    /// Return the sub-set of the given points (indices from 0), weights and attributes with them.
    ///
    /// # Errors
    /// [`PointsError::Empty`] for no index, [`PointsError::NoWeight`] when all chosen weights are zero.
    ///
    /// # Panics
    /// When an index is not below [`Points::len`].
    pub fn select(&self, indices: &[usize]) -> Result<Self, PointsError> {
        let pick = |column: &[f64]| indices.iter().map(|k| column[*k]).collect::<Vec<f64>>();
        let columns = (0..self.dim()).map(|d| pick(self.column(d))).collect();
        let mut chosen = Self::weighted(columns, pick(self.weights()))?;
        chosen.uniform = self.uniform;
        chosen.in_curve_order = self.in_curve_order && indices.is_sorted();
        for (name, attribute) in &self.attributes {
            let attribute = match attribute {
                Attribute::Scalar(values) => Attribute::Scalar(pick(values)),
                Attribute::Vector(columns) => Attribute::Vector(columns.iter().map(|c| pick(c)).collect()),
            };
            chosen.attributes.insert(name.clone(), attribute);
        }
        Ok(chosen)
    }

    /// Add a constant last coordinate: image points (x, y) become (x, y, 1).
    ///
    /// # Errors
    /// [`PointsError::Dimension`] for points of dimension 3.
    pub fn with_constant_coordinate(&self, value: f64) -> Result<Self, PointsError> {
        let mut columns: Vec<Vec<f64>> = (0..self.dim()).map(|d| self.column(d).to_vec()).collect();
        columns.push(vec![value; self.len]);
        let mut extended = Self::weighted(columns, self.weights().to_vec())?;
        extended.uniform = self.uniform;
        extended.in_curve_order = self.in_curve_order;
        extended.attributes = self.attributes.clone();
        Ok(extended)
    }

    /// Return the weighted mean, missing coordinates as 0.
    pub fn mean(&self) -> [f64; 3] {
        self.spread().0
    }

    fn compute_mean(&self) -> [f64; 3] {
        let total: f64 = self.weights().iter().sum();
        let mut mean = [0.0; 3];
        for d in 0..self.dim() {
            let sum: f64 = self.column(d).iter().zip(self.weights()).map(|(x, w)| x * w).sum();
            mean[d] = sum / total;
        }
        mean
    }

    /// Return the weighted covariance (divided by the total weight), 3x3 row by row, zeros for missing coordinates.
    pub fn covariance(&self) -> [[f64; 3]; 3] {
        self.spread().1
    }

    fn spread(&self) -> &([f64; 3], [[f64; 3]; 3]) {
        self.spread.0.get_or_init(|| {
            let mean = self.compute_mean();
            (mean, self.covariance_about(&mean))
        })
    }

    fn covariance_about(&self, mean: &[f64; 3]) -> [[f64; 3]; 3] {
        let total = self.weights().iter().sum::<f64>();
        let mut covariance = [[0.0; 3]; 3];
        for a in 0..self.dim() {
            for b in 0..=a {
                let mut sum = 0.0;
                for ((xa, xb), w) in self.column(a).iter().zip(self.column(b)).zip(self.weights()) {
                    sum += w * (xa - mean[a]) * (xb - mean[b]);
                }
                covariance[a][b] = sum / total;
                covariance[b][a] = sum / total;
            }
        }
        covariance
    }

    /// Check that there are at least `needed` points that are not all equal.
    ///
    /// # Errors
    /// [`PointsError::TooFew`].
    pub fn require_spread(&self, needed: usize) -> Result<(), PointsError> {
        // A point without weight is not there.
        let mut counted = (0..self.len).filter(|k| self.weights[*k] > 0.0);
        let first = counted.next().map(|k| self.point(k));
        let (mut others, mut all_equal) = (0, true);
        for k in counted {
            others += 1;
            all_equal = all_equal && Some(self.point(k)) == first;
        }
        let found = if all_equal { usize::from(first.is_some()) } else { others + 1 };
        if found < needed { Err(PointsError::TooFew { found, needed }) } else { Ok(()) }
    }
}
