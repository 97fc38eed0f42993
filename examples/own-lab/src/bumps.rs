//! A feature family: Gaussian bumps along each coordinate. See docs/adding/family.md.

use cfpose::Scalar;
use cfpose::entry::ParameterSpec;
use cfpose::family::{FamilyEntry, Separable, SeparableFamily};

/// f_i(x) = exp(-(x - c_i)^2 / (2 width^2)), centres evenly from -1 to 1.
struct Bumps {
    count: usize,
    /// -1 / (2 width^2).
    exponent: f64,
}

impl SeparableFamily for Bumps {
    fn num_basis(&self) -> usize {
        self.count
    }

    // Once per point and coordinate, on numbers, duals and SIMD lanes: plain loops, no `if` on a value.
    #[inline(always)]
    fn basis<S: Scalar>(&self, x: S, out: &mut [S]) {
        let spacing = 2.0 / (self.count - 1) as f64;
        for i in 0..self.count {
            let distance = x - (spacing * i as f64 - 1.0);
            out[i] = (distance * distance * self.exponent).exp();
        }
    }
}

/// The table line.
pub static ENTRY: FamilyEntry = FamilyEntry {
    name: "bumps",
    summary: "Gaussian bumps along each coordinate",
    parameters: &[
        ParameterSpec { name: "count", default: "4", meaning: "number of bumps, 2 to 32" },
        ParameterSpec { name: "width", default: "0.35", meaning: "width of a bump in normalised coordinates, > 0" },
    ],
    source: "own-lab",
    details: "f_i(x) = exp(-(x - c_i)^2 / (2 width^2)), centres evenly from -1 to 1.",
    build: |parameters, _| {
        let count = parameters.count("count", 2, 32)?;
        let width = parameters.number("width", "a number above 0", |w| w.is_finite() && w > 0.0)?;
        Ok(Box::new(Separable(Bumps { count, exponent: -0.5 / (width * width) })))
    },
};
