//! Wilcoxon's signed-rank test: are the errors of one method smaller than those of another on the same trials?

use statrs::distribution::{ContinuousCDF, Normal};

use crate::group::{Group, error_of};
use crate::statistics::{StatisticEntry, Table, TableCell, holm, median};

/// The line of the table.
pub const ENTRY: StatisticEntry = StatisticEntry {
    name: "wilcoxon",
    summary: "paired difference of errors, Wilcoxon's signed-rank test, Holm's correction over all pairs of methods",
    source: "Wilcoxon 1945; Holm 1979",
    compute,
};

/// Largest number of differences for which the distribution is counted out.
const EXACT: usize = 50;

/// What the test says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SignedRank {
    /// Sum of the ranks of positive differences.
    pub positive: f64,
    /// Sum of the ranks of negative differences.
    pub negative: f64,
    /// Two-sided p-value.
    pub p: f64,
}

/// Test whether differences are symmetric about zero.
///
/// Zeros (and the difference of two infinite errors, which is no number) are left out; equal sizes share their mean rank. Up to 50
/// differences without equal sizes the distribution is counted out; otherwise p is that of the normal law with the variance for ties,
/// n (n + 1) (2n + 1) / 24 - sum (t^3 - t) / 48, without a correction for continuity. *Degenerate when* nothing is left: 1.
///
/// Source: Wilcoxon, Individual comparisons by ranking methods (1945); Pratt and Gibbons 1981 for ties.
///
/// ```
/// use cfpose_lab::statistics::entries::wilcoxon::signed_rank;
/// let test = signed_rank(&[1.0, 2.0, 3.0, -0.5]);
/// assert_eq!((test.positive, test.negative, test.p), (9.0, 1.0, 0.25));
/// ```
pub fn signed_rank(differences: &[f64]) -> SignedRank {
    let mut kept: Vec<f64> = differences.iter().copied().filter(|d| !d.is_nan() && *d != 0.0).collect();
    kept.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
    let (mut positive, mut negative, mut ties) = (0.0, 0.0, 0.0);
    let mut begin = 0;
    while begin < kept.len() {
        let size = kept[begin].abs();
        let end = begin + kept[begin..].iter().take_while(|d| d.abs() == size).count();
        // Ranks count from 1: the mean of begin + 1 ..= end.
        let rank = 0.5 * (begin + end + 1) as f64;
        for difference in &kept[begin..end] {
            *(if *difference > 0.0 { &mut positive } else { &mut negative }) += rank;
        }
        let tied = (end - begin) as f64;
        ties += tied * tied * tied - tied;
        begin = end;
    }
    let n = kept.len();
    let p = match n {
        0 => 1.0,
        _ if n <= EXACT && ties == 0.0 => exact(n, f64::min(positive, negative) as usize),
        _ => normal(n as f64, f64::min(positive, negative), ties),
    };
    SignedRank { positive, negative, p }
}

/// Twice the probability that the smaller sum of ranks is at most `sum`: all 2^n choices of signs are equally likely.
fn exact(n: usize, sum: usize) -> f64 {
    let mut ways = vec![0.0; n * (n + 1) / 2 + 1];
    ways[0] = 1.0;
    for rank in 1..=n {
        for total in (rank..ways.len()).rev() {
            ways[total] += ways[total - rank];
        }
    }
    let below: f64 = ways[..=sum].iter().sum();
    (2.0 * below / 2.0_f64.powi(n as i32)).min(1.0)
}

fn normal(n: f64, sum: f64, ties: f64) -> f64 {
    let variance = n * (n + 1.0) * (2.0 * n + 1.0) / 24.0 - ties / 48.0;
    let z = (sum - n * (n + 1.0) / 4.0) / variance.sqrt();
    Normal::new(0.0, 1.0).map_or(f64::NAN, |law| (2.0 * law.cdf(z)).min(1.0))
}

fn compute(group: &Group<'_>) -> Option<Table> {
    let mut tests = Vec::new();
    for methods in group.pairs_of_methods() {
        let differences: Vec<f64> =
            group.pairs(methods.0, methods.1).map(|(first, second)| error_of(second) - error_of(first)).collect();
        if !differences.is_empty() {
            let finite: Vec<f64> = differences.iter().copied().filter(|d| !d.is_nan()).collect();
            tests.push((methods, signed_rank(&differences), median(&finite).unwrap_or(f64::NAN), differences.len()));
        }
    }
    let corrected = holm(&tests.iter().map(|(_, test, ..)| test.p).collect::<Vec<_>>());
    let row = |((methods, test, middle, pairs), corrected): (((usize, usize), SignedRank, f64, usize), f64)| {
        vec![
            TableCell::Text(group.methods[methods.0].to_string()),
            TableCell::Text(group.methods[methods.1].to_string()),
            TableCell::Count(pairs),
            TableCell::Number(middle),
            TableCell::Number(test.positive),
            TableCell::Number(test.negative),
            TableCell::Probability(test.p),
            TableCell::Probability(corrected),
        ]
    };
    let rows: Vec<_> = tests.into_iter().zip(corrected).map(row).collect();
    let columns =
        vec!["first", "second", "pairs", "median difference", "rank sum above", "rank sum below", "p", "p by Holm"];
    (!rows.is_empty()).then_some(Table { columns, rows })
}
