//! The exponent b of time = a N^b, with its interval: how a method's time grows with the number of points.

use std::collections::BTreeMap;

use statrs::distribution::{ContinuousCDF, StudentsT};

use crate::group::Group;
use crate::statistics::{StatisticEntry, Table, TableCell, median};

/// The line of the table.
pub const ENTRY: StatisticEntry = StatisticEntry {
    name: "exponent",
    summary: "exponent of median time against the number of points, least squares over the cells on logarithmic axes",
    source: "Draper and Smith, Applied Regression Analysis, chapter 1; the paper's runtime figure",
    compute,
};

/// The largest number of points is at least so many times the smallest.
const MIN_RATIO: f64 = 2.0;

/// A power law a x^b.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PowerLaw {
    /// Exponent b.
    pub exponent: f64,
    /// 95 % interval of b by Student's t with n - 2 degrees of freedom.
    pub interval: [f64; 2],
    /// Factor a.
    pub factor: f64,
    /// Standard deviation of log y about the line.
    spread: f64,
    /// Quantile of Student's t.
    quantile: f64,
    /// Number, mean and sum of squared deviations of log x.
    n: f64,
    mean: f64,
    squares: f64,
}

impl PowerLaw {
    /// Return a x^b and the 95 % interval of the mean there.
    pub fn at(&self, x: f64) -> (f64, [f64; 2]) {
        let deviation = x.ln() - self.mean;
        let half = self.quantile * self.spread * (1.0 / self.n + deviation * deviation / self.squares).sqrt();
        let middle = self.factor.ln() + self.exponent * x.ln();
        (middle.exp(), [(middle - half).exp(), (middle + half).exp()])
    }
}

/// Fit log y = log a + b log x by least squares; `None` below three points, without two different x, or for values that are not
/// positive.
///
/// ```
/// use cfpose_lab::statistics::entries::exponent::fit;
/// let law = fit(&[(10.0, 20.0), (100.0, 200.0), (1000.0, 2000.0)]).unwrap();
/// assert!((law.exponent - 1.0).abs() < 1e-12 && (law.factor - 2.0).abs() < 1e-12);
/// ```
pub fn fit(points: &[(f64, f64)]) -> Option<PowerLaw> {
    if points.len() < 3 || points.iter().any(|(x, y)| !(*x > 0.0 && *y > 0.0 && x.is_finite() && y.is_finite())) {
        return None;
    }
    let logs: Vec<(f64, f64)> = points.iter().map(|(x, y)| (x.ln(), y.ln())).collect();
    let n = logs.len() as f64;
    let mean = logs.iter().map(|(x, _)| x).sum::<f64>() / n;
    let level = logs.iter().map(|(_, y)| y).sum::<f64>() / n;
    let squares: f64 = logs.iter().map(|(x, _)| (x - mean).powi(2)).sum();
    if squares <= 1e-12 {
        return None;
    }
    let exponent = logs.iter().map(|(x, y)| (x - mean) * (y - level)).sum::<f64>() / squares;
    let rest: f64 = logs.iter().map(|(x, y)| (y - level - exponent * (x - mean)).powi(2)).sum();
    let spread = (rest / (n - 2.0)).sqrt();
    let quantile = StudentsT::new(0.0, 1.0, n - 2.0).ok()?.inverse_cdf(0.975);
    let half = quantile * spread / squares.sqrt();
    let interval = [exponent - half, exponent + half];
    let factor = (level - exponent * mean).exp();
    Some(PowerLaw { exponent, interval, factor, spread, quantile, n, mean, squares })
}

/// Return (median number of source points, median seconds) of every cell, by the number of points.
pub fn times(group: &Group<'_>, method: usize) -> Vec<(f64, f64)> {
    let mut cells: BTreeMap<usize, (Vec<f64>, Vec<f64>)> = BTreeMap::new();
    for problem in &group.problems {
        let Some(record) = problem.records[method] else { continue };
        if let Some(points) = record.num_points() {
            let (sizes, seconds) = cells.entry(problem.cell).or_default();
            sizes.push(points as f64);
            seconds.push(record.seconds);
        }
    }
    let mut times: Vec<(f64, f64)> =
        cells.values().filter_map(|(sizes, seconds)| Some((median(sizes)?, median(seconds)?))).collect();
    times.sort_by(|a, b| a.0.total_cmp(&b.0));
    times
}

/// Fit the times of a method, where the numbers of points span enough.
pub fn law(times: &[(f64, f64)]) -> Option<PowerLaw> {
    let (first, last) = (times.first()?.0, times.last()?.0);
    if last >= MIN_RATIO * first { fit(times) } else { None }
}

fn compute(group: &Group<'_>) -> Option<Table> {
    let row = |method: usize| {
        let times = times(group, method);
        let law = law(&times)?;
        Some(vec![
            TableCell::Text(group.methods[method].to_string()),
            TableCell::Count(times.len()),
            TableCell::Count(times.first()?.0 as usize),
            TableCell::Count(times.last()?.0 as usize),
            TableCell::Number(law.exponent),
            TableCell::Interval(law.interval),
            TableCell::Number(1e3 * law.at(1000.0).0),
        ])
    };
    let rows: Vec<_> = (0..group.methods.len()).filter_map(row).collect();
    let columns =
        vec!["method", "cells", "fewest points", "most points", "exponent", "95 % interval", "ms at 1000 points"];
    (!rows.is_empty()).then_some(Table { columns, rows })
}
