//! Robust losses for any problem and any solver.

use num_dual::{Dual2_64, DualNum};

use crate::constraint::{Bounds, Constraints};
use crate::manifold::Manifold;
use crate::problem::{Capabilities, LeastSquares};

/// A loss rho(s) of a squared residual norm s, with rho(s) = s near 0; the cost is `1/2 * sum rho(s_b)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum RobustLoss {
    /// s up to `scale^2`, then `2 scale sqrt(s) - scale^2`. Source: Huber 1964.
    Huber {
        /// Residual norm at which the loss turns linear, > 0.
        scale: f64,
    },
    /// `scale^2 log(1 + s / scale^2)`.
    Cauchy {
        /// Residual norm at which an observation has half its weight, > 0.
        scale: f64,
    },
    /// `s / (1 + s / scale^2)`, at most `scale^2`. Source: Geman and McClure 1985.
    GemanMcClure {
        /// Residual norm at which half of the largest loss is reached, > 0.
        scale: f64,
    },
    /// s up to `scale^2`, constant beyond.
    Truncated {
        /// Residual norm beyond which an observation does not count, > 0.
        scale: f64,
    },
}

impl RobustLoss {
    /// Return rho(s).
    ///
    /// ```
    /// use cfpose_optim::robust::RobustLoss;
    /// assert_eq!(RobustLoss::Huber { scale: 1.0 }.value(9.0), 5.0);
    /// assert_eq!(RobustLoss::Truncated { scale: 2.0 }.value(9.0), 4.0);
    /// ```
    pub fn value(self, s: f64) -> f64 {
        self.share(s) * s
    }

    /// Return rho(s) / s, the square of the factor by which a residual is scaled.
    fn share<T: DualNum<Primitive = f64> + Copy>(self, s: T) -> T {
        match self {
            RobustLoss::Huber { scale } if s.re() > scale * scale => (s.sqrt() * (2.0 * scale) - scale * scale) / s,
            RobustLoss::Huber { .. } => T::from(1.0),
            RobustLoss::Cauchy { scale } => {
                let u = s / (scale * scale);
                // log(1 + u) / u by its series near 0.
                if u.re() < 1e-4 { u * (u * (u * -0.25 + 1.0 / 3.0) - 0.5) + 1.0 } else { u.ln_1p() / u }
            }
            RobustLoss::GemanMcClure { scale } => (s / (scale * scale) + 1.0).recip(),
            RobustLoss::Truncated { scale } if s.re() > scale * scale => s.recip() * (scale * scale),
            RobustLoss::Truncated { .. } => T::from(1.0),
        }
    }

    /// Return the factor a(s) = sqrt(rho(s) / s) with its first and second derivative.
    fn factor(self, s: f64) -> (f64, f64, f64) {
        let a = self.share(Dual2_64::new(s, 1.0, 0.0)).sqrt();
        (a.re, a.v1, a.v2)
    }
}

/// A problem under a robust loss: residual blocks r_b of equal length become `sqrt(rho(s_b) / s_b) r_b` with
/// `s_b = norm(r_b)^2`.
///
/// Half of the squared norm of the new residual *is* the robust cost, so every solver's acceptance and stopping tests are
/// those of the robust problem; nothing is reweighted behind a solver's back.
///
/// *Degenerate when* all blocks lie beyond the scale of a redescending loss: the gradient is then almost 0 (0 for
/// `Truncated`), and any point looks like a minimum. Start near, or shrink the scale in steps.
///
/// ```
/// use cfpose_optim::robust::{Robust, RobustLoss};
/// use cfpose_optim::testproblems::pose::Alignment;
/// use cfpose_optim::{Control, solvers};
/// let mut points = Alignment::simulate(30, 0.5, 0.01, 4);
/// let truth = points.closed_form().unwrap();
/// points.target[7] = [9.0, -9.0, 9.0]; // one gross outlier
/// let spoilt = points.closed_form().unwrap();
/// let problem = points.problem();
/// let robust = Robust::new(&problem, RobustLoss::Cauchy { scale: 0.05 }, 3);
/// let solver = solvers::build("levenberg-marquardt").unwrap();
/// let outcome = solver.solve(&robust, &spoilt, &mut Control::default()).unwrap();
/// let far = |a: &[f64]| a.iter().zip(&truth).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max);
/// assert!(far(&outcome.theta) < 0.01 && far(&spoilt) > 0.1);
/// ```
pub struct Robust<'p> {
    inner: &'p dyn LeastSquares,
    loss: RobustLoss,
    block: usize,
}

impl<'p> Robust<'p> {
    /// Put a problem under a loss of blocks of `block` consecutive residuals (1: each by itself; a last block may be short).
    pub fn new(inner: &'p dyn LeastSquares, loss: RobustLoss, block: usize) -> Self {
        Self { inner, loss, block: block.max(1) }
    }

    /// Return the factors a, a', a'' of a block.
    fn block_factor(&self, block: &[f64]) -> (f64, f64, f64) {
        self.loss.factor(block.iter().map(|r| r * r).sum())
    }

    fn scale(&self, residual: &mut [f64]) {
        for block in residual.chunks_mut(self.block) {
            let (a, _, _) = self.block_factor(block);
            block.iter_mut().for_each(|r| *r *= a);
        }
    }
}

impl LeastSquares for Robust<'_> {
    fn manifold(&self) -> &dyn Manifold {
        self.inner.manifold()
    }
    fn num_residuals(&self) -> usize {
        self.inner.num_residuals()
    }
    fn residual(&self, theta: &[f64], residual: &mut [f64]) {
        self.inner.residual(theta, residual);
        self.scale(residual);
    }
    fn jacobian(&self, theta: &[f64], residual: &mut [f64], jacobian: &mut [f64]) {
        self.inner.jacobian(theta, residual, jacobian);
        let m = self.manifold().tangent();
        let mut along = vec![0.0; m];
        for (block, rows) in residual.chunks(self.block).zip(jacobian.chunks_mut(self.block * m.max(1))) {
            let (a, slope, _) = self.block_factor(block);
            // d (a r) = a dr + a' ds r with ds = 2 r'dr.
            along.fill(0.0);
            for (row, r) in rows.chunks_exact(m.max(1)).zip(block) {
                along.iter_mut().zip(row).for_each(|(s, d)| *s += 2.0 * r * d);
            }
            for (row, r) in rows.chunks_exact_mut(m.max(1)).zip(block) {
                row.iter_mut().zip(&along).for_each(|(d, s)| *d = a * *d + slope * r * s);
            }
        }
        self.scale(residual);
    }
    fn curvature(&self, theta: &[f64], weights: &[f64], hessian: &mut [f64]) {
        let (rows, m) = (self.num_residuals(), self.manifold().tangent());
        let (mut residual, mut jacobian) = (vec![0.0; rows], vec![0.0; rows * m]);
        self.inner.jacobian(theta, &mut residual, &mut jacobian);
        let mut inner_weights = vec![0.0; rows];
        let mut first_order = vec![0.0; m * m];
        for (b, block) in residual.chunks(self.block).enumerate() {
            let range = b * self.block..b * self.block + block.len();
            let (a, slope, bend) = self.block_factor(block);
            let w = &weights[range.clone()];
            let dot: f64 = w.iter().zip(block).map(|(w, r)| w * r).sum();
            let (mut ds, mut dw) = (vec![0.0; m], vec![0.0; m]);
            for (k, i) in range.clone().enumerate() {
                let row = &jacobian[i * m..(i + 1) * m];
                inner_weights[i] = a * w[k] + 2.0 * slope * dot * block[k];
                for j in 0..m {
                    ds[j] += 2.0 * block[k] * row[j];
                    dw[j] += w[k] * row[j];
                }
            }
            for j in 0..m {
                for l in 0..m {
                    // w'Hess(a r) = .. + a' (ds dw' + dw ds') + (w'r) (a'' ds ds' + 2 a' J'J)
                    let squares: f64 = range.clone().map(|i| jacobian[i * m + j] * jacobian[i * m + l]).sum();
                    first_order[j * m + l] +=
                        slope * (ds[j] * dw[l] + dw[j] * ds[l]) + dot * (bend * ds[j] * ds[l] + 2.0 * slope * squares);
                }
            }
        }
        self.inner.curvature(theta, &inner_weights, hessian);
        hessian.iter_mut().zip(&first_order).for_each(|(h, f)| *h += f);
    }
    fn capabilities(&self) -> Capabilities {
        self.inner.capabilities()
    }
    fn bounds(&self) -> Option<&Bounds> {
        self.inner.bounds()
    }
    fn constraints(&self) -> Option<&dyn Constraints> {
        self.inner.constraints()
    }
}
