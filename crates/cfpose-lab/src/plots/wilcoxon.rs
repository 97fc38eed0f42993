//! Differences of errors between methods on the same trials.

use crate::figure::{Axis, Figure, Point, Scale, Series, Style};
use crate::group::{Group, error_of};
use crate::plots::PlotEntry;
use crate::statistics::bootstrap::median_interval;
use crate::statistics::entries::wilcoxon::signed_rank;
use crate::statistics::{TableCell, holm};

/// The line of the table.
pub const ENTRY: PlotEntry = PlotEntry {
    name: "wilcoxon",
    summary: "median paired differences of errors with bootstrap intervals and Wilcoxon's p",
    draw,
};

fn draw(group: &Group<'_>) -> Option<Figure> {
    let differences: Vec<((usize, usize), Vec<f64>)> = group
        .pairs_of_methods()
        .into_iter()
        .map(|(first, second)| {
            let all = group.pairs(first, second).map(|(a, b)| error_of(b) - error_of(a));
            ((first, second), all.filter(|difference| !difference.is_nan()).collect())
        })
        .filter(|(_, list): &(_, Vec<f64>)| !list.is_empty())
        .collect();
    let p: Vec<f64> = differences.iter().map(|(_, list)| signed_rank(list).p).collect();
    let corrected = holm(&p);
    let name = |methods: (usize, usize)| format!("{} - {}", group.methods[methods.1], group.methods[methods.0]);
    let series = differences.iter().zip(corrected.iter().zip(&p)).enumerate().filter_map(
        |(place, ((methods, list), (corrected, p)))| {
            let (middle, interval) = median_interval(list)?;
            let [p, corrected] = [*p, *corrected].map(|p| TableCell::Probability(p).text());
            let note = format!("{} pairs; p {p}, by Holm {corrected}", list.len());
            let points = vec![Point { x: place as f64, y: middle, interval: Some(interval), note }];
            Some(Series { methods: vec![methods.1, methods.0], label: name(*methods), style: Style::Dots, points })
        },
    );
    let series: Vec<Series> = series.collect();
    let names = differences.iter().map(|(methods, _)| name(*methods)).collect();
    let has_value = series.iter().any(|series| series.points[0].y.is_finite());
    has_value.then(|| Figure {
        plot: ENTRY.name,
        title: "Paired differences of errors".to_string(),
        x: Axis::of_names("pair of methods", names),
        y: Axis::new("median difference of errors", Scale::Linear),
        series,
        maps: Vec::new(),
        note: "Bars: 95 % bootstrap intervals of the median difference. p: Wilcoxon 1945, Holm 1979. Trials in which \
               neither has an estimate are left out."
            .to_string(),
    })
}
