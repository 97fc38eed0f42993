//! Polynomials of bounded degree: shared monomials, one coefficient matrix.

use super::{Family, GradientTerm};
use crate::scalar::Scalar;

/// Which products of one-dimensional polynomials belong to a family of degree D.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Products {
    /// All products of total degree 1..=D: cross terms included.
    Total,
    /// Powers of single coordinates only.
    Separable,
}

/// Exponents of a polynomial family in one dimension of the feature space.
#[derive(Debug, Clone)]
struct Table {
    /// Exponents of the basis monomials; the constant comes first, so each has a parent before it.
    exponents: Vec<[usize; 3]>,
    /// Monomial i is monomial `parent.0` times coordinate `parent.1`.
    parents: Vec<(usize, usize)>,
}

/// A polynomial family f_e(x) = prod_q h_(e_q)(x_q) for one-dimensional polynomials h_n, over a basis of monomials.
///
/// Functions are ordered by degree, then lexicographically by their exponents: in two dimensions y, x, y^2, x y, x^2, ...
#[derive(Debug, Clone)]
pub struct Polynomial {
    tables: [Table; 3],
    /// `rows[n]` holds the monomial coefficients of h_n, lowest power first.
    rows: Vec<Vec<f64>>,
    /// Factor of a function by its total degree.
    degree_scale: Vec<f64>,
}

/// List the exponents of a family: by degree, then lexicographically, the constant first.
fn exponents(dim: usize, degree: usize, products: Products) -> Vec<[usize; 3]> {
    let mut all = Vec::new();
    let range = |q: usize| 0..=if q < dim { degree } else { 0 };
    for a in range(0) {
        for b in range(1) {
            for c in range(2) {
                let used = [a, b, c].iter().filter(|e| **e > 0).count();
                if a + b + c <= degree && (products == Products::Total || used <= 1) {
                    all.push([a, b, c]);
                }
            }
        }
    }
    all.sort_by_key(|e| (e.iter().sum::<usize>(), *e));
    all
}

/// Return the monomial coefficients of h_0..h_degree, lowest power first, for h_0 = 1, h_1 = t and the recurrence
/// h_(n+1)(t) = a_n t h_n(t) - b_n h_(n-1)(t), n >= 1, at t = `factor` x.
pub fn recurrence_rows(degree: usize, factor: f64, step: impl Fn(usize) -> (f64, f64)) -> Vec<Vec<f64>> {
    let mut rows: Vec<Vec<f64>> = vec![vec![1.0], vec![0.0, factor]];
    for n in 1..degree {
        let (a, b) = step(n);
        let mut next = vec![0.0; n + 2];
        for (k, value) in rows[n].iter().enumerate() {
            next[k + 1] += a * factor * value;
        }
        for (k, value) in rows[n - 1].iter().enumerate() {
            next[k] -= b * value;
        }
        rows.push(next);
    }
    rows.truncate(degree + 1);
    rows
}

impl Polynomial {
    /// Make a family from one-dimensional polynomials of degree 0..=D (`rows[n]`, lowest power first).
    pub fn new(rows: Vec<Vec<f64>>, products: Products) -> Self {
        let degree = rows.len() - 1;
        let tables = [1, 2, 3].map(|dim| {
            let exponents = exponents(dim, degree, products);
            let parents = exponents
                .iter()
                .map(|e| {
                    let Some(q) = (0..3).rev().find(|q| e[*q] > 0) else { return (0, 0) };
                    let mut parent = *e;
                    parent[q] -= 1;
                    (exponents.iter().position(|other| *other == parent).unwrap_or(0), q)
                })
                .collect();
            Table { exponents, parents }
        });
        let degree_scale = vec![1.0; rows.len()];
        Self { tables, rows, degree_scale }
    }

    /// Multiply each function by a factor of its total degree (`scale[n]`, n = 0..=D).
    #[must_use]
    pub fn with_degree_scale(mut self, scale: Vec<f64>) -> Self {
        self.degree_scale = scale;
        self
    }

    /// Return for each basis monomial its parent and the coordinate that the parent is multiplied by; nothing stands for the constant.
    pub(crate) fn parents(&self, dim: usize) -> &[(usize, usize)] {
        &self.tables[dim - 1].parents
    }

    /// Return the exponents of the basis monomials in `dim` dimensions, the constant first.
    pub fn exponents(&self, dim: usize) -> &[[usize; 3]] {
        &self.tables[dim - 1].exponents
    }
}

impl Family for Polynomial {
    fn num_basis(&self, dim: usize) -> usize {
        self.tables[dim - 1].exponents.len()
    }

    #[inline(always)]
    fn basis<S: Scalar, const D: usize>(&self, x: [S; D], out: &mut [S]) {
        let parents = &self.tables[D - 1].parents[..out.len()];
        out[0] = x[0].constant(1.0);
        for i in 1..out.len() {
            out[i] = out[parents[i].0] * x[parents[i].1];
        }
    }

    fn coefficients(&self, dim: usize) -> Option<Vec<f64>> {
        let monomials = self.exponents(dim);
        let mut matrix = Vec::with_capacity((monomials.len() - 1) * monomials.len());
        for feature in &monomials[1..] {
            for monomial in monomials {
                // Coefficient of x^monomial in the product of the one-dimensional polynomials.
                let product: f64 =
                    (0..3).map(|q| self.rows[feature[q]].get(monomial[q]).copied().unwrap_or(0.0)).product();
                matrix.push(product * self.degree_scale[feature.iter().sum::<usize>()]);
            }
        }
        Some(matrix)
    }

    fn monomials(&self, dim: usize) -> Option<&[[usize; 3]]> {
        Some(&self.tables[dim - 1].exponents)
    }

    /// d x^e / d x_q = e_q x^(e - 1_q).
    fn gradient_terms(&self, dim: usize) -> Option<Vec<GradientTerm>> {
        let monomials = self.exponents(dim);
        let mut terms = Vec::new();
        for (function, e) in monomials.iter().enumerate() {
            for q in (0..dim).filter(|q| e[*q] > 0) {
                let mut lower = *e;
                lower[q] -= 1;
                let of = monomials.iter().position(|other| *other == lower)?;
                terms.push(GradientTerm { function, q, of, factor: e[q] as f64 });
            }
        }
        Some(terms)
    }

    /// E (x + e)^n for Gaussian e: exp(1/2 sum_ab cov_ab d_a d_b) applied to monomials, a finite series.
    fn blur<S: Scalar>(&self, dim: usize, covariance: &[S], means: &mut [S]) -> bool {
        let monomials = self.exponents(dim);
        let zero = means[0].constant(0.0);
        let degree = self.rows.len() - 1;
        let mut term = means.to_vec();
        for order in 1..=degree / 2 {
            let mut next = vec![zero; means.len()];
            for (i, exponent) in monomials.iter().enumerate() {
                let mut entry = 0;
                for a in 0..dim {
                    for b in a..dim {
                        let (factor, lower) = second_derivative(exponent, a, b);
                        let place = monomials.iter().position(|other| *other == lower);
                        if let (true, Some(place)) = (factor > 0.0, place) {
                            next[i] = next[i] + covariance[entry] * term[place] * factor;
                        }
                        entry += 1;
                    }
                }
                next[i] = next[i] * (1.0 / order as f64);
            }
            for (mean, value) in means.iter_mut().zip(&next) {
                *mean = *mean + *value;
            }
            term = next;
        }
        true
    }
}

/// Return factor and exponent of 1/2 d_a d_b (twice counted off the diagonal) of a monomial.
fn second_derivative(exponent: &[usize; 3], a: usize, b: usize) -> (f64, [usize; 3]) {
    let mut lower = *exponent;
    let mut factor = if a == b { 0.5 } else { 1.0 };
    for q in [a, b] {
        if lower[q] == 0 {
            return (0.0, *exponent);
        }
        factor *= lower[q] as f64;
        lower[q] -= 1;
    }
    (factor, lower)
}
