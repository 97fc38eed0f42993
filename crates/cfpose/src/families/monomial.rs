//! Monomials of degree 1..=D.

use super::polynomial::{Polynomial, Products};
use crate::entry::ParameterSpec;
use crate::family::{FamilyEntry, General};

pub(super) const PARAMETERS: [ParameterSpec; 2] = [
    ParameterSpec { name: "degree", default: "3", meaning: "largest degree, 1 to 8" },
    ParameterSpec {
        name: "kind",
        default: "total",
        meaning: "total: all products up to the degree; separable: powers of single coordinates",
    },
];

/// Names of [`Products`] in parameters.
pub(super) const KINDS: [(&str, Products); 2] = [("total", Products::Total), ("separable", Products::Separable)];

pub(super) const ENTRY: FamilyEntry = FamilyEntry {
    name: "monomial",
    summary: "monomials of degree 1 to D",
    parameters: &PARAMETERS,
    source: "the family of Domokos and Kato 2010, which the paper builds on",
    details: "x^a y^b z^c, ordered by degree, then lexicographically by (a, b, c). Has a closed-form blur. Badly conditioned beyond degree 4: prefer `hermite`.",
    build: |parameters, _| {
        let degree = parameters.count("degree", 1, 8)?;
        let products = parameters.choice("kind", &KINDS)?;
        let rows = (0..=degree).map(|n| (0..=n).map(|k| f64::from(u8::from(k == n))).collect()).collect();
        Ok(Box::new(General(Polynomial::new(rows, products))))
    },
};
