//! The distribution of errors: which share of the trials ends within an error?

use crate::figure::{Axis, Figure, Point, Scale, Series, Style};
use crate::group::{Group, error_of};
use crate::plots::PlotEntry;
use crate::statistics::wilson95;

/// The line of the table.
pub const ENTRY: PlotEntry =
    PlotEntry { name: "errors", summary: "share of the trials that end within an error", draw };

fn draw(group: &Group<'_>) -> Option<Figure> {
    let series = |(method, name): (usize, &&str)| {
        let mut errors: Vec<f64> = group.of(method).map(error_of).collect();
        errors.sort_by(f64::total_cmp);
        let total = errors.len();
        let finite = errors.iter().enumerate().filter(|(_, error)| error.is_finite() && **error > 0.0);
        let point = |(index, error): (usize, &f64)| Point {
            x: *error,
            y: (index + 1) as f64 / total as f64,
            interval: Some(wilson95(index + 1, total)),
            note: String::new(),
        };
        Series {
            methods: vec![method],
            label: (*name).to_string(),
            style: Style::Steps,
            points: finite.map(point).collect(),
        }
    };
    let series: Vec<Series> = group.methods.iter().enumerate().map(series).collect();
    series.iter().any(|series| !series.points.is_empty()).then(|| Figure {
        plot: ENTRY.name,
        title: "Errors".to_string(),
        x: Axis::new("error", Scale::Log),
        y: Axis::new("trials with at most this error", Scale::Share),
        series,
        maps: Vec::new(),
        note: "Bands: 95 % Wilson intervals, point by point.".to_string(),
    })
}
