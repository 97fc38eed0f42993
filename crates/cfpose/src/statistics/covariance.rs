//! The statistics of moment matching: covariance of the feature means, J statistic, covariance of theta (docs/method.md,
//! *Means have statistics*).

use cfpose_kernel::family::BasisBlock;
use cfpose_kernel::isa::Isa;
use cfpose_kernel::map::{MapBlock, Row};
use cfpose_kernel::points::{BLOCK, Points, PointsError};
use cfpose_optim::covariance::covariance as parameter_covariance;
use cfpose_optim::problem::LeastSquares;
use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, Par};
use rand::RngExt;
use rand_chacha::ChaCha12Rng;
use rand_distr::StandardNormal;
use serde::{Deserialize, Serialize};
use statrs::function::gamma::checked_gamma_ur;

use crate::problem::MomentProblem;
use crate::streams::stream;

/// Points that the covariance of the features is estimated from, at most: it is needed to a few percent.
const MAX_SAMPLES: usize = 2048;

/// Relative singular value of the whitened Jacobian below which a direction counts as undetermined.
const RANK_TOLERANCE: f64 = 1e-9;

/// Where the randomness of the residual comes from.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Randomness {
    /// Noise of the target in the feature space, not normalised: the covariance, 3 x 3.
    pub noise: [[f64; 3]; 3],
    /// kappa: variance of the difference of the two sampled means, in units of the features' variance over the model points.
    pub kappa: f64,
    /// Number of target points that carry noise.
    pub num_target: f64,
}

/// Covariance S of the residual (features x features, row by row) at ambient theta:
/// S = S_noise / N + kappa * Cov(f over the model points).
///
/// Each model point is drawn twice with independent noise: half the mean square difference estimates the noise term for
/// any family, the rest of the covariance is the sampling term. At most 2048 points are drawn; the finite sample would make
/// the inverse too large by (n - 1) / (n - L - 2) (Hartlap, Simon and Schneider 2007), which is divided out.
///
/// # Errors
/// [`PointsError`] when a mapped point is not finite.
pub fn feature_covariance(
    problem: &MomentProblem,
    theta: &[f64],
    randomness: &Randomness,
    seed: u64,
) -> Result<Vec<f64>, PointsError> {
    let points = problem.mapped_source(theta)?;
    let mut rng = stream(seed, "covariance");
    let chosen = sample(&points, &mut rng)?;
    // Few points are drawn several times, so that the noise term has its own sample size.
    let repeats = (MAX_SAMPLES / 2 / chosen.len()).clamp(1, 64);
    let root = cholesky3(&randomness.noise, chosen.dim());
    let (mut first, mut second) = (Vec::new(), Vec::new());
    for _ in 0..repeats {
        first.extend(noisy(&chosen, &root, &mut rng));
        second.extend(noisy(&chosen, &root, &mut rng));
    }
    let weights: Vec<f64> = chosen.weights().iter().copied().cycle().take(first.len()).collect();
    let total: f64 = weights.iter().sum();
    let isa = problem.isa();
    let (a, b) = (features(problem, isa, &first), features(problem, isa, &second));
    let num_features = problem.num_features();
    let mut difference = Mat::from_fn(first.len(), num_features, |k, i| {
        (weights[k] / total).sqrt() * (a[k * num_features + i] - b[k * num_features + i])
    });
    let noise_term = gram(&difference, 0.5);
    let mut means = vec![0.0; num_features];
    for (k, row) in a.chunks_exact(num_features).enumerate() {
        means.iter_mut().zip(row).for_each(|(mean, value)| *mean += weights[k] / total * value);
    }
    for k in 0..first.len() {
        for i in 0..num_features {
            difference[(k, i)] = (weights[k] / total).sqrt() * (a[k * num_features + i] - means[i]);
        }
    }
    let spread = gram(&difference, 1.0);
    let debias = |count: usize| {
        let count = count as f64;
        ((count - 1.0) / (count - num_features as f64 - 2.0).max(1.0)).clamp(1.0, 4.0)
    };
    // Draws of the noise are independent; a point that is drawn again is the same point.
    let (noise_debias, spread_debias) = (debias(first.len()), debias(chosen.len()));
    let entry = |i: usize, j: usize| {
        let noise = noise_term[(i, j)];
        let sampling = randomness.kappa * spread_debias * (spread[(i, j)] - noise);
        noise_debias * noise / randomness.num_target + sampling
    };
    Ok((0..num_features * num_features).map(|at| entry(at / num_features, at % num_features)).collect())
}

/// Choose at most [`MAX_SAMPLES`] points: evenly along a curve, else at random.
fn sample(points: &Points, rng: &mut ChaCha12Rng) -> Result<Points, PointsError> {
    crate::distances::sampling::thin(points, MAX_SAMPLES, rng)
}

/// Return `scale` A'A.
fn gram(a: &Mat<f64>, scale: f64) -> Mat<f64> {
    let mut product = Mat::zeros(a.ncols(), a.ncols());
    matmul(&mut product, Accum::Replace, a.transpose(), a, scale, Par::Seq);
    product
}

/// Return the lower Cholesky factor of a positive semi-definite covariance; negative pivots count as 0.
fn cholesky3(covariance: &[[f64; 3]; 3], dim: usize) -> [[f64; 3]; 3] {
    let mut root = [[0.0; 3]; 3];
    for i in 0..dim {
        for j in 0..=i {
            let sum: f64 = (0..j).map(|k| root[i][k] * root[j][k]).sum();
            let rest = covariance[i][j] - sum;
            root[i][j] = if i == j {
                rest.max(0.0).sqrt()
            } else if root[j][j] > 0.0 {
                rest / root[j][j]
            } else {
                0.0
            };
        }
    }
    root
}

/// Return the points with noise added.
fn noisy(points: &Points, root: &[[f64; 3]; 3], rng: &mut ChaCha12Rng) -> Vec<[f64; 3]> {
    let dim = points.dim();
    let draw = |k: usize| {
        let mut x = points.point(k);
        let normal: [f64; 3] = std::array::from_fn(|d| if d < dim { rng.sample(StandardNormal) } else { 0.0 });
        for i in 0..dim {
            x[i] += (0..=i).map(|j| root[i][j] * normal[j]).sum::<f64>();
        }
        x
    };
    (0..points.len()).map(draw).collect()
}

/// Return all features of all points (points x features, row by row); points in the feature space, not normalised.
pub(crate) fn features(problem: &MomentProblem, isa: Isa, points: &[[f64; 3]]) -> Vec<f64> {
    let (family, dim) = (problem.family(), problem.model().dim());
    let (num_basis, num_features) = (family.num_basis(dim), problem.num_features());
    let mut out = vec![0.0; points.len() * num_features];
    let mut block = MapBlock::new(dim, 0);
    let mut basis = BasisBlock::new(family, dim, false);
    let mut column = Vec::with_capacity(num_features);
    let mut values = vec![0.0; num_basis];
    for (part, rows) in points.chunks(BLOCK).zip(out.chunks_mut(BLOCK * num_features)) {
        for q in 0..dim {
            block.x[q] = Row::ZERO;
        }
        for k in 0..BLOCK {
            let x = problem.transform().apply(part[k.min(part.len() - 1)]);
            for q in 0..dim {
                block.x[q].0[k] = x[q];
            }
        }
        family.block(isa, &block, basis.rows());
        for (k, row) in rows.chunks_exact_mut(num_features).enumerate() {
            for (value, column) in values.iter_mut().zip(&basis.value) {
                *value = column.0[k];
            }
            column.clear();
            problem.to_features(isa, &values, 1, &mut column);
            row.copy_from_slice(&column);
        }
    }
    out
}

/// What the statistics say about a fit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Statistics {
    /// Covariance of the model's free tangent coordinates, row by row; nuisance parameters are marginalised.
    pub covariance: Vec<f64>,
    /// The same for turns about the middle of the source and shifts of its image, for models with a linear part and a translation:
    /// far from the origin the covariance of theta itself is nearly singular.
    pub covariance_at_centroid: Option<Vec<f64>>,
    /// J = r' S^-1 r.
    pub j_statistic: f64,
    /// sum of value / (value + ridge) over the eigenvalues of S, rounded, minus rank(Jacobian): rank(S) - rank(Jacobian) without a ridge.
    pub degrees_of_freedom: usize,
    /// Probability of a larger J where the model holds.
    pub p_value: f64,
    /// Standard deviation of the target's noise in one coordinate, units of the feature space; where it is modelled.
    pub noise_sigma: Option<f64>,
    /// kappa, the weight of the sampling covariance.
    pub kappa: f64,
}

impl Statistics {
    /// Return J divided by its degrees of freedom, 0 without any.
    pub fn reduced(&self) -> f64 {
        if self.degrees_of_freedom == 0 { 0.0 } else { self.j_statistic / self.degrees_of_freedom as f64 }
    }
}

/// Evaluate the statistics of a whitened problem at theta (ambient, nuisance parameters included); `own` is the number of
/// tangent columns that are the model's.
pub(crate) fn of_whitened(problem: &MomentProblem, theta: &[f64], own: usize) -> Option<Statistics> {
    let (rows, cols) = (problem.num_residuals(), problem.manifold().tangent());
    let (mut residual, mut jacobian) = (vec![0.0; rows], vec![0.0; rows * cols]);
    problem.jacobian(theta, &mut residual, &mut jacobian);
    let report = parameter_covariance(rows, cols, &jacobian, 1.0, RANK_TOLERANCE)?;
    let mut covariance = Vec::with_capacity(own * own);
    for j in 0..own {
        covariance.extend_from_slice(&report.matrix[j * cols..j * cols + own]);
    }
    let j_statistic = residual.iter().map(|r| r * r).sum();
    // Directions that the ridge damps count by what is left of their variance.
    let degrees_of_freedom = (problem.effective_rows() - report.rank as f64).round().max(0.0) as usize;
    Some(Statistics {
        covariance,
        covariance_at_centroid: None,
        j_statistic,
        degrees_of_freedom,
        p_value: chi_square_tail(j_statistic, degrees_of_freedom),
        noise_sigma: None,
        kappa: 0.0,
    })
}

/// Return the standard deviation of tangent coordinate `j` of a whitened problem at theta.
pub(crate) fn deviation(problem: &MomentProblem, theta: &[f64], j: usize) -> Option<f64> {
    deviation_of(problem, theta, j, &[1.0])
}

/// Return the standard deviation of a weighted sum of the tangent coordinates from `first` on, of a whitened problem at theta.
pub(crate) fn deviation_of(problem: &MomentProblem, theta: &[f64], first: usize, weights: &[f64]) -> Option<f64> {
    let (rows, cols) = (problem.num_residuals(), problem.manifold().tangent());
    let (mut residual, mut jacobian) = (vec![0.0; rows], vec![0.0; rows * cols]);
    problem.jacobian(theta, &mut residual, &mut jacobian);
    let report = parameter_covariance(rows, cols, &jacobian, 1.0, RANK_TOLERANCE)?;
    if let [_] = weights {
        return report.deviations().get(first).copied();
    }
    let entry = |a: usize, b: usize| weights[a] * report.matrix[(first + a) * cols + first + b] * weights[b];
    let variance: f64 = (0..weights.len()).flat_map(|a| (0..weights.len()).map(move |b| entry(a, b))).sum();
    (variance >= 0.0).then(|| variance.sqrt())
}

/// Return the probability that a chi-square variable with so many degrees of freedom exceeds `value`; 1 without any.
///
/// ```
/// use cfpose::statistics::chi_square_tail;
/// assert!((chi_square_tail(3.841_458_820_694_124, 1) - 0.05).abs() < 1e-9);
/// assert_eq!(chi_square_tail(5.0, 0), 1.0);
/// ```
pub fn chi_square_tail(value: f64, degrees_of_freedom: usize) -> f64 {
    if degrees_of_freedom == 0 || value.is_nan() || value <= 0.0 {
        return 1.0;
    }
    if value.is_infinite() {
        return 0.0;
    }
    checked_gamma_ur(0.5 * degrees_of_freedom as f64, 0.5 * value).unwrap_or(0.0).clamp(0.0, 1.0)
}
