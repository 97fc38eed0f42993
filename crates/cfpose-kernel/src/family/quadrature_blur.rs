//! A blur for families that have no closed form: Gauss-Hermite quadrature over shifted points.

use std::sync::Arc;

use gauss_quad::GaussHermite;
use num_dual::HyperDual64;

use super::{BasisRows, DynFamily, Segment};
use crate::isa::Isa;
use crate::map::MapBlock;

/// Any family with a blur by quadrature.
///
/// A mean alone does not know the mean of blurred functions, but the means over *shifted* points do: with nodes t_j,
/// E f(x + e) = sum_j w_j f(x + t_j). So the basis is evaluated at n^dim shifts of every point (its own place first, then the
/// others), and the blur is a sum over the shifts. The nodes are those of Gauss-Hermite quadrature for noise of standard
/// deviation `spread` and do not move; the weights w_j(covariance) = E[l_j(e)], l_j the Lagrange polynomials of the nodes, are
/// polynomials in the covariance. They are the Gauss-Hermite weights for noise of just that spread, and smooth for any other,
/// a negative variance included, which estimating the noise needs.
///
/// Cost: n^dim times the family (25 times in the plane with 5 nodes). Exact where f is a polynomial of degree below n in each
/// coordinate; else accurate while noise is not much larger than `spread` and f is smooth over that range.
pub struct QuadratureBlur {
    inner: Arc<dyn DynFamily>,
    /// Nodes of one coordinate, 0 first.
    nodes: Vec<f64>,
    /// `lagrange[j][a]`: coefficient of (e / spread)^a in l_j.
    lagrange: Vec<Vec<f64>>,
    spread: f64,
}

impl QuadratureBlur {
    /// Add a blur with an odd number of nodes per coordinate (at least 3; an even number is raised by one) that is best for
    /// noise of standard deviation `spread` (units of the feature space).
    pub fn new(inner: Arc<dyn DynFamily>, nodes: usize, spread: f64) -> Self {
        let count = std::num::NonZeroUsize::new(nodes.max(3) | 1).unwrap_or(std::num::NonZeroUsize::MIN);
        let rule = GaussHermite::new(count);
        // exp(-t^2) has variance 1/2.
        let mut unit: Vec<f64> = rule.iter().map(|(t, _)| t * 2.0_f64.sqrt()).collect();
        unit.sort_by(|a, b| a.abs().total_cmp(&b.abs()).then(a.total_cmp(b)));
        unit[0] = 0.0;
        let lagrange = (0..unit.len())
            .map(|j| {
                let mut polynomial = vec![1.0];
                for (i, node) in unit.iter().enumerate().filter(|(i, _)| *i != j) {
                    let scale = (unit[j] - unit[i]).recip();
                    let mut next = vec![0.0; polynomial.len() + 1];
                    for (a, value) in polynomial.iter().enumerate() {
                        next[a + 1] += value * scale;
                        next[a] -= value * node * scale;
                    }
                    polynomial = next;
                }
                polynomial
            })
            .collect();
        Self { inner, nodes: unit.iter().map(|t| t * spread).collect(), lagrange, spread }
    }

    fn num_shifts(&self, dim: usize) -> usize {
        self.nodes.len().pow(dim as u32)
    }

    /// Return node index of coordinate q in shift `index`; shift 0 has node 0 everywhere.
    fn digit(&self, index: usize, q: usize) -> usize {
        (index / self.nodes.len().pow(q as u32)) % self.nodes.len()
    }

    /// Return w_j(covariance) of all shifts.
    fn weights(&self, dim: usize, covariance: &[HyperDual64]) -> Vec<HyperDual64> {
        let n = self.nodes.len();
        let moments = self.moments(dim, covariance);
        (0..self.num_shifts(dim))
            .map(|shift| {
                let mut sum = HyperDual64::from(0.0);
                for (index, moment) in moments.iter().enumerate() {
                    let product: f64 =
                        (0..dim).map(|q| self.lagrange[self.digit(shift, q)][(index / n.pow(q as u32)) % n]).product();
                    sum += *moment * product;
                }
                sum
            })
            .collect()
    }

    /// Return E prod_q (e_q / spread)^(a_q) for all exponents below n, by Isserlis' recursion
    /// E[t_q t^b] = sum_p S_qp b_p E[t^(b - e_p)].
    fn moments(&self, dim: usize, covariance: &[HyperDual64]) -> Vec<HyperDual64> {
        let n = self.nodes.len();
        let zero = HyperDual64::from(0.0);
        let mut s = vec![vec![zero; dim]; dim];
        let mut entry = 0;
        for a in 0..dim {
            for b in a..dim {
                s[a][b] = covariance[entry] * (self.spread * self.spread).recip();
                s[b][a] = s[a][b];
                entry += 1;
            }
        }
        let place = |exponent: &[usize]| (0..dim).map(|q| exponent[q] * n.pow(q as u32)).sum::<usize>();
        let mut moments = vec![zero; n.pow(dim as u32)];
        moments[0] = HyperDual64::from(1.0);
        // Removing two powers lowers the index, so every moment comes after those it needs.
        for index in 1..moments.len() {
            let mut rest: Vec<usize> = (0..dim).map(|q| (index / n.pow(q as u32)) % n).collect();
            let Some(q) = rest.iter().position(|e| *e > 0) else { continue };
            rest[q] -= 1;
            let mut sum = zero;
            for p in 0..dim {
                if rest[p] > 0 {
                    let mut lower = rest.clone();
                    lower[p] -= 1;
                    sum += s[q][p] * moments[place(&lower)] * rest[p] as f64;
                }
            }
            moments[index] = sum;
        }
        moments
    }
}

impl DynFamily for QuadratureBlur {
    fn supports(&self, dim: usize) -> bool {
        self.inner.supports(dim)
    }

    fn num_basis(&self, dim: usize) -> usize {
        self.num_shifts(dim) * self.inner.num_basis(dim)
    }

    fn per_coordinate(&self) -> Option<usize> {
        None
    }

    fn segments(&self, dim: usize) -> Vec<Segment> {
        self.inner.segments(dim).repeat(self.num_shifts(dim))
    }

    /// Features are those of the first shift, the point's own place; the blur puts its result there.
    fn coefficients(&self, dim: usize) -> Option<Vec<f64>> {
        let (num, width) = (self.inner.num_basis(dim), self.num_basis(dim));
        let inner = self.inner.coefficients(dim);
        let rows = inner.as_ref().map_or(num, |c| c.len() / num);
        let mut full = vec![0.0; rows * width];
        for i in 0..rows {
            match &inner {
                None => full[i * width + i] = 1.0,
                Some(c) => full[i * width..i * width + num].copy_from_slice(&c[i * num..(i + 1) * num]),
            }
        }
        Some(full)
    }

    fn block(&self, isa: Isa, points: &MapBlock, out: BasisRows<'_>) {
        let dim = points.x.len();
        let mut shifted = MapBlock::new(dim, 0);
        let mut rest = out;
        for shift in 0..self.num_shifts(dim) {
            for q in 0..dim {
                let by = self.nodes[self.digit(shift, q)];
                for (moved, x) in shifted.x[q].0.iter_mut().zip(&points.x[q].0) {
                    *moved = x + by;
                }
            }
            let (own, others) = rest.split(self.inner.as_ref(), dim);
            self.inner.block(isa, &shifted, own);
            rest = others;
        }
    }

    fn values(&self, x: &[f64], out: &mut [f64]) {
        for (shift, part) in out.chunks_exact_mut(self.inner.num_basis(x.len())).enumerate() {
            let moved: Vec<f64> =
                x.iter().enumerate().map(|(q, value)| value + self.nodes[self.digit(shift, q)]).collect();
            self.inner.values(&moved, part);
        }
    }

    fn hyper(&self, x: &[HyperDual64], out: &mut [HyperDual64]) {
        for (shift, part) in out.chunks_exact_mut(self.inner.num_basis(x.len())).enumerate() {
            let moved: Vec<HyperDual64> =
                x.iter().enumerate().map(|(q, value)| *value + self.nodes[self.digit(shift, q)]).collect();
            self.inner.hyper(&moved, part);
        }
    }

    fn blur_hyper(&self, dim: usize, covariance: &[HyperDual64], means: &mut [HyperDual64]) -> bool {
        let num = self.inner.num_basis(dim);
        let weights = self.weights(dim, covariance);
        for i in 0..num {
            let sum = weights
                .iter()
                .enumerate()
                .fold(HyperDual64::from(0.0), |sum, (shift, weight)| sum + *weight * means[shift * num + i]);
            means[i] = sum;
        }
        true
    }
}
