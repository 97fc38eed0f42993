//! Covariance of an estimate, with a report on its rank.

use crate::linear::svd;

/// Covariance of the tangent coordinates at an estimate.
#[derive(Debug, Clone, PartialEq)]
pub struct Covariance {
    /// `variance * (J'J)^+`, tangent x tangent, row by row: 0 along directions that the data do not determine.
    pub matrix: Vec<f64>,
    /// Number of directions that the data determine.
    pub rank: usize,
    /// Singular values of the Jacobian with columns scaled to norm 1, largest first.
    pub singular_values: Vec<f64>,
    /// Directions that the data do not determine (tangent coordinates, each of norm 1).
    pub undetermined: Vec<Vec<f64>>,
    /// Variance of one residual that was used.
    pub variance: f64,
}

impl Covariance {
    /// Return the standard deviations of the tangent coordinates.
    pub fn deviations(&self) -> Vec<f64> {
        let m = (self.matrix.len() as f64).sqrt() as usize;
        (0..m).map(|j| self.matrix[j * m + j].max(0.0).sqrt()).collect()
    }

    /// Return the ratio of the largest to the smallest singular value that counts, infinite at rank 0.
    pub fn condition(&self) -> f64 {
        match (self.singular_values.first(), self.rank.checked_sub(1).and_then(|k| self.singular_values.get(k))) {
            (Some(largest), Some(least)) => largest / least,
            _ => f64::INFINITY,
        }
    }
}

/// Estimate the covariance from the Jacobian (rows x cols, row by row) at the solution.
///
/// `variance` is that of one residual: 1 for whitened residuals, `2 cost / (rows - rank)` (see [`residual_variance`]) for
/// residuals of one unknown variance. The rank is decided on columns scaled to norm 1, by singular values above
/// `tolerance` times the largest, so that units do not enter. Nothing when a value is not finite.
///
/// ```
/// use cfpose_optim::covariance::covariance;
/// // Two parameters that only enter as their sum.
/// let report = covariance(3, 2, &[1.0, 1.0, 2.0, 2.0, -1.0, -1.0], 1.0, 1e-12).unwrap();
/// assert_eq!(report.rank, 1);
/// let lost = &report.undetermined[0];
/// assert!((lost[0] + lost[1]).abs() < 1e-12);
/// ```
pub fn covariance(rows: usize, cols: usize, jacobian: &[f64], variance: f64, tolerance: f64) -> Option<Covariance> {
    let empty = Covariance {
        matrix: vec![0.0; cols * cols],
        rank: 0,
        singular_values: Vec::new(),
        undetermined: Vec::new(),
        variance,
    };
    if rows == 0 || cols == 0 {
        let unit = |j: usize| (0..cols).map(|l| f64::from(u8::from(l == j))).collect();
        return Some(Covariance { undetermined: (0..cols).map(unit).collect(), ..empty });
    }
    let column = |j: usize| (0..rows).map(|k| jacobian[k * cols + j].powi(2)).sum::<f64>().sqrt();
    let norms: Vec<f64> = (0..cols).map(|j| if column(j) > 0.0 { column(j) } else { 1.0 }).collect();
    // Rows of zeros below a wide matrix make all right singular vectors appear.
    let tall = rows.max(cols);
    let mut scaled = vec![0.0; tall * cols];
    for (at, value) in jacobian[..rows * cols].iter().enumerate() {
        scaled[at] = value / norms[at % cols];
    }
    let decomposition = svd(tall, cols, &scaled)?;
    let values = decomposition.values;
    let right = |j: usize, i: usize| decomposition.right[j * cols + i];
    let rank = values.iter().filter(|s| **s > tolerance * values[0] && **s > 0.0).count();
    let mut matrix = vec![0.0; cols * cols];
    for j in 0..cols {
        for l in 0..cols {
            let sum: f64 = (0..rank).map(|i| right(j, i) * right(l, i) / (values[i] * values[i])).sum();
            matrix[j * cols + l] = variance * sum / (norms[j] * norms[l]);
        }
    }
    let lost = |i: usize| {
        let direction: Vec<f64> = (0..cols).map(|j| right(j, i) / norms[j]).collect();
        let length = crate::manifold::norm(&direction);
        direction.into_iter().map(|v| v / length).collect()
    };
    let undetermined = (rank..cols).map(lost).collect();
    Some(Covariance { matrix, rank, singular_values: values, undetermined, variance })
}

/// Return the estimate `2 cost / (rows - rank)` of the variance of one residual, nothing without degrees of freedom.
pub fn residual_variance(cost: f64, rows: usize, rank: usize) -> Option<f64> {
    (rows > rank).then(|| 2.0 * cost / (rows - rank) as f64)
}
