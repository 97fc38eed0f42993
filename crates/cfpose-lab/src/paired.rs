//! Paired comparison of methods on the same trials, pooled by some parameters, as Markdown; the radius of a basin.

use std::collections::BTreeMap;
use std::fmt::Write;

use crate::record::Record;
use crate::seed::data_stream;
use crate::statistics::entries::mcnemar::mcnemar;
use crate::statistics::{holm, median, quantile, wilson95};
use crate::table::show;
use rand::RngExt;

/// Resamples of an interval of a radius.
const RESAMPLES: usize = 2000;

/// Return where the success falls below `level`, by linear interpolation between (spread, rate) pairs in ascending order, from rate 1
/// at spread 0; the last spread where it never does.
///
/// ```
/// use cfpose_lab::paired::radius;
/// assert!((radius(&[(0.1, 1.0), (0.2, 0.8)], 0.9) - 0.15).abs() < 1e-12);
/// assert!((radius(&[(0.1, 0.8)], 0.9) - 0.05).abs() < 1e-12);
/// ```
pub fn radius(rates: &[(f64, f64)], level: f64) -> f64 {
    let mut before = (0.0, 1.0);
    for (spread, rate) in rates {
        if *rate < level {
            return before.0 + (spread - before.0) * (before.1 - level) / (before.1 - rate);
        }
        before = (*spread, *rate);
    }
    before.0
}

/// Return the 95 % interval of a radius: counts are drawn again from binomials of the rates found.
fn radius_interval(counts: &[(f64, usize, usize)], level: f64) -> [f64; 2] {
    let mut rng = data_stream(1, u64::from_be_bytes(*b"radius\0\0"));
    let mut drawn = Vec::with_capacity(RESAMPLES);
    for _ in 0..RESAMPLES {
        let again = counts.iter().map(|(spread, hits, trials)| {
            let rate = *hits as f64 / (*trials).max(1) as f64;
            let count = (0..*trials).filter(|_| rng.random::<f64>() < rate).count();
            (*spread, count as f64 / (*trials).max(1) as f64)
        });
        drawn.push(radius(&again.collect::<Vec<_>>(), level));
    }
    [0.025, 0.975].map(|q| quantile(&drawn, q).unwrap_or(f64::NAN))
}

/// Success of every method in a cell, trial by trial.
type Outcomes<'a> = BTreeMap<&'a str, BTreeMap<&'a str, &'a Record>>;

/// Return Markdown tables of records pooled over everything but the named parameters: success with its Wilson interval, median error,
/// evaluations, and McNemar's p against a method, by Holm over all rows of the table; then the radius at 90 % success over `spread`
/// for every method, where the cells without another difference have at least two spreads.
pub fn study(records: &[Record], by: &[&str], base: &str, spread: &str) -> String {
    let mut cells: BTreeMap<Vec<String>, Outcomes<'_>> = BTreeMap::new();
    let mut methods: Vec<&str> = Vec::new();
    for record in records {
        let place = by.iter().map(|name| show(record.parameters.get(*name))).collect();
        cells.entry(place).or_default().entry(&record.method).or_default().insert(&record.key, record);
        if !methods.contains(&record.method.as_str()) {
            methods.push(&record.method);
        }
    }
    let mut p = Vec::new();
    for outcomes in cells.values() {
        p.extend(methods.iter().filter_map(|method| Some(against(outcomes.get(method)?, outcomes.get(base)))));
    }
    let corrected = holm(&p);
    let mut text = format!(
        "| {} | method | trials | success % | 95 % | median e | evaluations | p against {base} |\n",
        by.join(" | ")
    );
    let _ = writeln!(text, "|{}", "---|".repeat(by.len() + 7));
    let mut row = 0;
    for (place, outcomes) in &cells {
        for (method, trials) in methods.iter().filter_map(|method| Some((method, outcomes.get(method)?))) {
            let (hits, n) = (trials.values().filter(|r| r.success).count(), trials.len());
            let [low, high] = wilson95(hits, n).map(|x| 100.0 * x);
            let errors: Vec<f64> = trials.values().map(|r| r.error.unwrap_or(f64::INFINITY)).collect();
            let evaluations = trials.values().map(|r| r.evaluations).sum::<usize>() as f64 / n as f64;
            let significance = if *method == base { "-".to_string() } else { format!("{:.1e}", corrected[row]) };
            let _ = writeln!(
                text,
                "| {} | {method} | {n} | {:.1} | {low:.1} .. {high:.1} | {:.4} | {evaluations:.0} | {significance} |",
                place.join(" | "),
                100.0 * hits as f64 / n as f64,
                median(&errors).unwrap_or(f64::NAN),
            );
            row += 1;
        }
    }
    text + &radii(&cells, by, &methods, spread)
}

/// Put tables into a page in Markdown: between the lines `<!-- study NAME -->` and `<!-- end of study NAME -->`, else with them at its end.
///
/// ```
/// use cfpose_lab::paired::into_page;
/// let page = into_page("# Title\n", "far", "| a |\n");
/// assert_eq!(page, "# Title\n\n<!-- study far -->\n\n| a |\n\n<!-- end of study far -->\n");
/// assert_eq!(into_page(&page, "far", "| b |\n"), page.replace("| a |", "| b |"));
/// ```
pub fn into_page(page: &str, name: &str, tables: &str) -> String {
    let (first, last) = (format!("<!-- study {name} -->\n"), format!("<!-- end of study {name} -->\n"));
    let place = page.find(&first).and_then(|begin| Some((begin, begin + page[begin..].find(&last)?)));
    let (before, after) = match place {
        Some((begin, end)) => (page[..begin].to_string(), &page[end + last.len()..]),
        None => (format!("{page}\n"), ""),
    };
    format!("{before}{first}\n{tables}\n{last}{after}")
}

/// Return McNemar's p of a method against another on the trials that both have.
fn against(method: &BTreeMap<&str, &Record>, base: Option<&BTreeMap<&str, &Record>>) -> f64 {
    let (mut only, mut other) = (0, 0);
    for (key, record) in method {
        match base.and_then(|base| base.get(key)) {
            Some(second) if record.success && !second.success => only += 1,
            Some(second) if !record.success && second.success => other += 1,
            _ => {}
        }
    }
    mcnemar(only, other)
}

/// Return the table of radii.
fn radii(cells: &BTreeMap<Vec<String>, Outcomes<'_>>, by: &[&str], methods: &[&str], spread: &str) -> String {
    let Some(axis) = by.iter().position(|name| *name == spread) else { return String::new() };
    let mut lines: BTreeMap<Vec<String>, Vec<(f64, &Outcomes<'_>)>> = BTreeMap::new();
    for (place, outcomes) in cells {
        let mut rest = place.clone();
        if let Ok(value) = rest.remove(axis).parse() {
            lines.entry(rest).or_default().push((value, outcomes));
        }
    }
    let mut text = String::new();
    for (rest, mut line) in lines.into_iter().filter(|(_, line)| line.len() > 1) {
        line.sort_by(|a, b| a.0.total_cmp(&b.0));
        let _ = writeln!(text, "\n| method ({}) | radius at 90 % in {spread} | 95 % |\n|---|---|---|", rest.join(", "));
        for method in methods {
            let counts: Vec<(f64, usize, usize)> = line
                .iter()
                .filter_map(|(value, outcomes)| {
                    let trials = outcomes.get(method)?;
                    Some((*value, trials.values().filter(|r| r.success).count(), trials.len()))
                })
                .collect();
            let rates: Vec<(f64, f64)> = counts.iter().map(|(v, hits, n)| (*v, *hits as f64 / *n as f64)).collect();
            let [low, high] = radius_interval(&counts, 0.9);
            let _ = writeln!(text, "| {method} | {:.3} | {low:.3} .. {high:.3} |", radius(&rates, 0.9));
        }
    }
    text
}
