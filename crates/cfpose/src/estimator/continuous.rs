//! The continuously updated problem: the weighting is a function of theta.

use cfpose_optim::manifold::Manifold;
use cfpose_optim::problem::{Capabilities, LeastSquares};

use faer::{Mat, Side};

use super::Parts;
use super::stage::ReadyStage;
use crate::statistics::{Randomness, feature_covariance};

/// Step of the central differences of S along a tangent direction: S is smooth, and needed to a few digits.
const STEP: f64 = 1e-4;

/// The residual L(theta)^-1 r(theta) with S(theta) = L L' (Hansen, Heaton and Yaron 1996).
///
/// Differs from the source: dS/dtheta is taken by central differences with the random draws held fixed; everything else of
/// the Jacobian is exact, d(L^-1 r) = L^-1 (dr - dL L^-1 r), dL = L phi(L^-1 dS L^-T), phi the lower triangle with half the diagonal.
pub(super) struct Continuous<'a> {
    stage: &'a ReadyStage,
    randomness: Randomness,
    parts: &'a Parts,
}

impl<'a> Continuous<'a> {
    /// Let the weighting of a stage follow theta; `randomness` serves where the noise is not modelled.
    pub fn new(stage: &'a ReadyStage, randomness: Randomness, parts: &'a Parts) -> Self {
        Self { stage, randomness, parts }
    }

    /// Return the randomness that S is computed from at theta.
    pub fn randomness(&self, theta: &[f64]) -> Randomness {
        let noise = self.stage.noise(theta, self.parts).unwrap_or(self.randomness.noise);
        Randomness { noise, ..self.randomness }
    }

    /// Return S at theta, regularised as the weighting does it.
    fn covariance(&self, theta: &[f64]) -> Option<Mat<f64>> {
        let (randomness, seed) = (self.randomness(theta), self.parts.settings.seed);
        let s = feature_covariance(&self.stage.problem, theta, &randomness, seed).ok()?;
        let n = self.stage.problem.num_features();
        let ridge = self.stage.weighting.ridge() * (0..n).map(|i| s[i * n + i]).sum::<f64>() / n as f64;
        Some(Mat::from_fn(n, n, |i, j| s[i * n + j] + if i == j { ridge } else { 0.0 }))
    }

    /// Return the weighted residual, extra rows as they are, and where wanted its Jacobian.
    fn evaluate(&self, theta: &[f64], derivatives: bool) -> Option<(Vec<f64>, Vec<f64>)> {
        let (residual, jacobian) = self.stage.problem.unweighted(theta, derivatives);
        let (n, m) = (self.stage.problem.num_features(), if derivatives { self.manifold().tangent() } else { 0 });
        let factor = self.covariance(theta)?.llt(Side::Lower).ok()?;
        let lower = factor.L().to_owned();
        let forward = |rhs: &Mat<f64>| {
            let mut x = rhs.clone();
            faer::linalg::triangular_solve::solve_lower_triangular_in_place(lower.as_ref(), x.as_mut(), faer::Par::Seq);
            x
        };
        let white = forward(&Mat::from_fn(n, 1, |i, _| residual[i]));
        let mut slopes = forward(&Mat::from_fn(n, m, |i, j| jacobian[i * m + j]));
        let mut moved = vec![0.0; theta.len()];
        for j in 0..m {
            let mut at = |sign: f64| {
                let mut step = vec![0.0; m];
                step[j] =
                    sign * STEP * if j >= self.stage.own_tangent() { theta[theta.len() - m + j].abs() } else { 1.0 };
                self.manifold().retract(theta, &step, &mut moved);
                (self.covariance(&moved), step[j])
            };
            let ((Some(plus), h), (Some(minus), _)) = (at(1.0), at(-1.0)) else { return None };
            if h == 0.0 {
                continue;
            }
            let difference = Mat::from_fn(n, n, |i, k| (plus[(i, k)] - minus[(i, k)]) / (2.0 * h));
            // L^-1 dS L^-T
            let half = forward(&difference);
            let inner = forward(&half.transpose().to_owned());
            for i in 0..n {
                let row: f64 = (0..i).map(|k| inner[(i, k)] * white[(k, 0)]).sum();
                slopes[(i, j)] -= row + 0.5 * inner[(i, i)] * white[(i, 0)];
            }
        }
        let values = (0..n).map(|i| white[(i, 0)]).chain(residual[n..].iter().copied()).collect();
        let flat = (0..n * m).map(|at| slopes[(at / m, at % m)]).chain(jacobian[n * m..].iter().copied()).collect();
        Some((values, flat))
    }
}

impl LeastSquares for Continuous<'_> {
    fn manifold(&self) -> &dyn Manifold {
        self.stage.problem.manifold()
    }

    fn num_residuals(&self) -> usize {
        self.stage.problem.num_unweighted()
    }

    fn residual(&self, theta: &[f64], residual: &mut [f64]) {
        match self.evaluate(theta, false) {
            Some((values, _)) => residual.copy_from_slice(&values),
            None => residual.fill(f64::NAN),
        }
    }

    fn jacobian(&self, theta: &[f64], residual: &mut [f64], jacobian: &mut [f64]) {
        match self.evaluate(theta, true) {
            Some((values, slopes)) => {
                residual.copy_from_slice(&values);
                jacobian.copy_from_slice(&slopes);
            }
            None => {
                residual.fill(f64::NAN);
                jacobian.fill(f64::NAN);
            }
        }
    }

    fn capabilities(&self) -> Capabilities {
        Capabilities { jacobian: true, curvature: false }
    }
}
