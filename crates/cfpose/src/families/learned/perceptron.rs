//! A multilayer perceptron with one hidden layer.

use cfpose_kernel::family::Family;
use cfpose_kernel::scalar::Scalar;

use super::weights::Matrix;

/// M tanh(W x + b); the hidden units are the basis, M is its coefficient matrix.
pub struct Perceptron {
    /// W and b of each hidden unit; coordinates beyond the dimension are 0.
    units: Vec<([f64; 3], f64)>,
    dim: usize,
    output: Vec<f64>,
}

impl Perceptron {
    /// Make a perceptron of weights whose sizes agree.
    pub fn new(hidden: &Matrix, bias: &[f64], output: &Matrix) -> Self {
        let dim = hidden.columns();
        let unit = |(row, bias): (&[f64], &f64)| {
            let mut w = [0.0; 3];
            w[..dim].copy_from_slice(row);
            (w, *bias)
        };
        Self {
            units: hidden.values.chunks_exact(dim).zip(bias).map(unit).collect(),
            dim,
            output: output.values.clone(),
        }
    }
}

impl Family for Perceptron {
    fn num_basis(&self, _dim: usize) -> usize {
        self.units.len()
    }

    #[inline(always)]
    fn basis<S: Scalar, const D: usize>(&self, x: [S; D], out: &mut [S]) {
        let units = &self.units[..out.len()];
        for i in 0..out.len() {
            let (w, bias) = units[i];
            let mut sum = x[0] * w[0] + bias;
            for q in 1..D {
                sum = sum + x[q] * w[q];
            }
            out[i] = sum.tanh();
        }
    }

    fn coefficients(&self, _dim: usize) -> Option<Vec<f64>> {
        Some(self.output.clone())
    }

    fn supports(&self, dim: usize) -> bool {
        dim == self.dim
    }
}
