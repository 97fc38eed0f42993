//! The affine map of any dimension.

use cfpose_kernel::author::Map;
use cfpose_kernel::scalar::Scalar;

/// A p + b in `D` dimensions, theta = (A row by row, b).
pub struct Affine<const D: usize>;

impl<const D: usize> Map<D, D, D> for Affine<D> {
    const PROJECTION_IS_IDENTITY: bool = true;
    fn affine<S: Scalar>(&self, theta: &[S], a: &mut [S], b: &mut [S]) {
        a.copy_from_slice(&theta[..D * D]);
        b.copy_from_slice(&theta[D * D..]);
    }
    #[inline(always)]
    fn project<S: Scalar>(&self, y: [S; D]) -> [S; D] {
        y
    }
}
