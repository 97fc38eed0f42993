//! Medians of error, evaluations and time by cell, with bootstrap intervals.

use crate::figure::{Axis, Figure, Point, Scale, Series, Style};
use crate::group::{Group, error_of};
use crate::plots::{PlotEntry, place_names, place_of};
use crate::record::Record;
use crate::statistics::bootstrap::median_interval;

/// The line of the table for errors.
pub const ERROR: PlotEntry = PlotEntry {
    name: "median-error",
    summary: "median error of every method in every cell",
    draw: |group| draw(group, ERROR.name, "Median error", "error", error_of),
};

/// The line of the table for evaluations.
pub const EVALUATIONS: PlotEntry = PlotEntry {
    name: "median-evaluations",
    summary: "median number of residual evaluations of every method in every cell",
    draw: |group| {
        draw(group, EVALUATIONS.name, "Median evaluations", "residual evaluations", |r| r.evaluations.max(1) as f64)
    },
};

/// The line of the table for time.
pub const SECONDS: PlotEntry = PlotEntry {
    name: "median-seconds",
    summary: "median time of every method in every cell",
    draw: |group| draw(group, SECONDS.name, "Median time", "seconds", |record| record.seconds),
};

fn draw(group: &Group<'_>, plot: &'static str, title: &str, unit: &str, value: fn(&Record) -> f64) -> Option<Figure> {
    let x = place_names(group)?;
    let series = |(method, name): (usize, &&str)| {
        let mut values = vec![Vec::new(); group.cells.len()];
        for problem in &group.problems {
            if let (Some(record), Some(place)) = (problem.records[method], group.place(problem.cell)) {
                values[place].push(value(record));
            }
        }
        let point = |(place, values): (usize, &Vec<f64>)| {
            let (middle, interval) = median_interval(values)?;
            let without = values.iter().filter(|value| value.is_infinite()).count();
            let note =
                if without == 0 { String::new() } else { format!("{without} of {} without a value", values.len()) };
            Some(Point { x: place_of(group, place, method), y: middle, interval: Some(interval), note })
        };
        let points: Vec<Point> = values.iter().enumerate().filter_map(point).filter(|point| point.y > 0.0).collect();
        Series { methods: vec![method], label: (*name).to_string(), style: Style::Dots, points }
    };
    let series: Vec<Series> = group.methods.iter().enumerate().map(series).collect();
    let has_value = series.iter().any(|series| series.points.iter().any(|point| point.y.is_finite()));
    has_value.then(|| Figure {
        plot,
        title: title.to_string(),
        x,
        y: Axis::new(unit, Scale::Log),
        series,
        maps: Vec::new(),
        note: "Bars: 95 % bootstrap intervals of the median. A trial without an estimate counts as infinite."
            .to_string(),
    })
}
