//! A matrix over a family: states hold the family's means, so training touches no point.

use std::sync::Arc;

use cfpose::families::learned::{Architecture, Matrix, feature_covariance};
use cfpose::family::DynFamily;
use cfpose::{BuildContext, Points};
use cfpose_lab::rand::RngExt;
use cfpose_lab::rand_distr::StandardNormal;
use cfpose_lab::{ChaCha12Rng, Lab};
use faer::linalg::matmul::matmul;
use faer::prelude::Solve;
use faer::{Accum, Mat, MatRef, Par, Side};

use crate::config::Config;
use crate::error::LearnError;
use crate::learner::{Learner, loss_of_columns};
use crate::normal::Shape;
use crate::objective::Perturbations;
use crate::perturb::perturbed;
use crate::sample::{Sampler, Scene};
use crate::vary::Split;

/// Trials whose target points say how the features of the basis vary.
const WHITENING_TRIALS: usize = 100;
/// Points of each of them.
const WHITENING_POINTS: usize = 150;
/// Share of the largest variance below which a direction of the basis is left out.
const RANK_TOLERANCE: f64 = 1e-9;
/// States in a row that a batch takes where those of one trial share their whitening.
const TRIAL_RUN: usize = 8;
/// Size of the random part of the first matrix.
const JITTER: f64 = 0.02;

/// The features of a basis, made uncorrelated over target points, and the matrix over them.
///
/// Parameters are the entries of P, row by row, with C = P diag(1 / scale) W: W whitens the basis, `scale` is the root mean square of
/// each whitened difference of means over the first states, so that all entries of P are of one size.
pub struct LinearLearner<'a> {
    config: &'a Config,
    basis: Arc<dyn DynFamily>,
    shape: Shape,
    perturbations: Perturbations,
    /// W, whitened x basis features.
    whitening: Mat<f64>,
    scale: Vec<f64>,
}

/// One state of a linear kind.
pub struct LinearState {
    /// Whitened difference of means, derivatives, perturbations; column by column.
    columns: Vec<f64>,
    delta: Vec<f64>,
    /// Covariance of the whitened features over the target points, row by row, where features follow the target; shared by the states
    /// of a trial.
    spread: Option<Arc<Vec<f64>>>,
}

impl<'a> LinearLearner<'a> {
    /// Measure how the features of the basis vary over the target points of trials.
    ///
    /// # Errors
    /// [`LearnError`] where the basis cannot be built, or varies in no direction.
    pub fn new(
        lab: &Lab,
        config: &'a Config,
        dim: usize,
        shape: Shape,
        perturbations: Perturbations,
    ) -> Result<Self, LearnError> {
        let context = BuildContext { dim, ..BuildContext::default() };
        let basis: Arc<dyn DynFamily> = Arc::from(lab.registry.family(&config.basis, &context)?);
        let sampler = Sampler::new(lab, config, &config.basis);
        let rows = sampler.about_truth(Split::Training, WHITENING_TRIALS, 1, |scene, _, _, _| {
            let points = normalised_target(scene)?;
            let step = points.len().div_ceil(WHITENING_POINTS).max(1);
            Some((0..points.len()).step_by(step).map(|k| basis.features(&points.point(k)[..dim])).collect::<Vec<_>>())
        })?;
        let whitening = whitening(&rows.concat())?;
        if whitening.nrows() < config.features {
            return Err(LearnError::Data(format!(
                "the basis {} varies in {} directions on these data, and {} features are asked for",
                config.basis,
                whitening.nrows(),
                config.features
            )));
        }
        let scale = vec![1.0; whitening.nrows()];
        Ok(Self { config, basis, shape, perturbations, whitening, scale })
    }

    fn width(&self) -> usize {
        self.whitening.nrows()
    }

    /// Return W S W' for the covariance S of the basis over points.
    fn spread(&self, points: &Points) -> Vec<f64> {
        let (num, width) = (self.whitening.ncols(), self.width());
        let covariance = feature_covariance(self.basis.as_ref(), points);
        let covariance = Mat::from_fn(num, num, |i, j| covariance[i * num + j]);
        let product = &self.whitening * covariance * self.whitening.transpose();
        (0..width * width).map(|at| product[(at / width, at % width)]).collect()
    }

    /// Return P diag(1 / scale).
    fn scaled(&self, parameters: &[f64]) -> Mat<f64> {
        let width = self.width();
        Mat::from_fn(self.config.features, width, |i, j| parameters[i * width + j] / self.scale[j])
    }
}

/// Return the target points in the normalised feature space.
pub fn normalised_target(scene: &Scene) -> Option<Points> {
    let problem = scene.estimator.problem();
    let mapped = problem.mapped_target(&scene.truth).ok()?;
    let transform = problem.transform();
    let mut columns = vec![Vec::with_capacity(mapped.len()); mapped.dim()];
    for k in 0..mapped.len() {
        columns.iter_mut().zip(transform.apply(mapped.point(k))).for_each(|(column, x)| column.push(x));
    }
    Points::from_columns(columns).ok()
}

/// Return Lambda^(-1/2) V' of the covariance V Lambda V' of rows, largest eigenvalue first.
fn whitening(rows: &[Vec<f64>]) -> Result<Mat<f64>, LearnError> {
    let (count, width) = (rows.len(), rows.first().map_or(0, Vec::len));
    let mean: Vec<f64> = (0..width).map(|j| rows.iter().map(|row| row[j]).sum::<f64>() / count as f64).collect();
    let centred = Mat::from_fn(count, width, |i, j| rows[i][j] - mean[j]);
    let mut covariance = Mat::<f64>::zeros(width, width);
    matmul(covariance.as_mut(), Accum::Replace, centred.transpose(), centred.as_ref(), 1.0 / count as f64, Par::Seq);
    let nothing = || LearnError::Data("the basis does not vary on the target points".to_string());
    let eigen = covariance.self_adjoint_eigen(Side::Lower).map_err(|_| nothing())?;
    let largest = if width > 0 { eigen.S()[width - 1] } else { 0.0 };
    let kept: Vec<usize> = (0..width).rev().filter(|i| eigen.S()[*i] > RANK_TOLERANCE * largest).collect();
    if !(largest > 0.0 && largest.is_finite()) {
        return Err(nothing());
    }
    Ok(Mat::from_fn(kept.len(), width, |a, j| eigen.U()[(j, kept[a])] / eigen.S()[kept[a]].sqrt()))
}

impl Learner for LinearLearner<'_> {
    type State = LinearState;

    fn observe(&self, scene: &Scene, theta: &[f64], delta: Vec<f64>, rng: &mut ChaCha12Rng) -> Option<LinearState> {
        let evaluation = scene.estimator.problem().evaluate(theta);
        let (num, m) = (self.whitening.ncols(), self.shape.unknowns);
        let mut raw = evaluation.residual;
        raw.truncate(num);
        for j in 0..m {
            raw.extend((0..num).map(|i| evaluation.jacobian[i * m + j]));
        }
        if self.perturbations.count() > 0 {
            let points = normalised_target(scene)?;
            let features = |x: &[f64]| self.basis.features(x);
            raw.extend(perturbed(&points, self.perturbations, num, features, rng));
        }
        if raw.iter().any(|v| !v.is_finite()) {
            return None;
        }
        let raw = MatRef::from_column_major_slice(&raw, num, self.shape.width());
        let mut columns = vec![0.0; self.width() * self.shape.width()];
        let out = faer::MatMut::from_column_major_slice_mut(&mut columns, self.width(), self.shape.width());
        matmul(out, Accum::Replace, self.whitening.as_ref(), raw, 1.0, Par::Seq);
        let spread = match self.config.ridge {
            None => None,
            Some(_) => {
                let points = normalised_target(scene)?;
                Some(Arc::clone(scene.once.get_or_init(|| Arc::new(self.spread(&points)))))
            }
        };
        Some(LinearState { columns, delta, spread })
    }

    /// The whitened directions with the largest derivative for their size, and a little of all others.
    fn start(&mut self, states: &[LinearState], rng: &mut ChaCha12Rng) -> Result<Vec<f64>, LearnError> {
        let (width, features) = (self.width(), self.config.features);
        let mut score = vec![0.0; width];
        for a in 0..width {
            let value: f64 = states.iter().map(|state| state.columns[a].powi(2)).sum();
            let slope: f64 =
                states.iter().flat_map(|s| (1..=self.shape.unknowns).map(|j| s.columns[j * width + a].powi(2))).sum();
            self.scale[a] = (value / states.len().max(1) as f64).sqrt().max(f64::MIN_POSITIVE);
            score[a] = slope / (value + f64::MIN_POSITIVE);
        }
        let mut order: Vec<usize> = (0..width).collect();
        order.sort_by(|a, b| score[*b].total_cmp(&score[*a]));
        let mut parameters: Vec<f64> =
            (0..features * width).map(|_| JITTER * rng.sample::<f64, _>(StandardNormal)).collect();
        order.iter().take(features).enumerate().for_each(|(i, a)| parameters[i * width + a] += 1.0);
        Ok(parameters)
    }

    fn sum(&self, parameters: &[f64], states: &[&LinearState], gradient: &mut [f64]) -> f64 {
        let (width, features, columns) = (self.width(), self.config.features, self.shape.width());
        let matrix = self.scaled(parameters);
        let mut slope = Mat::<f64>::zeros(features, width);
        let mut loss = 0.0;
        // Runs of states of one trial: one whitening for all of them.
        for run in states.chunk_by(|a, b| same_trial(a, b)) {
            let all: Vec<f64> = run.iter().flat_map(|state| state.columns.iter().copied()).collect();
            let all = MatRef::from_column_major_slice(&all, width, columns * run.len());
            let images = &matrix * all;
            let root = run[0].spread.as_deref().zip(self.config.ridge).map(|(s, ridge)| Root::new(&matrix, s, ridge));
            let seen = root.as_ref().map_or_else(|| images.clone(), |root| &root.inverse * &images);
            let mut slopes = Mat::<f64>::zeros(features, columns * run.len());
            for (k, state) in run.iter().enumerate() {
                let place = |block: &Mat<f64>| -> Vec<f64> {
                    let first = k * columns;
                    (first..first + columns)
                        .flat_map(|c| (0..features).map(move |i| (i, c)))
                        .map(|at| block[at])
                        .collect()
                };
                let (left, right) = (place(&images), place(&seen));
                let mut own = vec![0.0; if gradient.is_empty() { 0 } else { left.len() }];
                loss += loss_of_columns(&self.config.objectives, self.shape, [&left, &right], &state.delta, &mut own);
                for (at, value) in own.iter().enumerate() {
                    slopes[(at % features, k * columns + at / features)] = *value;
                }
            }
            if !gradient.is_empty() {
                matmul(slope.as_mut(), Accum::Add, slopes.as_ref(), all.transpose(), 1.0, Par::Seq);
                if let Some(root) = &root {
                    root.add_slope(&mut slope, &slopes, &seen);
                }
            }
        }
        for (at, value) in gradient.iter_mut().enumerate() {
            *value += slope[(at / width, at % width)] / self.scale[at % width];
        }
        loss
    }

    fn run_length(&self) -> usize {
        if self.config.ridge.is_some() { TRIAL_RUN } else { 1 }
    }

    fn architecture(&self, parameters: &[f64]) -> Architecture {
        let product = self.scaled(parameters) * &self.whitening;
        let values = (0..product.nrows()).flat_map(|i| (0..product.ncols()).map(move |j| (i, j)));
        let matrix = Matrix { rows: product.nrows(), values: values.map(|(i, j)| product[(i, j)]).collect() };
        Architecture::Linear { basis: self.config.basis.clone(), matrix, ridge: self.config.ridge }
    }

    fn features(&self) -> String {
        self.config.basis.clone()
    }
}

/// Say whether two states come from one trial, or share no work anyway.
fn same_trial(a: &LinearState, b: &LinearState) -> bool {
    match (&a.spread, &b.spread) {
        (Some(a), Some(b)) => Arc::ptr_eq(a, b),
        _ => true,
    }
}

/// K^-1 of features whitened by the target, K = C S C' + ridge tr(C S C') / n I: inner products of features are taken with it.
struct Root {
    inverse: Mat<f64>,
    /// C S.
    product: Mat<f64>,
    ridge: f64,
}

impl Root {
    fn new(matrix: &Mat<f64>, spread: &[f64], ridge: f64) -> Self {
        let width = matrix.ncols();
        let product = matrix * MatRef::from_row_major_slice(spread, width, width);
        let mut k = &product * matrix.transpose();
        let n = k.nrows();
        let speck = ridge * (0..n).map(|i| k[(i, i)]).sum::<f64>() / n as f64;
        (0..n).for_each(|i| k[(i, i)] += speck);
        let identity = Mat::<f64>::identity(n, n);
        // K is positive definite for a ridge above 0; where C vanishes nothing is left to be learned from this trial.
        let inverse = k.llt(Side::Lower).map_or_else(|_| Mat::zeros(n, n), |factors| factors.solve(&identity));
        Self { inverse, product, ridge }
    }

    /// Add what a change of C does through K: with U = K^-1 Y and dY = U B the slopes so far, R = U B U', it is
    /// -(R + ridge tr(R) / n I) C S.
    fn add_slope(&self, slope: &mut Mat<f64>, slopes: &Mat<f64>, seen: &Mat<f64>) {
        let mut r = slopes * seen.transpose();
        let n = r.nrows();
        let speck = self.ridge * (0..n).map(|i| r[(i, i)]).sum::<f64>() / n as f64;
        (0..n).for_each(|i| r[(i, i)] += speck);
        matmul(slope.as_mut(), Accum::Add, r.as_ref(), self.product.as_ref(), -1.0, Par::Seq);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::learner::check_gradient;
    use cfpose_lab::seed::data_stream;

    const TEXT: &str = r#"
kind = "linear"
basis = "hermite[degree=3]"
features = 8
seed = 5
[[objective]]
name = "contraction"
[[objective]]
name = "star-convexity"
weight = 0.3
[[objective]]
name = "covariance[halves=3]"
weight = 0.2
[[objective]]
name = "influence[outliers=2,cuts=2]"
weight = 0.1
[[data]]
scenario = "cloud3"
shape = "{seed}"
points = 100
sampling = "independent"
"#;

    /// Every objective, with and without whitening by the target, against central differences.
    #[test]
    fn gradients_equal_finite_differences() {
        let lab = Lab::default();
        for ridge in ["", "ridge = 0.01\n"] {
            let config = Config::parse(&lab, &format!("{ridge}{TEXT}"), "test").unwrap();
            let wanted = Perturbations { halves: 3, outliers: 2, cuts: 2 };
            let shape = Shape { unknowns: 6, perturbations: wanted.count() };
            let mut learner = LinearLearner::new(&lab, &config, 3, shape, wanted).unwrap();
            let sampler = Sampler::new(&lab, &config, &config.basis);
            let look = |s: &Scene, t: &[f64], d, r: &mut ChaCha12Rng| learner.observe(s, t, d, r);
            let states = sampler.about_truth(Split::Training, 5, 4, look).unwrap();
            let mut rng = data_stream(1, 1);
            let mut at = learner.start(&states, &mut rng).unwrap();
            at.iter_mut().for_each(|p| *p += 0.2 * rng.sample::<f64, _>(StandardNormal));
            check_gradient(&learner, &at, &states, ridge);
        }
    }
}
