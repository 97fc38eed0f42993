//! Gram matrices of a family: which of its functions say the same about given points.

use std::fmt;

use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, Par, Side};

use cfpose_kernel::family::{BasisBlock, DynFamily};
use cfpose_kernel::isa::Isa;
use cfpose_kernel::map::MapBlock;
use cfpose_kernel::points::{BLOCK, Points};

/// Gram matrices of values and of gradients, num x num.
pub(crate) struct GramPair {
    /// mean f f'.
    pub values: Mat<f64>,
    /// mean sum_q df/dx_q df'/dx_q.
    pub gradients: Mat<f64>,
}

/// Compute the Gram matrices of the features under weighted points in the feature space.
pub(crate) fn feature_gram(family: &dyn DynFamily, points: &Points) -> GramPair {
    let pair = basis_gram(family, points);
    match coefficient_matrix(family, points.dim()) {
        None => pair,
        Some(c) => {
            GramPair { values: &c * pair.values * c.transpose(), gradients: &c * pair.gradients * c.transpose() }
        }
    }
}

/// Return C (features x basis) as a matrix.
pub(crate) fn coefficient_matrix(family: &dyn DynFamily, dim: usize) -> Option<Mat<f64>> {
    let width = family.num_basis(dim);
    family.coefficients(dim).map(|c| Mat::from_fn(c.len() / width, width, |i, j| c[i * width + j]))
}

/// Compute the Gram matrices of the basis, block by block.
fn basis_gram(family: &dyn DynFamily, points: &Points) -> GramPair {
    let (dim, isa) = (points.dim(), Isa::detect());
    let num = family.num_basis(dim);
    let mut pair = GramPair { values: Mat::zeros(num, num), gradients: Mat::zeros(num, num) };
    let mut block = MapBlock::new(dim, 0);
    let mut basis = BasisBlock::new(family, dim, true);
    let total: f64 = points.weights().iter().sum();
    for start in (0..points.padded_len()).step_by(BLOCK) {
        for q in 0..dim {
            block.x[q].0.copy_from_slice(&points.padded_column(q)[start..start + BLOCK]);
        }
        family.block(isa, &block, basis.rows());
        let roots: Vec<f64> =
            points.padded_weights()[start..start + BLOCK].iter().map(|w| (w / total).sqrt()).collect();
        let values = Mat::from_fn(num, BLOCK, |i, k| roots[k] * basis.value[i].0[k]);
        add_square(&mut pair.values, &values);
        for q in 0..dim {
            add_square(&mut pair.gradients, &gradient_rows(&basis, dim, q, &roots));
        }
    }
    pair
}

/// Return d basis_i / d x_q at the points of a block times `factors`, num_basis x BLOCK.
pub(crate) fn gradient_rows(basis: &BasisBlock, dim: usize, q: usize, factors: &[f64]) -> Mat<f64> {
    let mut out = Mat::zeros(basis.value.len(), BLOCK);
    let (mut value, mut slope) = (0, 0);
    for segment in &basis.segments {
        // Functions of this run that depend on coordinate q, and where their gradient rows stand.
        let (functions, first, stride) = match segment.per_coordinate {
            Some(num) => (q * num..(q + 1) * num, slope + q * num, 1),
            None => (0..segment.num_basis, slope + q, dim),
        };
        for (n, i) in functions.enumerate() {
            let row = &basis.gradient[first + n * stride];
            for k in 0..BLOCK {
                out[(value + i, k)] = row.0[k] * factors[k];
            }
        }
        value += segment.num_basis;
        slope += segment.num_gradient_rows(dim);
    }
    out
}

/// sum += a a'.
fn add_square(sum: &mut Mat<f64>, a: &Mat<f64>) {
    matmul(sum.as_mut(), Accum::Add, a.as_ref(), a.transpose(), 1.0, Par::Seq);
}

/// One Gram matrix in numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct GramMatrix {
    /// Entries, features x features, row by row.
    pub entries: Vec<f64>,
    /// Eigenvalues, largest first.
    pub eigenvalues: Vec<f64>,
    /// Largest by smallest eigenvalue, infinite where functions are dependent.
    pub condition: f64,
    /// Number of eigenvalues above 1e-12 of the largest.
    pub rank: usize,
    /// Largest correlation |G_ij| / sqrt(G_ii G_jj) of two different functions, and which two (from 0).
    pub worst_correlation: Option<(f64, usize, usize)>,
}

impl GramMatrix {
    fn new(gram: &Mat<f64>) -> Self {
        let n = gram.nrows();
        let mut eigenvalues = gram.self_adjoint_eigenvalues(Side::Lower).unwrap_or_default();
        eigenvalues.reverse();
        let largest = eigenvalues.first().copied().unwrap_or(0.0);
        let rank = eigenvalues.iter().filter(|value| **value > 1e-12 * largest && largest > 0.0).count();
        let smallest = eigenvalues.last().copied().unwrap_or(0.0);
        let condition = if rank == n && n > 0 { largest / smallest } else { f64::INFINITY };
        let mut worst_correlation: Option<(f64, usize, usize)> = None;
        for i in 0..n {
            for j in 0..i {
                let scale = (gram[(i, i)] * gram[(j, j)]).sqrt();
                let correlation = if scale > 0.0 { gram[(i, j)].abs() / scale } else { 0.0 };
                if worst_correlation.is_none_or(|(worst, _, _)| correlation > worst) {
                    worst_correlation = Some((correlation, j, i));
                }
            }
        }
        let entries = (0..n * n).map(|index| gram[(index / n, index % n)]).collect();
        Self { entries, eigenvalues, condition, rank, worst_correlation }
    }
}

/// Gram matrices of a family under points of the feature space.
#[derive(Debug, Clone, PartialEq)]
pub struct GramReport {
    /// Dimension of the feature space.
    pub dim: usize,
    /// Number of points.
    pub num_points: usize,
    /// Number of features.
    pub num_features: usize,
    /// mean f f'.
    pub values: GramMatrix,
    /// mean sum_q df/dx_q df'/dx_q.
    pub gradients: GramMatrix,
}

/// Compute the Gram matrices of a family under points of the (normalised) feature space, weights included.
///
/// Independent functions whose gradients are independent too see different things of the points; a large condition number
/// means that some differences of shape hardly count in an unweighted cost.
///
/// ```
/// use cfpose::{BuildContext, Points, Registry, statistics::gram::gram};
/// let context = BuildContext { dim: 1, ..BuildContext::default() };
/// let family = Registry::default().family("monomial[degree=2]", &context).unwrap();
/// let report = gram(family.as_ref(), &Points::from_rows(&[[-1.0], [1.0]]).unwrap());
/// assert!((report.values.condition - 1.0).abs() < 1e-12); // x and x^2 at -1 and 1
/// assert!((report.gradients.entries[3] - 4.0).abs() < 1e-12); // (2 x)^2
/// assert!((report.gradients.condition - 4.0).abs() < 1e-12);
/// ```
pub fn gram(family: &dyn DynFamily, points: &Points) -> GramReport {
    let pair = feature_gram(family, points);
    GramReport {
        dim: points.dim(),
        num_points: points.len(),
        num_features: pair.values.nrows(),
        values: GramMatrix::new(&pair.values),
        gradients: GramMatrix::new(&pair.gradients),
    }
}

impl fmt::Display for GramReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{} functions on {} points in {} dimension(s)", self.num_features, self.num_points, self.dim)?;
        for (name, gram) in [("values", &self.values), ("gradients", &self.gradients)] {
            write!(f, "{name:>9}: rank {} of {}, condition {:.3e}", gram.rank, self.num_features, gram.condition)?;
            match gram.worst_correlation {
                Some((worst, i, j)) => {
                    writeln!(f, ", largest correlation {worst:.3} (f_{} and f_{})", i + 1, j + 1)?;
                }
                None => writeln!(f)?,
            }
        }
        Ok(())
    }
}
