//! Statistics of success counts and errors.

/// Standard normal quantile of 0.975.
pub(crate) const Z_975: f64 = 1.959_963_984_540_054;

/// Return the 95 % Wilson score interval of a proportion, as fractions in 0..=1.
///
/// centre = (p + z^2 / 2n) / (1 + z^2 / n), half width = z sqrt(p (1 - p) / n + z^2 / 4n^2) / (1 + z^2 / n).
/// Source: Wilson, Probable inference, the law of succession, and statistical inference (1927); the figures in the tests
/// are those of Newcombe, Two-sided confidence intervals for the single proportion (1998), Table I, method 3.
/// *Degenerate when* there are no trials: the interval is 0..1.
///
/// ```
/// let [low, high] = cfpose_lab::statistics::wilson95(81, 263);
/// assert!((low - 0.2553).abs() < 5e-5 && (high - 0.3662).abs() < 5e-5);
/// ```
pub fn wilson95(successes: usize, trials: usize) -> [f64; 2] {
    if trials == 0 {
        return [0.0, 1.0];
    }
    let (n, z2) = (trials as f64, Z_975 * Z_975);
    let p = successes.min(trials) as f64 / n;
    let centre = p + z2 / (2.0 * n);
    let half = Z_975 * (p * (1.0 - p) / n + z2 / (4.0 * n * n)).sqrt();
    let scale = 1.0 + z2 / n;
    // At p = 0 and p = 1 one end is exactly 0 or 1; rounding must not move it.
    let low = if successes == 0 { 0.0 } else { ((centre - half) / scale).max(0.0) };
    let high = if successes >= trials { 1.0 } else { ((centre + half) / scale).min(1.0) };
    [low, high]
}

/// Return the q-quantile, q in 0..=1, by linear interpolation between order statistics (type 7 of Hyndman and Fan 1996,
/// the default of R and numpy); `None` for an empty list or a NaN in it. Infinities are allowed.
///
/// ```
/// use cfpose_lab::statistics::quantile;
/// assert_eq!(quantile(&[4.0, 1.0, 3.0, 2.0], 0.25), Some(1.75));
/// assert_eq!(quantile(&[], 0.5), None);
/// ```
pub fn quantile(values: &[f64], q: f64) -> Option<f64> {
    if values.is_empty() || values.iter().any(|v| v.is_nan()) || !(0.0..=1.0).contains(&q) {
        return None;
    }
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let position = q * (sorted.len() - 1) as f64;
    let (below, above) = (sorted[position.floor() as usize], sorted[position.ceil() as usize]);
    let fraction = position - position.floor();
    // Equal neighbours first: the difference of two infinities is no number.
    Some(if below == above || fraction == 0.0 { below } else { below + fraction * (above - below) })
}

/// Return the median; `None` for an empty list or a NaN in it.
pub fn median(values: &[f64]) -> Option<f64> {
    quantile(values, 0.5)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wilson_intervals_equal_newcombes_table() {
        for (successes, trials, low, high) in
            [(81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605), (0, 20, 0.0, 0.1611), (1, 29, 0.0061, 0.1718)]
        {
            let interval = wilson95(successes, trials);
            assert!((interval[0] - low).abs() < 5e-5 && (interval[1] - high).abs() < 5e-5, "{interval:?}");
            let mirrored = wilson95(trials - successes, trials);
            assert!((mirrored[0] - (1.0 - interval[1])).abs() < 1e-15);
        }
        assert_eq!(wilson95(0, 0), [0.0, 1.0]);
        assert_eq!(wilson95(5, 5)[1], 1.0);
    }

    #[test]
    fn quantiles_equal_those_of_r() {
        // quantile(c(1, 2, 4, 8, 16, 32), c(.1, .5, .9)) in R: 1.5, 6, 24.
        let values = [32.0, 1.0, 8.0, 2.0, 16.0, 4.0];
        assert_eq!([0.1, 0.5, 0.9].map(|q| quantile(&values, q)), [Some(1.5), Some(6.0), Some(24.0)]);
        assert_eq!(median(&[1.0, f64::INFINITY, f64::INFINITY]), Some(f64::INFINITY));
        assert_eq!(median(&[1.0, f64::INFINITY]), Some(f64::INFINITY));
        assert_eq!(median(&[f64::NAN]), None);
    }
}
