//! Products of Legendre polynomials, orthogonal under a uniform weight.

use cfpose_kernel::family::General;

use super::polynomial::{Polynomial, recurrence_rows};
use super::shared::polynomials::{INTERVAL, KINDS, SCALES};
use crate::entry::FamilyEntry;

pub(super) const ENTRY: FamilyEntry = FamilyEntry {
    name: "legendre",
    summary: "products of Legendre polynomials, orthonormal under a uniform weight on a box",
    parameters: &INTERVAL,
    source: "classical; not in the paper",
    details: "Products of P_n(x / a), ordered by degree, then lexicographically by exponents; `value` multiplies each factor by sqrt(2 n + 1), which makes the functions orthonormal under the uniform weight on the box |x_q| <= a. For shapes that fill their box; under the `paper` and `whiten` normalisers most points have |x_q| < 1. Has a closed-form blur.",
    build: |parameters, _| {
        let degree = parameters.count("degree", 1, 8)?;
        let products = parameters.choice("kind", &KINDS)?;
        let normalise = parameters.choice("scale", &SCALES)?;
        let a = parameters.number("half-width", "a positive number", |a| a > 0.0 && a.is_finite())?;
        // (n + 1) P_(n+1)(t) = (2 n + 1) t P_n(t) - n P_(n-1)(t) with t = x / a.
        let mut rows = recurrence_rows(degree, 1.0 / a, |n| {
            let next = n as f64 + 1.0;
            ((2.0 * n as f64 + 1.0) / next, n as f64 / next)
        });
        if normalise {
            for (n, row) in rows.iter_mut().enumerate() {
                row.iter_mut().for_each(|value| *value *= (2.0 * n as f64 + 1.0).sqrt());
            }
        }
        Ok(Box::new(General(Polynomial::new(rows, products))))
    },
};
