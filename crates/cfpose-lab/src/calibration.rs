//! Whether reported uncertainties are true: errors in units of the reported covariance.

use cfpose::free::columns;
use cfpose::theta::Layout;
use cfpose::{Estimate, Estimator, PoseError};
use cfpose_optim::Manifold;

/// Return the squared Mahalanobis distance d' C^-1 d of the truth from the estimate, d the tangent step from the estimate to
/// the truth (for a rotation R exp(w)) and C the reported covariance of the tangent coordinates (tangent x tangent, row by
/// row). For a calibrated C it follows a chi-square law with `manifold.tangent()` degrees of freedom.
///
/// `None` for lengths that do not fit, and where C is not positive definite: directions that the data do not determine have
/// no error.
///
/// ```
/// use cfpose_lab::calibration::mahalanobis;
/// use cfpose_optim::manifold::Euclidean;
/// let squared = mahalanobis(&Euclidean(2), &[0.0, 1.0], &[0.2, 1.3], &[0.01, 0.0, 0.0, 0.09]).unwrap();
/// assert!((squared - 5.0).abs() < 1e-12);
/// ```
pub fn mahalanobis(manifold: &dyn Manifold, estimate: &[f64], truth: &[f64], covariance: &[f64]) -> Option<f64> {
    let (ambient, n) = (manifold.ambient(), manifold.tangent());
    if estimate.len() != ambient || truth.len() != ambient {
        return None;
    }
    let mut step = vec![0.0; n];
    manifold.local(estimate, truth, &mut step);
    squared_in_units_of(&step, covariance)
}

/// Return the distance of [`mahalanobis`] of an estimate, in the coordinates in which its covariance is well conditioned.
pub fn estimate_mahalanobis(estimator: &Estimator, estimate: &Estimate, truth: &[f64]) -> Option<f64> {
    let statistics = estimate.statistics.as_ref()?;
    match (&statistics.covariance_at_centroid, estimator.step_at_centroid(&estimate.theta, truth)) {
        (Some(covariance), Some(step)) if estimate.undetermined.is_empty() => squared_in_units_of(&step, covariance),
        _ => mahalanobis(estimator.model().layout.manifold(), &estimate.theta, truth, &statistics.covariance),
    }
}

/// d' C^-1 d, `None` where C is not positive definite.
fn squared_in_units_of(step: &[f64], covariance: &[f64]) -> Option<f64> {
    let n = step.len();
    if covariance.len() != n * n {
        return None;
    }
    // Deviations first: angles and lengths have different units.
    let deviations: Vec<f64> = (0..n).map(|i| covariance[i * n + i].sqrt()).collect();
    if !deviations.iter().all(|s| *s > 0.0 && s.is_finite()) {
        return None;
    }
    let correlation = |i: usize, j: usize| covariance[i * n + j] / (deviations[i] * deviations[j]);
    // Cholesky: C = L L'; the squared norm of L^-1 d is the distance.
    let mut l = vec![0.0; n * n];
    let (mut whitened, mut squared) = (vec![0.0; n], 0.0);
    for i in 0..n {
        for j in 0..=i {
            let sum: f64 = (0..j).map(|k| l[i * n + k] * l[j * n + k]).sum();
            let rest = correlation(i, j) - sum;
            l[i * n + j] = if i == j { rest.sqrt() } else { rest / l[j * n + j] };
        }
        // A pivot lost to rounding is a direction without a variance; NaN fails the comparison too.
        let is_definite = l[i * n + i] > 1e-7;
        if !is_definite {
            return None;
        }
        let sum: f64 = (0..i).map(|k| l[i * n + k] * whitened[k]).sum();
        whitened[i] = (step[i] / deviations[i] - sum) / l[i * n + i];
        squared += whitened[i] * whitened[i];
    }
    Some(squared).filter(|value| value.is_finite())
}

/// Return the error of a pose that a covariance of its tangent coordinates (tangent x tangent, row by row) lets expect: the roots
/// of the traces of the rotation's part (radians) and of the translation's part, each a root mean square.
///
/// `None` for a layout without rotation or translation, and for a covariance of other coordinates.
///
/// ```
/// use cfpose::theta::Layout;
/// let mut covariance = [0.0; 36];
/// [4.0, 0.0, 0.0, 1.0, 4.0, 4.0].iter().enumerate().for_each(|(i, variance)| covariance[7 * i] = *variance);
/// let error = cfpose_lab::calibration::expected_error(&Layout::pose3(), &covariance).unwrap();
/// assert_eq!((error.angle, error.translation), (2.0, 3.0));
/// ```
pub fn expected_error(layout: &Layout, covariance: &[f64]) -> Option<PoseError> {
    let (columns, blocks) = (columns(layout), layout.blocks());
    if covariance.len() != columns.len() * columns.len() {
        return None;
    }
    let root_of_trace = |names: &[&str]| {
        let mine = |j: &usize| names.contains(&blocks[columns[*j].block].name);
        let diagonal: Vec<f64> = (0..columns.len()).filter(mine).map(|j| covariance[j * columns.len() + j]).collect();
        (!diagonal.is_empty()).then(|| diagonal.iter().sum::<f64>().sqrt()).filter(|root| root.is_finite())
    };
    Some(PoseError { angle: root_of_trace(&["rotation", "angle"])?, translation: root_of_trace(&["translation"])? })
}

/// Return the central 95 % band of the mean of `count` independent chi-square values of `dof` degrees of freedom; `None` without
/// values.
///
/// By the cube-root approximation of Wilson and Hilferty (1931): with `count * dof` degrees of freedom its quantiles are right to
/// 3 % from 6 on and to 0.02 % from 60 on.
///
/// ```
/// // A chi-square law of 60 degrees of freedom has 95 % of its mass in 40.48..83.30.
/// let [low, high] = cfpose_lab::calibration::mean_band(6, 10).unwrap();
/// assert!((low - 4.048).abs() < 4e-3 && (high - 8.330).abs() < 4e-3);
/// ```
pub fn mean_band(dof: usize, count: usize) -> Option<[f64; 2]> {
    let total = (dof * count) as f64;
    let quantile = |z: f64| {
        let spread = 2.0 / (9.0 * total);
        (total * (1.0 - spread + z * spread.sqrt()).powi(3)).max(0.0) / count as f64
    };
    (total > 0.0).then(|| [-crate::statistics::Z_975, crate::statistics::Z_975].map(quantile))
}

#[cfg(test)]
mod tests {
    use cfpose::theta::Layout;
    use cfpose_optim::manifold::rotation_exp;
    use rand::RngExt;
    use rand_distr::StandardNormal;

    use super::*;
    use crate::seed::data_stream;

    /// Lower triangle of C = L L' of a pose whose coordinates are correlated and of very different size.
    const FACTOR: [[f64; 6]; 6] = [
        [0.01, 0.0, 0.0, 0.0, 0.0, 0.0],
        [0.004, 0.02, 0.0, 0.0, 0.0, 0.0],
        [0.0, -0.003, 0.001, 0.0, 0.0, 0.0],
        [5.0, 2.0, 0.0, 3.0, 0.0, 0.0],
        [0.0, 0.0, 1.0, -7.0, 2.0, 0.0],
        [1e-3, 0.0, 0.0, 0.0, 4e-3, 1e-3],
    ];

    fn covariance() -> Vec<f64> {
        let entry = |i: usize, j: usize| (0..6).map(|k| FACTOR[i][k] * FACTOR[j][k]).sum();
        (0..36).map(|at| entry(at / 6, at % 6)).collect()
    }

    #[test]
    fn draws_from_the_covariance_have_a_chi_square_distance() {
        let layout = Layout::pose3();
        let manifold = layout.manifold();
        let estimate = [&rotation_exp(&[0.4, -1.0, 2.0])[..], &[3.0, -1.0, 10.0]].concat();
        let mut rng = data_stream(4, 4);
        let (mut sum, mut below) = (0.0, 0);
        const COUNT: usize = 4000;
        for _ in 0..COUNT {
            let z: [f64; 6] = std::array::from_fn(|_| rng.sample(StandardNormal));
            let step: [f64; 6] = std::array::from_fn(|i| (0..6).map(|k| FACTOR[i][k] * z[k]).sum());
            let mut truth = vec![0.0; 12];
            manifold.retract(&estimate, &step, &mut truth);
            let squared = mahalanobis(manifold, &estimate, &truth, &covariance()).unwrap();
            let expected: f64 = z.iter().map(|v| v * v).sum();
            assert!((squared - expected).abs() < 1e-6 * expected.max(1.0), "{squared} {expected}");
            sum += squared;
            // The median of the chi-square law of 6 degrees of freedom.
            below += usize::from(squared < 5.348);
        }
        let [low, high] = mean_band(6, COUNT).unwrap();
        let mean = sum / COUNT as f64;
        // Twice the band: one seed in about 10 000 would fail.
        assert!((mean - 6.0).abs() < high - low, "{mean}");
        assert!((below as f64 / COUNT as f64 - 0.5).abs() < 4.0 * 0.5 / (COUNT as f64).sqrt());
    }

    #[test]
    fn a_covariance_without_an_inverse_has_no_distance() {
        let layout = Layout::pose3();
        let theta = layout.neutral();
        let mut c = covariance();
        assert_eq!(mahalanobis(layout.manifold(), &theta, &theta, &c), Some(0.0));
        assert_eq!(mahalanobis(layout.manifold(), &theta, &theta, &c[..35]), None);
        assert_eq!(mahalanobis(layout.manifold(), &theta[..11], &theta, &c), None);
        // The last coordinate repeats the first.
        for i in 0..6 {
            c[i * 6 + 5] = c[i * 6];
        }
        for i in 0..6 {
            c[30 + i] = c[i];
        }
        assert_eq!(mahalanobis(layout.manifold(), &theta, &theta, &c), None);
        let mut c = covariance();
        for i in 0..6 {
            (c[i], c[i * 6]) = (0.0, 0.0);
        }
        assert_eq!(mahalanobis(layout.manifold(), &theta, &theta, &c), None);
        c[0] = f64::NAN;
        assert_eq!(mahalanobis(layout.manifold(), &theta, &theta, &c), None);
    }

    #[test]
    fn bands_equal_tabulated_quantiles() {
        // Chi-square quantiles 0.025 and 0.975 from tables: 6 and 100 degrees of freedom.
        for (dof, count, low, high, accuracy) in [
            (6, 1, 1.237_344, 14.449_375, 0.03),
            (6, 10, 4.048_175, 8.329_768, 2e-4),
            (1, 100, 0.742_219, 1.295_612, 1e-4),
        ] {
            let band = mean_band(dof, count).unwrap();
            assert!((band[0] / low - 1.0).abs() < accuracy && (band[1] / high - 1.0).abs() < accuracy, "{band:?}");
        }
        assert_eq!(mean_band(6, 0), None);
    }
}
