//! The bootstrap interval of a median, without drawing: for a median the distribution over all n^n resamples has a closed form.

use statrs::function::gamma::ln_gamma;

use super::quantile::median;

/// Half width of the window of order statistics that is looked at, in standard deviations of the median's rank.
const WINDOW: f64 = 9.0;

/// Two middle order statistics of a resample are farther apart than this with probability exp(-64).
const MAX_GAP: usize = 64;

/// Return median and 95 % percentile interval of its bootstrap distribution; `None` for an empty list or a NaN in it.
///
/// The distribution is the one over all n^n resamples, so nothing is drawn and no seed is needed. Its quantiles are the least value
/// with at least that probability below or at it. Infinities (trials without an estimate) are values like others.
///
/// With F_i = i / n and the sorted values x_i, for odd n = 2m - 1 the median of a resample is at most x_i with probability
/// P(Binomial(n, F_i) >= m); for even n = 2m its two middle values are x_i and x_j, i < j, with probability
/// C(n, m) (F_i^m - F_(i-1)^m) ((1 - F_(j-1))^m - (1 - F_j)^m).
///
/// Source: Efron, Bootstrap methods: another look at the jackknife (1979), section 3; even n by the same counting.
///
/// ```
/// use cfpose_lab::statistics::bootstrap::median_interval;
/// let (median, [low, high]) = median_interval(&[3.0, 1.0, 2.0, 5.0, 4.0]).unwrap();
/// assert_eq!((median, low, high), (3.0, 1.0, 5.0));
/// ```
pub fn median_interval(values: &[f64]) -> Option<(f64, [f64; 2])> {
    let middle = median(values)?;
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let mut law = if sorted.len() % 2 == 1 { odd(&sorted) } else { even(&sorted) };
    law.sort_by(|a, b| a.0.total_cmp(&b.0));
    let total: f64 = law.iter().map(|(_, weight)| weight).sum();
    let at = |level: f64| {
        let mut below = 0.0;
        let found = law.iter().find(|(_, weight)| {
            below += weight;
            // Sums of probabilities carry rounding.
            below >= level * total - 1e-12
        });
        found.or(law.last()).map(|(value, _)| *value)
    };
    Some((middle, [at(0.025)?, at(0.975)?]))
}

/// Return the ranks, from 1, that the median of a resample can have with a probability worth counting.
fn ranks(n: usize) -> std::ops::RangeInclusive<usize> {
    let half = (WINDOW * 0.5 * (n as f64).sqrt()).ceil() as usize + 1;
    (n / 2).saturating_sub(half).max(1)..=(n / 2 + 1 + half).min(n)
}

/// Values and probabilities for an odd number of values.
fn odd(sorted: &[f64]) -> Vec<(f64, f64)> {
    let (n, m) = (sorted.len(), sorted.len().div_ceil(2));
    let mut before = 0.0;
    let mut law = Vec::new();
    for i in ranks(n) {
        let now = at_least(n, m, i as f64 / n as f64);
        law.push((sorted[i - 1], now - before));
        before = now;
    }
    law
}

/// Values and probabilities for an even number of values.
fn even(sorted: &[f64]) -> Vec<(f64, f64)> {
    let (n, m) = (sorted.len(), sorted.len() / 2);
    let (size, power) = (n as f64, m as f64);
    let log_choose = log_choose(n, m);
    // log(F_i^m - F_(i-1)^m): by symmetry the same function of n + 1 - j serves the upper one of the two.
    let log_step = |i: usize| {
        let i = i as f64;
        power * (i / size).ln() + (-(power * (-1.0 / i).ln_1p()).exp_m1()).ln()
    };
    let mut before = 0.0;
    let mut law = Vec::new();
    for i in ranks(n) {
        let now = at_least(n, m, i as f64 / n as f64);
        // The probability that the lower of the two middle values is x_i, less that of an upper one above it.
        let mut both = now - before;
        before = now;
        for j in i + 1..=(i + MAX_GAP).min(n) {
            let weight = (log_choose + log_step(i) + log_step(n + 1 - j)).exp();
            let (low, high) = (sorted[i - 1], sorted[j - 1]);
            law.push((if low == high { low } else { low + 0.5 * (high - low) }, weight));
            both -= weight;
        }
        law.push((sorted[i - 1], both.max(0.0)));
    }
    law
}

fn log_choose(n: usize, m: usize) -> f64 {
    ln_gamma(n as f64 + 1.0) - ln_gamma(m as f64 + 1.0) - ln_gamma((n - m) as f64 + 1.0)
}

/// Return P(Binomial(n, p) >= m), for m near n p.
fn at_least(n: usize, m: usize, p: f64) -> f64 {
    if p >= 1.0 {
        return 1.0;
    }
    let odds = p / (1.0 - p);
    let first = (log_choose(n, m) + m as f64 * p.ln() + (n - m) as f64 * (1.0 - p).ln()).exp();
    let (mut term, mut sum) = (first, 0.0);
    for k in m..=n {
        sum += term;
        let next = term * (n - k) as f64 / (k + 1) as f64 * odds;
        if next < term && next < 1e-18 {
            break;
        }
        term = next;
    }
    sum.min(1.0)
}
