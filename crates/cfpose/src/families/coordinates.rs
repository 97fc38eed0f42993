//! f_i(x) = x_i: the average itself.

use cfpose_kernel::family::{Separable, SeparableFamily};
use cfpose_kernel::scalar::Scalar;

use crate::entry::FamilyEntry;

struct Coordinates;

impl SeparableFamily for Coordinates {
    fn num_basis(&self) -> usize {
        1
    }
    #[inline(always)]
    fn basis<S: Scalar>(&self, x: S, out: &mut [S]) {
        out[0] = x;
    }
    fn blur<S: Scalar>(&self, _variance: S, _means: &mut [S]) -> bool {
        true // noise of mean zero does not move a mean
    }
}

pub(super) const ENTRY: FamilyEntry = FamilyEntry {
    name: "coordinates",
    summary: "the coordinates themselves: f_i = x_i",
    parameters: &[],
    source: "section III.B, the simplest feature functions",
    details: "f_i(x) = x_i, as many functions as dimensions.",
    build: |_, _| Ok(Box::new(Separable(Coordinates))),
};
