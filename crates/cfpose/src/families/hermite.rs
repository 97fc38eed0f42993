//! Products of probabilists' Hermite polynomials He_n(2 x), orthogonal under p(x) = 2 / sqrt(2 pi) exp(-2 x^2).

use cfpose_kernel::family::General;

use super::polynomial::{Polynomial, recurrence_rows};
use super::shared::polynomials::{DEGREE_AND_KIND, KINDS};
use crate::entry::FamilyEntry;
use crate::entry::ParameterSpec;

/// Scale of the one-dimensional polynomials.
#[derive(Clone, Copy)]
enum Scale {
    /// He_n(2x) / sqrt(n!): values orthonormal.
    Value,
    /// Gradients orthonormal: the values divided by 2 sqrt(n), since E |grad f|^2 = 4 n for a value-scaled product of total
    /// degree n (in one dimension E (He_n(2x)')^2 = 4 n^2 (n-1)!).
    Gradient,
    /// He_n(2x).
    Raw,
}

const PARAMETERS: [ParameterSpec; 3] = [
    DEGREE_AND_KIND[0],
    DEGREE_AND_KIND[1],
    ParameterSpec {
        name: "scale",
        default: "value",
        meaning: "value: orthonormal functions; gradient: orthonormal gradients; raw: He_n(2x)",
    },
];

fn factorial(n: usize) -> f64 {
    (1..=n).map(|k| k as f64).product()
}

pub(super) const ENTRY: FamilyEntry = FamilyEntry {
    name: "hermite",
    summary: "products of Hermite polynomials He_n(2x), orthonormal under the paper's weight",
    parameters: &PARAMETERS,
    source: "section IV.A (weight p); differs from the paper, whose functions are trig18",
    details: "Products of He_n(2x), ordered by degree, then lexicographically by exponents; `value`: divided by sqrt(n!) per factor (orthonormal under p), `gradient`: further divided by 2 sqrt(total degree) (orthonormal gradients), `raw`: as they are. Cross terms (kind `total`) matter more than the scale. Has a closed-form blur.",
    build: |parameters, _| {
        let degree = parameters.count("degree", 1, 8)?;
        let products = parameters.choice("kind", &KINDS)?;
        let choices = [("value", Scale::Value), ("gradient", Scale::Gradient), ("raw", Scale::Raw)];
        let scale = parameters.choice("scale", &choices)?;
        // He_(n+1)(t) = t He_n(t) - n He_(n-1)(t) with t = 2x.
        let mut rows = recurrence_rows(degree, 2.0, |n| (1.0, n as f64));
        if !matches!(scale, Scale::Raw) {
            for (n, row) in rows.iter_mut().enumerate() {
                row.iter_mut().for_each(|value| *value /= factorial(n).sqrt());
            }
        }
        let mut family = Polynomial::new(rows, products);
        if matches!(scale, Scale::Gradient) {
            family = family.with_degree_scale((0..=degree).map(|n| 0.5 / (n.max(1) as f64).sqrt()).collect());
        }
        Ok(Box::new(General(family)))
    },
};
