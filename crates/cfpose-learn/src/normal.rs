//! What an objective sees of a state: inner products of the feature means and their derivatives.

use nalgebra::{DMatrix, DVector};
use num_dual::DualNumCopy;
use num_dual::linalg::LU;

/// Sizes of a state.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shape {
    /// Tangent directions of theta, m.
    pub unknowns: usize,
    /// Perturbations of the target's means.
    pub perturbations: usize,
}

impl Shape {
    /// Return the number of columns of a state: difference of the means, its derivatives, perturbations.
    pub fn width(self) -> usize {
        1 + self.unknowns + self.perturbations
    }

    /// Return the number of distinct inner products of the columns.
    pub fn products(self) -> usize {
        self.width() * (self.width() + 1) / 2
    }

    /// Return the place of the product of columns a <= b in a list of the upper triangle, row by row.
    pub fn place(self, a: usize, b: usize) -> usize {
        a * self.width() - a * (a + 1) / 2 + b
    }
}

/// The normal equations of one state: with f = C g, r = C (mean g(P) - mean g(Q)) the residual, A its Jacobian and u the change of the
/// target's means by a perturbation, all inner products of r, A and u.
///
/// An objective is a function of these numbers and of the known error; whatever is trained enters through them, so its derivative
/// is the chain rule through the products.
pub struct Normal<'a, D> {
    shape: Shape,
    products: &'a [D],
    delta: &'a [f64],
}

impl<'a, D: DualNumCopy<Primitive = f64>> Normal<'a, D> {
    /// Look at products (upper triangle row by row) and the error of theta.
    pub fn new(shape: Shape, products: &'a [D], delta: &'a [f64]) -> Self {
        Self { shape, products, delta }
    }

    fn product(&self, a: usize, b: usize) -> D {
        self.products[self.shape.place(a.min(b), a.max(b))]
    }

    /// Return the number of tangent directions m.
    pub fn unknowns(&self) -> usize {
        self.shape.unknowns
    }

    /// Return the number of perturbations.
    pub fn perturbations(&self) -> usize {
        self.shape.perturbations
    }

    /// Return the error of theta: the tangent step that leads from the truth to it, negated in the tangent space of theta.
    pub fn delta(&self) -> &[f64] {
        self.delta
    }

    /// Return r'r.
    pub fn cost(&self) -> D {
        self.product(0, 0)
    }

    /// Return (A'r)_i.
    pub fn gradient(&self, i: usize) -> D {
        self.product(0, 1 + i)
    }

    /// Return (A'A)_ij.
    pub fn hessian(&self, i: usize, j: usize) -> D {
        self.product(1 + i, 1 + j)
    }

    /// Return (A'u_k)_i.
    pub fn push(&self, i: usize, k: usize) -> D {
        self.product(1 + i, 1 + self.shape.unknowns + k)
    }

    /// Return (A'A + damping diag(A'A))^-1 times the columns of the right-hand side; `None` where that is singular.
    pub fn solve(&self, damping: f64, right: &[DVector<D>]) -> Option<Vec<DVector<D>>> {
        let m = self.unknowns();
        let trace = (0..m).fold(D::from(0.0), |sum, i| sum + self.hessian(i, i));
        let matrix = DMatrix::from_fn(m, m, |i, j| {
            let entry = self.hessian(i, j);
            // A speck of the trace keeps directions that the features do not see solvable.
            if i == j { entry * (1.0 + damping) + trace * 1e-12 } else { entry }
        });
        let factors = LU::new(matrix).ok()?;
        Some(right.iter().map(|column| factors.solve(column)).collect())
    }
}
