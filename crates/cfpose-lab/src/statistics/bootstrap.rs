//! The bootstrap interval of a median, without drawing: for a median the distribution over all n^n resamples has a closed form.

use statrs::function::gamma::ln_gamma;

/// The two middle values of a resample are farther apart than this many ranks with probability exp(-64).
const MAX_GAP: usize = 64;

/// Sums of probabilities carry rounding.
const ROUNDING: f64 = 1e-12;

/// Return median and 95 % percentile interval of its bootstrap distribution; `None` for an empty list or a NaN in it.
///
/// The distribution is the one over all n^n resamples, so nothing is drawn and no seed is needed. Its quantiles are the least value
/// with at least that probability below or at it. Infinities (trials without an estimate) are values like others.
///
/// With F_i = i / n and the sorted values x_i, value k of a sorted resample is at most x_i with probability P(Binomial(n, F_i) >= k). For
/// odd n = 2m - 1 that of k = m is the median's law. For even n = 2m the two middle values are x_i and x_j, i < j, with probability
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
    if values.is_empty() || values.iter().any(|value| value.is_nan()) {
        return None;
    }
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    let middle = mean(sorted[(sorted.len() - 1) / 2], sorted[sorted.len() / 2]);
    let law =
        Law { sorted: &sorted, m: sorted.len().div_ceil(2), log_choose: log_choose(sorted.len(), sorted.len() / 2) };
    Some((middle, [law.quantile(0.025), law.quantile(0.975)]))
}

/// The law of a resample's median.
struct Law<'a> {
    sorted: &'a [f64],
    /// The middle value's number from 1; the lower one of two.
    m: usize,
    /// log C(n, n / 2).
    log_choose: f64,
}

impl Law<'_> {
    /// Return the probability that value `k` of a sorted resample is at most x_i.
    fn at_most(&self, k: usize, i: usize) -> f64 {
        let n = self.sorted.len();
        if i == 0 { 0.0 } else { at_least(n, k, i as f64 / n as f64) }
    }

    /// Return the least i from 1 for which value `k` of a sorted resample is at most x_i with a probability of `level`.
    fn rank(&self, k: usize, level: f64) -> usize {
        let (mut below, mut at) = (0, self.sorted.len());
        while at - below > 1 {
            let middle = usize::midpoint(below, at);
            if self.at_most(k, middle) >= level - ROUNDING { at = middle } else { below = middle }
        }
        at
    }

    fn quantile(&self, level: f64) -> f64 {
        let n = self.sorted.len();
        // The lower middle value is at most the median, the upper one at least.
        let first = self.rank(self.m, level);
        if n % 2 == 1 {
            return self.sorted[first - 1];
        }
        let last = self.rank(self.m + 1, level);
        // Pairs below `first` lie below the quantile; of those that reach it, count from the smallest mean.
        let mut pairs = self.pairs(first, last);
        pairs.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        let mut below = self.at_most(self.m + 1, first - 1);
        let found = pairs.iter().find(|(_, weight)| {
            below += weight;
            below >= level - ROUNDING
        });
        found.map_or(self.sorted[last - 1], |(value, _)| *value)
    }

    /// Return means and probabilities of the pairs of middle values whose upper one is x_first or above and whose lower one is x_last
    /// or below.
    fn pairs(&self, first: usize, last: usize) -> Vec<(f64, f64)> {
        let (n, power) = (self.sorted.len(), self.m as f64);
        // log(F_i^m - F_(i-1)^m); the upper of the two has the same function of n + 1 - j.
        let log_step = |i: usize| {
            let i = i as f64;
            power * (i / n as f64).ln() + (-(power * (-1.0 / i).ln_1p()).exp_m1()).ln()
        };
        let lowest = first.saturating_sub(MAX_GAP).max(1);
        let uppers: Vec<f64> = (first..=(last + MAX_GAP).min(n)).map(|j| log_step(n + 1 - j)).collect();
        let mut pairs = Vec::new();
        for i in lowest..=last {
            let lower = self.log_choose + log_step(i);
            for (j, upper) in (first..).zip(&uppers).filter(|(j, _)| *j > i && *j <= i + MAX_GAP) {
                let (low, high) = (self.sorted[i - 1], self.sorted[j - 1]);
                pairs.push((mean(low, high), (lower + upper).exp()));
            }
            if i >= first {
                // Both are x_i: what is left of the lower one's probability when the upper one lies above.
                let all = self.at_most(self.m, i) - self.at_most(self.m, i - 1);
                let rest = if i == n { 0.0 } else { (lower + power * ((n - i) as f64 / n as f64).ln()).exp() };
                pairs.push((self.sorted[i - 1], (all - rest).max(0.0)));
            }
        }
        pairs
    }
}

/// Return the mean of two values in order, which may be infinite.
fn mean(low: f64, high: f64) -> f64 {
    if low == high { low } else { low + 0.5 * (high - low) }
}

fn log_choose(n: usize, m: usize) -> f64 {
    ln_gamma(n as f64 + 1.0) - ln_gamma(m as f64 + 1.0) - ln_gamma((n - m) as f64 + 1.0)
}

/// Return P(Binomial(n, p) >= m), by adding the terms on the side that has fewer of them above rounding.
fn at_least(n: usize, m: usize, p: f64) -> f64 {
    if p >= 1.0 {
        return 1.0;
    }
    let (size, odds) = (n as f64, p / (1.0 - p));
    let term = |k: usize| (log_choose(n, k) + k as f64 * p.ln() + (n - k) as f64 * (1.0 - p).ln()).exp();
    // Away from the mean the terms only fall: upwards from m above it, downwards from m - 1 below it.
    let (mut sum, mut next) = (0.0, 0.0);
    if m as f64 >= size * p {
        for k in m..=n {
            next = if k == m { term(m) } else { next * (n - k + 1) as f64 / k as f64 * odds };
            sum += next;
            if next < 1e-18 {
                break;
            }
        }
        return sum.min(1.0);
    }
    for k in (0..m).rev() {
        next = if k + 1 == m { term(k) } else { next * (k + 1) as f64 / (n - k) as f64 / odds };
        sum += next;
        if next < 1e-18 {
            break;
        }
    }
    1.0 - sum.min(1.0)
}
