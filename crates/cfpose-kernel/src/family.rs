//! What an author of a feature family writes, and its erased form.

use num_dual::HyperDual64;

use crate::isa::Isa;
use crate::map::{MapBlock, Row};
use crate::scalar::Scalar;

mod concatenated;
mod erased;
pub mod polynomial;
mod quadrature_blur;

pub use concatenated::Concatenated;
pub use erased::{General, Separable};
pub use quadrature_blur::QuadratureBlur;

/// A family of feature functions f = C * basis(x) over a feature space of 1, 2 or 3 dimensions.
///
/// Derivatives come from automatic differentiation. Mark `basis` `#[inline(always)]` and write plain index loops.
pub trait Family: Send + Sync + 'static {
    /// Return the number of basis functions in `dim` dimensions.
    fn num_basis(&self, dim: usize) -> usize;

    /// Write the basis functions at `x`; `out` holds exactly `num_basis(D)` entries.
    fn basis<S: Scalar, const D: usize>(&self, x: [S; D], out: &mut [S]);

    /// Return C (features x basis, row by row), applied once to the sums; `None` means the basis functions are the features.
    fn coefficients(&self, _dim: usize) -> Option<Vec<f64>> {
        None
    }

    /// Replace means of the basis over points by means over points with Gaussian noise of the given covariance (upper
    /// triangle row by row, `dim (dim + 1) / 2` entries); return false where there is no closed form.
    fn blur<S: Scalar>(&self, _dim: usize, _covariance: &[S], _means: &mut [S]) -> bool {
        false
    }

    /// Say whether the family exists in `dim` dimensions.
    fn supports(&self, _dim: usize) -> bool {
        true
    }

    /// Return the exponents of the basis where it is made of monomials: data for the moment path. Each monomial comes after
    /// all its divisors.
    fn monomials(&self, _dim: usize) -> Option<&[[usize; 3]]> {
        None
    }

    /// Return the gradients of all basis functions as combinations of basis functions, where there are such: data that save the
    /// derivatives per point. The conformance check compares them with automatic differentiation. A function without terms is
    /// constant.
    fn gradient_terms(&self, _dim: usize) -> Option<Vec<GradientTerm>> {
        None
    }
}

/// One term of a gradient: d phi_function / d x_q contains factor * phi_of.
///
/// ```
/// use cfpose_kernel::family::Family;
/// use cfpose_kernel::family::polynomial::{Polynomial, Products};
/// // The monomials 1, x, x^2: d x^2 / dx = 2 x.
/// let family = Polynomial::new(vec![vec![1.0], vec![0.0, 1.0], vec![0.0, 0.0, 1.0]], Products::Total);
/// let terms = family.gradient_terms(1).unwrap();
/// assert_eq!((terms[1].function, terms[1].q, terms[1].of, terms[1].factor), (2, 0, 1, 2.0));
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GradientTerm {
    /// Basis function that is differentiated.
    pub function: usize,
    /// Coordinate, from 0.
    pub q: usize,
    /// Basis function of the term.
    pub of: usize,
    /// Its factor.
    pub factor: f64,
}

/// A family that applies the same one-dimensional functions to each coordinate.
///
/// Features are ordered by function, the coordinate index fastest, as the paper prints `trig18`.
pub trait SeparableFamily: Send + Sync + 'static {
    /// Return the number of basis functions of one coordinate.
    fn num_basis(&self) -> usize;

    /// Write the basis functions of one coordinate; `out` holds exactly `num_basis()` entries.
    fn basis<S: Scalar>(&self, x: S, out: &mut [S]);

    /// Return C of one coordinate (functions x basis, row by row); `None` means the identity.
    fn coefficients(&self) -> Option<Vec<f64>> {
        None
    }

    /// As [`Family::blur`], for one coordinate with noise of the given variance.
    fn blur<S: Scalar>(&self, _variance: S, _means: &mut [S]) -> bool {
        false
    }
}

/// A run of basis functions whose gradients are stored in one layout.
///
/// Values always take one row a function. Separable runs have function `q * num_per_coordinate + i` for coordinate q and store
/// one gradient row a function, d/dx_q; others store `dim` gradient rows a function, row `i * dim + q`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Segment {
    /// Number of basis functions.
    pub num_basis: usize,
    /// Number of basis functions per coordinate of a separable run.
    pub per_coordinate: Option<usize>,
}

impl Segment {
    /// Return the number of gradient rows in `dim` dimensions.
    pub fn num_gradient_rows(&self, dim: usize) -> usize {
        if self.per_coordinate.is_some() { self.num_basis } else { self.num_basis * dim }
    }
}

/// Values and gradients of the basis functions over one block, laid out by the family's [`Segment`]s.
pub struct BasisBlock {
    /// Basis values.
    pub value: Vec<Row>,
    /// Basis derivatives with respect to the feature coordinates; empty when none are wanted.
    pub gradient: Vec<Row>,
    /// Runs of functions, in order.
    pub segments: Vec<Segment>,
}

impl BasisBlock {
    /// Make a block for a family in `dim` dimensions.
    pub fn new(family: &dyn DynFamily, dim: usize, gradients: bool) -> Self {
        let segments = family.segments(dim);
        let rows = if gradients { segments.iter().map(|s| s.num_gradient_rows(dim)).sum() } else { 0 };
        Self { value: vec![Row::ZERO; family.num_basis(dim)], gradient: vec![Row::ZERO; rows], segments }
    }

    /// Borrow all rows.
    pub fn rows(&mut self) -> BasisRows<'_> {
        BasisRows { value: &mut self.value, gradient: &mut self.gradient }
    }
}

/// The rows of a [`BasisBlock`], or of the part of it that belongs to one family.
pub struct BasisRows<'a> {
    /// Basis values.
    pub value: &'a mut [Row],
    /// Basis derivatives; empty when none are wanted.
    pub gradient: &'a mut [Row],
}

impl<'a> BasisRows<'a> {
    /// Split off the rows of the functions of `family`, which come first; returns them and the rest.
    pub fn split(self, family: &dyn DynFamily, dim: usize) -> (Self, Self) {
        let slopes: usize = family.segments(dim).iter().map(|s| s.num_gradient_rows(dim)).sum();
        let (value, value_rest) = self.value.split_at_mut(family.num_basis(dim));
        let (gradient, gradient_rest) = self.gradient.split_at_mut(slopes.min(self.gradient.len()));
        (Self { value, gradient }, Self { value: value_rest, gradient: gradient_rest })
    }
}

/// A feature family, erased. Implemented by [`General`] and [`Separable`] for every author type, and by [`Concatenated`].
pub trait DynFamily: Send + Sync {
    /// Say whether the family exists in `dim` dimensions.
    fn supports(&self, dim: usize) -> bool;

    /// Return the number of basis functions.
    fn num_basis(&self, dim: usize) -> usize;

    /// Return the number of basis functions per coordinate of a separable family.
    fn per_coordinate(&self) -> Option<usize>;

    /// Return how the rows of the basis are laid out; one run unless the family is made of several.
    fn segments(&self, dim: usize) -> Vec<Segment> {
        vec![Segment { num_basis: self.num_basis(dim), per_coordinate: self.per_coordinate() }]
    }

    /// Return C (features x basis, row by row); `None` means the identity.
    fn coefficients(&self, dim: usize) -> Option<Vec<f64>>;

    /// Write values, and gradients when `out` has room for them, at the points of a block.
    fn block(&self, isa: Isa, points: &MapBlock, out: BasisRows<'_>);

    /// Write the basis values at one point (`x.len()` is the dimension).
    fn values(&self, x: &[f64], out: &mut [f64]);

    /// Write the basis values at one point over second-order duals.
    fn hyper(&self, x: &[HyperDual64], out: &mut [HyperDual64]);

    /// Blur basis means over second-order duals, as [`Family::blur`].
    fn blur_hyper(&self, dim: usize, covariance: &[HyperDual64], means: &mut [HyperDual64]) -> bool;

    /// Return the exponents of a basis of monomials, as [`Family::monomials`].
    fn monomials(&self, _dim: usize) -> Option<&[[usize; 3]]> {
        None
    }

    /// Return the gradients of the basis in its own terms, as [`Family::gradient_terms`].
    fn gradient_terms(&self, _dim: usize) -> Option<Vec<GradientTerm>> {
        None
    }

    /// Return the number of features.
    fn num_features(&self, dim: usize) -> usize {
        let num_basis = self.num_basis(dim);
        self.coefficients(dim).map_or(num_basis, |c| c.len() / num_basis)
    }

    /// Return all features at one point.
    fn features(&self, x: &[f64]) -> Vec<f64> {
        let num_basis = self.num_basis(x.len());
        let mut basis = vec![0.0; num_basis];
        self.values(x, &mut basis);
        match self.coefficients(x.len()) {
            None => basis,
            Some(c) => c.chunks_exact(num_basis).map(|row| row.iter().zip(&basis).map(|(a, b)| a * b).sum()).collect(),
        }
    }
}
