//! Products of manifolds.

use std::sync::Arc;

use num_dual::HyperDual64;

use super::Manifold;

/// The product of manifolds: ambient and tangent coordinates one after the other.
///
/// ```
/// use std::sync::Arc;
/// use cfpose_optim::manifold::{Euclidean, Manifold, Product, Rotation3};
/// let pose = Product::new(vec![Arc::new(Rotation3), Arc::new(Euclidean(3))]);
/// assert_eq!((pose.ambient(), pose.tangent()), (12, 6));
/// ```
#[derive(Debug, Clone)]
pub struct Product {
    factors: Vec<Arc<dyn Manifold>>,
}

/// Ambient and tangent ranges of one factor.
struct Part<'a> {
    factor: &'a dyn Manifold,
    ambient: std::ops::Range<usize>,
    tangent: std::ops::Range<usize>,
}

impl Product {
    /// Join manifolds in order.
    pub fn new(factors: Vec<Arc<dyn Manifold>>) -> Self {
        Self { factors }
    }

    /// Return the factors.
    pub fn factors(&self) -> &[Arc<dyn Manifold>] {
        &self.factors
    }

    fn parts(&self) -> impl Iterator<Item = Part<'_>> {
        self.factors.iter().scan((0, 0), |(a, t), factor| {
            let part = Part {
                factor: factor.as_ref(),
                ambient: *a..*a + factor.ambient(),
                tangent: *t..*t + factor.tangent(),
            };
            *a += factor.ambient();
            *t += factor.tangent();
            Some(part)
        })
    }
}

impl Manifold for Product {
    fn ambient(&self) -> usize {
        self.factors.iter().map(|f| f.ambient()).sum()
    }
    fn tangent(&self) -> usize {
        self.factors.iter().map(|f| f.tangent()).sum()
    }
    fn retract(&self, theta: &[f64], step: &[f64], out: &mut [f64]) {
        for p in self.parts() {
            p.factor.retract(&theta[p.ambient.clone()], &step[p.tangent], &mut out[p.ambient]);
        }
    }
    fn local(&self, from: &[f64], to: &[f64], step: &mut [f64]) {
        for p in self.parts() {
            p.factor.local(&from[p.ambient.clone()], &to[p.ambient], &mut step[p.tangent]);
        }
    }
    fn lift2(&self, theta: &[f64], step: &[HyperDual64], out: &mut [HyperDual64]) {
        for p in self.parts() {
            p.factor.lift2(&theta[p.ambient.clone()], &step[p.tangent], &mut out[p.ambient]);
        }
    }
    fn basis(&self, theta: &[f64], out: &mut [f64]) {
        let m = self.tangent();
        out[..self.ambient() * m].fill(0.0);
        // Solvers ask for it at every step: a rotation's basis needs no allocation.
        let (mut small, mut large) = ([0.0; 27], Vec::new());
        for p in self.parts() {
            let width = p.tangent.len();
            let size = p.ambient.len() * width;
            let local = if size <= small.len() {
                &mut small[..size]
            } else {
                large.resize(size, 0.0);
                &mut large[..]
            };
            p.factor.basis(&theta[p.ambient.clone()], local);
            for (i, row) in p.ambient.enumerate() {
                out[row * m + p.tangent.start..row * m + p.tangent.end]
                    .copy_from_slice(&local[i * width..(i + 1) * width]);
            }
        }
    }
    fn differential(&self, theta: &[f64], step: &[f64], out: &mut [f64]) {
        let m = self.tangent();
        out[..m * m].fill(0.0);
        let mut local = Vec::new();
        for p in self.parts() {
            let width = p.tangent.len();
            local.resize(width * width, 0.0);
            p.factor.differential(&theta[p.ambient], &step[p.tangent.clone()], &mut local);
            for (i, row) in p.tangent.clone().enumerate() {
                out[row * m + p.tangent.start..row * m + p.tangent.end]
                    .copy_from_slice(&local[i * width..(i + 1) * width]);
            }
        }
    }
    fn extent(&self, theta: &[f64], out: &mut [f64]) {
        for p in self.parts() {
            p.factor.extent(&theta[p.ambient], &mut out[p.tangent]);
        }
    }
    fn project(&self, theta: &mut [f64]) {
        for p in self.parts() {
            p.factor.project(&mut theta[p.ambient]);
        }
    }
}
