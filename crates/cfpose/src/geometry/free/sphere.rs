//! The unit vectors of which only some tangent directions move.

use cfpose_optim::manifold::{Manifold, UnitSphere};
use num_dual::HyperDual64;

/// The unit vectors spanned by a base point and some tangent directions at it: a great sphere of lower dimension.
///
/// A mask on the tangent coordinates would not do: the tangent basis turns with the point, so that steps along one coordinate
/// leave what the other one held fixed. Ambient coordinates are those of the whole sphere.
#[derive(Debug, Clone)]
pub(super) struct GreatSphere {
    /// Orthonormal columns (ambient x (1 + free)), row by row: the base, then the free tangent directions there.
    frame: Vec<f64>,
    ambient: usize,
    sphere: UnitSphere,
}

impl GreatSphere {
    /// Span the base (a unit vector) and the tangent directions `free` (indices from 0) at it.
    pub fn new(base: &[f64], free: &[usize]) -> Self {
        let ambient = base.len();
        let whole = UnitSphere(ambient - 1);
        let mut basis = vec![0.0; ambient * whole.tangent()];
        whole.basis(base, &mut basis);
        let mut frame = Vec::with_capacity(ambient * (1 + free.len()));
        for (i, value) in base.iter().enumerate() {
            frame.push(*value);
            frame.extend(free.iter().map(|j| basis[i * whole.tangent() + j]));
        }
        Self { frame, ambient, sphere: UnitSphere(free.len()) }
    }

    /// Return the coordinates in the frame.
    fn inside(&self, theta: &[f64]) -> Vec<f64> {
        let width = self.sphere.ambient();
        (0..width).map(|c| (0..self.ambient).map(|i| self.frame[i * width + c] * theta[i]).sum()).collect()
    }

    /// Write the ambient coordinates of a point of the frame.
    fn outside(&self, inside: &[f64], out: &mut [f64]) {
        for (value, row) in out.iter_mut().zip(self.frame.chunks_exact(self.sphere.ambient())) {
            *value = row.iter().zip(inside).map(|(a, b)| a * b).sum();
        }
    }
}

impl Manifold for GreatSphere {
    fn ambient(&self) -> usize {
        self.ambient
    }
    fn tangent(&self) -> usize {
        self.sphere.tangent()
    }
    fn retract(&self, theta: &[f64], step: &[f64], out: &mut [f64]) {
        if step[..self.tangent()].iter().all(|value| *value == 0.0) {
            out[..self.ambient].copy_from_slice(&theta[..self.ambient]);
            return;
        }
        let mut reached = vec![0.0; self.sphere.ambient()];
        self.sphere.retract(&self.inside(theta), step, &mut reached);
        self.outside(&reached, out);
    }
    fn local(&self, from: &[f64], to: &[f64], step: &mut [f64]) {
        self.sphere.local(&self.inside(from), &self.inside(to), step);
    }
    fn lift2(&self, theta: &[f64], step: &[HyperDual64], out: &mut [HyperDual64]) {
        let zero = HyperDual64::from(0.0);
        let mut reached = vec![zero; self.sphere.ambient()];
        self.sphere.lift2(&self.inside(theta), step, &mut reached);
        for (value, row) in out.iter_mut().zip(self.frame.chunks_exact(self.sphere.ambient())) {
            *value = row.iter().zip(&reached).fold(zero, |sum, (a, b)| sum + *b * *a);
        }
    }
    fn project(&self, theta: &mut [f64]) {
        let mut inside = self.inside(theta);
        self.sphere.project(&mut inside);
        self.outside(&inside, theta);
    }
}
