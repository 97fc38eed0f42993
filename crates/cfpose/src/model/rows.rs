//! Extra residual rows that depend on theta alone: what an author writes, and its erased form.

use cfpose_kernel::scalar::Scalar;
use num_dual::{DualSVec64, HyperDual64};

/// Extra residual rows that depend on theta alone: priors, bending energy. Written over [`Scalar`] like everything else.
pub trait ResidualRows: Send + Sync + 'static {
    /// Return the number of rows.
    fn num_rows(&self) -> usize;

    /// Write the rows at ambient theta.
    fn rows<S: Scalar>(&self, theta: &[S], out: &mut [S]);
}

/// [`ResidualRows`], erased; implemented for every author type.
pub trait DynRows: Send + Sync {
    /// Return the number of rows.
    fn num_rows(&self) -> usize;
    /// Write the rows.
    fn values(&self, theta: &[f64], out: &mut [f64]);
    /// Write the rows with first derivatives.
    fn duals(&self, theta: &[DualSVec64<8>], out: &mut [DualSVec64<8>]);
    /// Write the rows with second derivatives.
    fn hyper(&self, theta: &[HyperDual64], out: &mut [HyperDual64]);
}

impl<R: ResidualRows> DynRows for R {
    fn num_rows(&self) -> usize {
        ResidualRows::num_rows(self)
    }
    fn values(&self, theta: &[f64], out: &mut [f64]) {
        self.rows(theta, out);
    }
    fn duals(&self, theta: &[DualSVec64<8>], out: &mut [DualSVec64<8>]) {
        self.rows(theta, out);
    }
    fn hyper(&self, theta: &[HyperDual64], out: &mut [HyperDual64]) {
        self.rows(theta, out);
    }
}
