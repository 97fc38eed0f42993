//! The basis of the paper's functions, as it is.

use std::f64::consts::PI;

use cfpose_kernel::family::{Separable, SeparableFamily};
use cfpose_kernel::scalar::Scalar;

use crate::entry::FamilyEntry;

/// x, sin(pi x), x cos(pi x), x^2, sin^2(pi x), cos(pi x) of each coordinate, with a coefficient matrix or without.
pub struct Trig {
    pub coefficients: Option<Vec<f64>>,
}

impl SeparableFamily for Trig {
    fn num_basis(&self) -> usize {
        6
    }

    #[inline(always)]
    fn basis<S: Scalar>(&self, x: S, out: &mut [S]) {
        let (sine, cosine) = x.sin_cos_pi();
        out[0] = x;
        out[1] = sine;
        out[2] = x * cosine;
        out[3] = x * x;
        out[4] = sine * sine;
        out[5] = cosine;
    }

    fn coefficients(&self) -> Option<Vec<f64>> {
        self.coefficients.clone()
    }

    /// With g = exp(-pi^2 s^2 / 2), s^2 the variance: sin -> g sin, cos -> g cos, x cos -> g (x cos - pi s^2 sin),
    /// x^2 -> x^2 + s^2, sin^2 -> 1/2 - 1/2 g^4 (1 - 2 sin^2).
    fn blur<S: Scalar>(&self, variance: S, means: &mut [S]) -> bool {
        let g = (variance * (-0.5 * PI * PI)).exp();
        let g4 = (variance * (-2.0 * PI * PI)).exp();
        means[2] = g * (means[2] - means[1] * variance * PI);
        means[1] = g * means[1];
        means[3] = means[3] + variance;
        means[4] = (g4 * (means[4] * 2.0 - 1.0) + 1.0) * 0.5;
        means[5] = g * means[5];
        true
    }
}

/// The basis by itself, which `orthonormalised` knows by this name beside the families of the table.
pub const ENTRY: FamilyEntry = FamilyEntry {
    name: "trig",
    summary: "the basis of the paper's functions, six of each coordinate, not combined",
    parameters: &[],
    source: "section IV.B.2, the basis before orthonormalisation",
    details: "x, sin(pi x), x cos(pi x), x^2, sin^2(pi x), cos(pi x) of each coordinate, the coordinate index fastest. `orthonormalised[basis=trig]` makes `trig18` of it. Has a closed-form blur.",
    build: |_, _| Ok(Box::new(Separable(Trig { coefficients: None }))),
};
