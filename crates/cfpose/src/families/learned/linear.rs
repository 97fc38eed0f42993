//! A trained matrix over the features of another family.

use cfpose_kernel::family::{BasisRows, DynFamily, GradientTerm, Segment};
use cfpose_kernel::isa::Isa;
use cfpose_kernel::map::MapBlock;
use num_dual::HyperDual64;

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
            Some(own) => {
                let mut product = vec![0.0; matrix.rows * width];
                for (row, out) in matrix.values.chunks_exact(features).zip(product.chunks_exact_mut(width)) {
                    for (factor, own) in row.iter().zip(own.chunks_exact(width)) {
                        out.iter_mut().zip(own).for_each(|(sum, value)| *sum += factor * value);
                    }
                }
                product
            }
        };
        Ok(Self { inner, dim, coefficients })
    }
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
