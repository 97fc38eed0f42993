//! Quantiles of a list.

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
    fn quantiles_equal_those_of_r() {
        // quantile(c(1, 2, 4, 8, 16, 32), c(.1, .5, .9)) in R: 1.5, 6, 24.
        let values = [32.0, 1.0, 8.0, 2.0, 16.0, 4.0];
        assert_eq!([0.1, 0.5, 0.9].map(|q| quantile(&values, q)), [Some(1.5), Some(6.0), Some(24.0)]);
        assert_eq!(median(&[1.0, f64::INFINITY, f64::INFINITY]), Some(f64::INFINITY));
        assert_eq!(median(&[1.0, f64::INFINITY]), Some(f64::INFINITY));
        assert_eq!(median(&[f64::NAN]), None);
    }
}
