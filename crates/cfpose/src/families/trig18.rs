//! The paper's functions with their printed coefficients: six of each coordinate, eighteen in three dimensions.
//!
//! "x cos(pi x_i)" in the print means x_i cos(pi x_i). Erratum: the text says that the *gradients* are orthogonal under
//! p(x) = 2 / sqrt(2 pi) exp(-2 x^2); it is the functions themselves that are orthonormal (see the tests).

use cfpose_kernel::family::Separable;

use super::shared::trig::Trig;
use crate::entry::FamilyEntry;

/// Rows f_1, f_4, f_7, f_10, f_13, f_16 as printed, over the basis x, sin, x cos, x^2, sin^2, cos (of pi x).
#[rustfmt::skip]
const COEFFICIENTS: [f64; 36] = [
    -0.6578, -1.058,   0.123,  0.0,     0.0,     0.0,
     0.0,     0.0,     0.0,   -0.2567,  0.3437,  1.286,
     0.0,     0.0,     0.0,   -0.7620, -1.288,   0.1921,
     1.245,  -0.9539, -1.540,  0.0,     0.0,     0.0,
     0.0,     0.0,     0.0,    2.998,  -1.620,   1.032,
    -4.656,   2.290,  -5.183,  0.0,     0.0,     0.0,
];

pub(super) const ENTRY: FamilyEntry = FamilyEntry {
    name: "trig18",
    summary: "the paper's six trigonometric functions of each coordinate, printed coefficients",
    parameters: &[],
    source: "section IV.B.2; erratum: the functions, not their gradients, are orthonormal",
    details: "Six functions of each coordinate over the basis x, sin(pi x), x cos(pi x), x^2, sin^2(pi x), cos(pi x), printed coefficients; f_1..f_18 as printed, the coordinate index fastest. The functions are orthonormal under p(x) = 2 / sqrt(2 pi) exp(-2 x^2), their gradients are not (erratum). Has a closed-form blur.",
    build: |_, _| Ok(Box::new(Separable(Trig { coefficients: Some(COEFFICIENTS.to_vec()) }))),
};
