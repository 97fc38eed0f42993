//! Products of Chebyshev polynomials of the first kind, orthogonal under the arcsine weight.

use cfpose_kernel::family::General;

use super::polynomial::{Polynomial, recurrence_rows};
use super::shared::polynomials::{INTERVAL, KINDS, SCALES};
use crate::entry::FamilyEntry;

pub(super) const ENTRY: FamilyEntry = FamilyEntry {
    name: "chebyshev",
    summary: "products of Chebyshev polynomials, orthonormal under the arcsine weight on a box",
    parameters: &INTERVAL,
    source: "classical; not in the paper",
    details: "Products of T_n(x / a), ordered by degree, then lexicographically by exponents; `value` multiplies each factor of degree n >= 1 by sqrt(2), which makes the functions orthonormal under the weight 1 / (pi sqrt(a^2 - x^2)) per coordinate. All |T_n| <= 1 in the box: no function dominates. Suits shapes whose points crowd at the border. Has a closed-form blur.",
    build: |parameters, _| {
        let degree = parameters.count("degree", 1, 8)?;
        let products = parameters.choice("kind", &KINDS)?;
        let normalise = parameters.choice("scale", &SCALES)?;
        let a = parameters.number("half-width", "a positive number", |a| a > 0.0 && a.is_finite())?;
        // T_(n+1)(t) = 2 t T_n(t) - T_(n-1)(t) with t = x / a.
        let mut rows = recurrence_rows(degree, 1.0 / a, |_| (2.0, 1.0));
        if normalise {
            for row in rows.iter_mut().skip(1) {
                row.iter_mut().for_each(|value| *value *= 2.0_f64.sqrt());
            }
        }
        Ok(Box::new(General(Polynomial::new(rows, products))))
    },
};
