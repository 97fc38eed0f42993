//! A trained matrix over the features of another family.

use cfpose_kernel::family::{BasisRows, DynFamily, GradientTerm, Segment};
use cfpose_kernel::isa::Isa;
use cfpose_kernel::map::MapBlock;
use cfpose_kernel::points::Points;
use num_dual::HyperDual64;

use super::adapt::{feature_covariance, whitening_root};
use super::weights::Matrix;

/// f = M g(x) for the features g of a family: one more coefficient matrix, so points cost the same, and moments and blur stay.
pub struct Linear {
    inner: Box<dyn DynFamily>,
    dim: usize,
    /// M times the matrix of the inner family, row by row.
    coefficients: Vec<f64>,
}

impl Linear {
    /// Combine the features of a family in `dim` dimensions; a message where the sizes differ.
    pub fn new(inner: Box<dyn DynFamily>, dim: usize, matrix: &Matrix) -> Result<Self, String> {
        let (features, width) = (inner.num_features(dim), inner.num_basis(dim));
        if features != matrix.columns() {
            return Err(format!("`matrix` has {} columns, its basis {features} functions", matrix.columns()));
        }
        let coefficients = match inner.coefficients(dim) {
            None => matrix.values.clone(),
            Some(own) => product(&matrix.values, features, &own, width),
        };
        Ok(Self { inner, dim, coefficients })
    }

    /// Whiten the features by their covariance over target points.
    pub fn adapted(mut self, target: &Points, ridge: f64) -> Result<Self, String> {
        let width = self.inner.num_basis(self.dim);
        let rows = self.coefficients.len() / width;
        let root = whitening_root(&feature_covariance(&self, target), rows, ridge);
        let root = root.ok_or_else(|| "the functions do not vary on the target points".to_string())?;
        self.coefficients = product(&root, rows, &self.coefficients, width);
        Ok(self)
    }
}

/// Return a (rows x inner) times b (inner x width), both row by row.
fn product(a: &[f64], inner: usize, b: &[f64], width: usize) -> Vec<f64> {
    let mut out = vec![0.0; a.len() / inner * width];
    for (row, out) in a.chunks_exact(inner).zip(out.chunks_exact_mut(width)) {
        for (factor, own) in row.iter().zip(b.chunks_exact(width)) {
            out.iter_mut().zip(own).for_each(|(sum, value)| *sum += factor * value);
        }
    }
    out
}

impl DynFamily for Linear {
    fn supports(&self, dim: usize) -> bool {
        dim == self.dim
    }

    fn num_basis(&self, dim: usize) -> usize {
        self.inner.num_basis(dim)
    }

    fn per_coordinate(&self) -> Option<usize> {
        self.inner.per_coordinate()
    }

    fn segments(&self, dim: usize) -> Vec<Segment> {
        self.inner.segments(dim)
    }

    fn coefficients(&self, _dim: usize) -> Option<Vec<f64>> {
        Some(self.coefficients.clone())
    }

    fn monomials(&self, dim: usize) -> Option<&[[usize; 3]]> {
        self.inner.monomials(dim)
    }

    fn gradient_terms(&self, dim: usize) -> Option<Vec<GradientTerm>> {
        self.inner.gradient_terms(dim)
    }

    fn block(&self, isa: Isa, points: &MapBlock, out: BasisRows<'_>) {
        self.inner.block(isa, points, out);
    }

    fn values(&self, x: &[f64], out: &mut [f64]) {
        self.inner.values(x, out);
    }

    fn hyper(&self, x: &[HyperDual64], out: &mut [HyperDual64]) {
        self.inner.hyper(x, out);
    }

    fn blur_hyper(&self, dim: usize, covariance: &[HyperDual64], means: &mut [HyperDual64]) -> bool {
        self.inner.blur_hyper(dim, covariance, means)
    }
}
