//! Monomials of degree 1..=D.

use cfpose_kernel::family::General;

use super::polynomial::Polynomial;
use super::shared::polynomials::{DEGREE_AND_KIND, KINDS};
use crate::entry::FamilyEntry;

pub(super) const ENTRY: FamilyEntry = FamilyEntry {
    name: "monomial",
    summary: "monomials of degree 1 to D",
    parameters: &DEGREE_AND_KIND,
    source: "the family of Domokos and Kato 2010, which the paper builds on",
    details: "x^a y^b z^c, ordered by degree, then lexicographically by (a, b, c). Has a closed-form blur. Badly conditioned beyond degree 4: prefer `hermite`.",
    build: |parameters, _| {
        let degree = parameters.count("degree", 1, 8)?;
        let products = parameters.choice("kind", &KINDS)?;
        let rows = (0..=degree).map(|n| (0..=n).map(|k| f64::from(u8::from(k == n))).collect()).collect();
        Ok(Box::new(General(Polynomial::new(rows, products))))
    },
};
