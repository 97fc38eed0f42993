//! Differences of success rates between methods on the same trials.

use crate::figure::{Axis, Figure, Point, Scale, Series, Style};
use crate::group::Group;
use crate::plots::PlotEntry;
use crate::statistics::TableCell;
use crate::statistics::entries::mcnemar::{ENTRY as STATISTIC, compare};

/// The line of the table.
pub const ENTRY: PlotEntry =
    PlotEntry { name: "mcnemar", summary: "paired differences of success rates with intervals and McNemar's p", draw };

fn draw(group: &Group<'_>) -> Option<Figure> {
    let compared = compare(group);
    if compared.is_empty() {
        return None;
    }
    let name = |methods: (usize, usize)| format!("{} - {}", group.methods[methods.1], group.methods[methods.0]);
    let series = compared.iter().enumerate().map(|(place, paired)| {
        let (difference, interval) = paired.difference();
        let [p, corrected] = [paired.p.0, paired.p.1].map(|p| TableCell::Probability(p).text());
        let note = format!("only one solves: {} and {}; p {p}, by Holm {corrected}", paired.only.1, paired.only.0);
        let points = vec![Point { x: place as f64, y: difference, interval: Some(interval), note }];
        let (methods, label) = (vec![paired.methods.1, paired.methods.0], name(paired.methods));
        Series { methods, label, style: Style::Dots, points }
    });
    let series = series.collect();
    Some(Figure {
        plot: ENTRY.name,
        title: "Paired differences of success".to_string(),
        x: Axis::of_names("pair of methods", compared.iter().map(|paired| name(paired.methods)).collect()),
        y: Axis::new("difference of success", Scale::Share),
        series,
        maps: Vec::new(),
        note: format!("Bars: 95 % intervals (Agresti and Min 2005). {}.", STATISTIC.source),
    })
}
