//! Proportions: the interval of a success rate.

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
}
