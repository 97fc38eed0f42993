//! A linear map about the centre of its points: steps turn and stretch about the centre, and translations move it.
//!
//! Far from the origin a small turn about the origin is a large shift, so that rotation and translation are nearly the same
//! direction. Theta itself stays as it is; only what a step means changes.

use std::sync::Arc;

use cfpose_kernel::scalar::Scalar;
use cfpose_optim::manifold::Manifold;
use num_dual::HyperDual64;

use crate::geometry::theta::{BlockKind, Layout};

/// The linear part A of x -> A x + T in the ambient coordinates of theta.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Linear {
    /// Dimension x dimension, row by row, times the coordinate at `scale`.
    Matrix { at: usize, scale: Option<usize> },
    /// A turn in the plane, times the coordinate at `scale`.
    Angle { at: usize, scale: Option<usize> },
}

/// The manifold of theta, its tangent translation being that of the image of a centre.
#[derive(Debug, Clone)]
pub(crate) struct Centred {
    inner: Arc<dyn Manifold>,
    linear: Linear,
    centre: Vec<f64>,
    /// First ambient coordinate of the translation, and first tangent one.
    ambient: usize,
    tangent: usize,
}

impl Centred {
    /// Make the manifold of a layout with a linear part and a translation of `centre.len()` numbers; `None` for other layouts.
    pub fn of(layout: &Layout, centre: &[f64]) -> Option<Self> {
        let dim = centre.len();
        let scale = layout.range("scale").filter(|range| range.len() == 1).map(|range| range.start);
        let mut linear = None;
        let mut translation = None;
        let mut tangent = 0;
        for block in layout.blocks() {
            let at = layout.range(block.name)?.start;
            match (&block.kind, block.name) {
                (BlockKind::Rotation, _) if dim == 3 => linear = Some(Linear::Matrix { at, scale }),
                (BlockKind::Angle, _) if dim == 2 => linear = Some(Linear::Angle { at, scale }),
                (BlockKind::Vector(n), "matrix") if *n == dim * dim => {
                    linear = Some(Linear::Matrix { at, scale: None })
                }
                (BlockKind::Vector(n), "translation") if *n == dim => translation = Some((at, tangent)),
                (BlockKind::Vector(1), "scale") => {}
                _ => return None,
            }
            tangent += block.kind.manifold().tangent();
        }
        let (ambient, tangent) = translation?;
        let inner: Arc<dyn Manifold> = Arc::new(layout.manifold().clone());
        Some(Self { inner, linear: linear?, centre: centre.to_vec(), ambient, tangent })
    }

    /// A c.
    fn turned<S: Scalar>(&self, theta: &[S]) -> Vec<S> {
        let dim = self.centre.len();
        let (row, scale): (Box<dyn Fn(usize, usize) -> S + '_>, _) = match self.linear {
            Linear::Matrix { at, scale } => (Box::new(move |i, k| theta[at + dim * i + k]), scale),
            Linear::Angle { at, scale } => {
                let (sin, cos) = theta[at].sin_cos();
                (
                    Box::new(move |i, k| {
                        if i == k {
                            cos
                        } else if i == 0 {
                            -sin
                        } else {
                            sin
                        }
                    }),
                    scale,
                )
            }
        };
        (0..dim)
            .map(|i| {
                let mut sum = row(i, 0) * self.centre[0];
                for k in 1..dim {
                    sum = sum + row(i, k) * self.centre[k];
                }
                scale.map_or(sum, |at| sum * theta[at])
            })
            .collect()
    }

    /// Return the derivative of the layout's own tangent coordinates by these (tangent x tangent, row by row): a covariance C here is M C
    /// M' there.
    pub fn to_own(&self, theta: &[f64]) -> Vec<f64> {
        let (n, m) = (self.ambient(), self.tangent());
        let mut basis = vec![0.0; n * m];
        self.basis(&theta[..n], &mut basis);
        let mut own: Vec<f64> = (0..m * m).map(|at| f64::from(u8::from(at / m == at % m))).collect();
        for d in 0..self.centre.len() {
            let (row, from) = (self.tangent + d, self.ambient + d);
            own[row * m..(row + 1) * m].copy_from_slice(&basis[from * m..(from + 1) * m]);
        }
        own
    }
}

impl Manifold for Centred {
    fn ambient(&self) -> usize {
        self.inner.ambient()
    }

    fn tangent(&self) -> usize {
        self.inner.tangent()
    }

    fn retract(&self, theta: &[f64], step: &[f64], out: &mut [f64]) {
        self.inner.retract(theta, step, out);
        let (before, after) = (self.turned(theta), self.turned(out));
        (0..self.centre.len()).for_each(|d| out[self.ambient + d] += before[d] - after[d]);
    }

    fn local(&self, from: &[f64], to: &[f64], step: &mut [f64]) {
        self.inner.local(from, to, step);
        let (before, after) = (self.turned(from), self.turned(to));
        (0..self.centre.len()).for_each(|d| step[self.tangent + d] += after[d] - before[d]);
    }

    fn lift2(&self, theta: &[f64], step: &[HyperDual64], out: &mut [HyperDual64]) {
        self.inner.lift2(theta, step, out);
        let (before, after) = (self.turned(theta), self.turned(&out[..self.ambient()]));
        for d in 0..self.centre.len() {
            out[self.ambient + d] = out[self.ambient + d] - after[d] + before[d];
        }
    }

    fn extent(&self, theta: &[f64], out: &mut [f64]) {
        self.inner.extent(theta, out);
        // The place of the image of the centre, not the translation of the origin.
        let image = self.turned(theta);
        for d in 0..self.centre.len() {
            out[self.tangent + d] = (theta[self.ambient + d] + image[d]).abs();
        }
    }

    fn project(&self, theta: &mut [f64]) {
        self.inner.project(theta);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use cfpose_optim::manifold::{basis_by_lift, rotation_exp};

    #[test]
    fn a_turn_leaves_the_centre_where_it_is() {
        let centre = [1e3, -2e3, 5e2];
        let manifold = Centred::of(&Layout::pose3(), &centre).unwrap();
        let theta: Vec<f64> = rotation_exp(&[0.2, -0.1, 0.4]).into_iter().chain([1.0, 2.0, 3.0]).collect();
        let image = |theta: &[f64]| -> Vec<f64> {
            (0..3).map(|i| theta[9 + i] + (0..3).map(|k| theta[3 * i + k] * centre[k]).sum::<f64>()).collect()
        };
        let mut moved = vec![0.0; 12];
        manifold.retract(&theta, &[0.1, 0.2, -0.3, 0.5, 0.0, -0.25], &mut moved);
        let (before, after) = (image(&theta), image(&moved));
        for (d, shift) in [0.5, 0.0, -0.25].into_iter().enumerate() {
            assert!((after[d] - before[d] - shift).abs() < 1e-9);
        }
        // The step comes back, and the basis is the derivative of the retraction.
        let mut step = [0.0; 6];
        manifold.local(&theta, &moved, &mut step);
        assert!(step.iter().zip([0.1, 0.2, -0.3, 0.5, 0.0, -0.25]).all(|(a, b)| (a - b).abs() < 1e-9));
        let mut basis = vec![0.0; 72];
        basis_by_lift(&manifold, &theta, &mut basis);
        for j in 0..6 {
            let mut small = [0.0; 6];
            small[j] = 1e-6;
            let (mut plus, mut minus) = (vec![0.0; 12], vec![0.0; 12]);
            manifold.retract(&theta, &small, &mut plus);
            small[j] = -1e-6;
            manifold.retract(&theta, &small, &mut minus);
            for i in 0..12 {
                assert!(((plus[i] - minus[i]) / 2e-6 - basis[i * 6 + j]).abs() < 1e-3, "{i} {j}");
            }
        }
    }
}
