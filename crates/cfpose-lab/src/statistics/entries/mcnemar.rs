//! McNemar's test: does one method succeed more often than another on the same trials?

use statrs::distribution::{Binomial, DiscreteCDF};

use crate::group::Group;
use crate::statistics::{StatisticEntry, Table, TableCell, Z_975, holm};

/// The line of the table.
pub const ENTRY: StatisticEntry = StatisticEntry {
    name: "mcnemar",
    summary: "paired difference of success rates, McNemar's exact test, Holm's correction over all pairs of methods",
    source: "McNemar 1947; Holm 1979",
    compute,
};

/// Return the two-sided p-value of McNemar's exact test: of the pairs in which just one of two methods succeeds, each is as likely
/// to be the one.
///
/// Source: McNemar 1947, exact binomial form. *Degenerate when* no pair differs: 1.
///
/// ```
/// use cfpose_lab::statistics::entries::mcnemar::mcnemar;
/// // 2 sum_(k = 0..2) C(12, k) / 2^12 = 158 / 4096.
/// assert!((mcnemar(2, 10) - 158.0 / 4096.0).abs() < 1e-12);
/// assert_eq!(mcnemar(0, 0), 1.0);
/// ```
pub fn mcnemar(only_first: usize, only_second: usize) -> f64 {
    let (low, n) = (only_first.min(only_second) as u64, (only_first + only_second) as u64);
    Binomial::new(0.5, n).map_or(1.0, |binomial| (2.0 * binomial.cdf(low)).min(1.0))
}

/// Return the 95 % interval of the difference of two paired success rates, second minus first, as a fraction.
///
/// With b, c pairs in which only the first or only the second succeeds, d = (c - b) / (n + 2) and
/// d +- z sqrt((b + c + 1) / (n + 2)^2 - (c - b)^2 / (n + 2)^3), b and c enlarged by 1/2 each.
///
/// Source: Agresti and Min, Simple improved confidence intervals for comparing matched proportions (2005).
///
/// ```
/// use cfpose_lab::statistics::entries::mcnemar::difference_interval;
/// let [low, high] = difference_interval(0, 0, 98);
/// assert!(low < 0.0 && (low + high).abs() < 1e-15);
/// ```
pub fn difference_interval(only_first: usize, only_second: usize, pairs: usize) -> [f64; 2] {
    let (b, c, n) = (only_first as f64 + 0.5, only_second as f64 + 0.5, pairs as f64 + 2.0);
    let difference = (c - b) / n;
    let half = Z_975 * ((b + c) - (c - b) * (c - b) / n).sqrt() / n;
    [(difference - half).max(-1.0), (difference + half).min(1.0)]
}

/// Two methods on the same trials.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Paired {
    /// Indices of the methods in the group.
    pub methods: (usize, usize),
    /// Trials that both have.
    pub pairs: usize,
    /// Trials in which only the first, only the second succeeds.
    pub only: (usize, usize),
    /// p of McNemar's test, as it is and corrected over all pairs of methods of the group.
    pub p: (f64, f64),
}

impl Paired {
    /// Return the difference of the success rates, second minus first, and its 95 % interval.
    pub fn difference(&self) -> (f64, [f64; 2]) {
        let (b, c) = self.only;
        ((c as f64 - b as f64) / self.pairs as f64, difference_interval(b, c, self.pairs))
    }
}

/// Compare every pair of methods of a group that has trials in common.
pub fn compare(group: &Group<'_>) -> Vec<Paired> {
    let mut all: Vec<Paired> = Vec::new();
    for methods in group.pairs_of_methods() {
        let mut found = Paired { methods, pairs: 0, only: (0, 0), p: (1.0, 1.0) };
        for (first, second) in group.pairs(methods.0, methods.1) {
            found.pairs += 1;
            found.only.0 += usize::from(first.success && !second.success);
            found.only.1 += usize::from(!first.success && second.success);
        }
        found.p.0 = mcnemar(found.only.0, found.only.1);
        if found.pairs > 0 {
            all.push(found);
        }
    }
    let corrected = holm(&all.iter().map(|paired| paired.p.0).collect::<Vec<_>>());
    all.iter_mut().zip(corrected).for_each(|(paired, p)| paired.p.1 = p);
    all
}

fn compute(group: &Group<'_>) -> Option<Table> {
    let row = |paired: Paired| {
        let (difference, interval) = paired.difference();
        vec![
            TableCell::Text(group.methods[paired.methods.0].to_string()),
            TableCell::Text(group.methods[paired.methods.1].to_string()),
            TableCell::Count(paired.pairs),
            TableCell::Count(paired.only.0),
            TableCell::Count(paired.only.1),
            TableCell::Share(difference),
            TableCell::ShareInterval(interval),
            TableCell::Probability(paired.p.0),
            TableCell::Probability(paired.p.1),
        ]
    };
    let rows: Vec<_> = compare(group).into_iter().map(row).collect();
    let columns = vec![
        "first",
        "second",
        "pairs",
        "only first",
        "only second",
        "difference %",
        "95 % interval",
        "p",
        "p by Holm",
    ];
    (!rows.is_empty()).then_some(Table { columns, rows })
}
