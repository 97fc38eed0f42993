//! Performance profiles over evaluations and over time.

use crate::figure::{Axis, Figure, Point, Scale, Series, Style};
use crate::group::Group;
use crate::plots::PlotEntry;
use crate::record::Record;
use crate::statistics::entries::performance_profile::{costs, evaluations, ratios};
use crate::statistics::wilson95;

/// The line of the table for evaluations.
pub const EVALUATIONS: PlotEntry = PlotEntry {
    name: "performance-profile",
    summary: "share of the trials solved within a multiple of the least evaluations (Dolan and More)",
    draw: |group| draw(group, EVALUATIONS.name, "evaluations", evaluations),
};

/// The line of the table for time.
pub const SECONDS: PlotEntry = PlotEntry {
    name: "performance-profile-seconds",
    summary: "share of the trials solved within a multiple of the least time (Dolan and More)",
    draw: |group| draw(group, SECONDS.name, "time", |record| record.seconds),
};

/// Largest multiple that is drawn.
const LARGEST: f64 = 1e3;

fn draw(group: &Group<'_>, plot: &'static str, unit: &str, cost: fn(&Record) -> f64) -> Option<Figure> {
    let costs = costs(group, cost);
    if group.methods.len() < 2 || costs.is_empty() {
        return None;
    }
    let ratios = ratios(&costs);
    let shown = |ratio: &f64| ratio.is_finite() && *ratio <= LARGEST;
    let largest = ratios.iter().flatten().copied().filter(shown).fold(2.0, f64::max);
    let total = costs.len();
    let series = |(method, ratios): (usize, &Vec<f64>)| {
        let point = |x: f64, count: usize| Point {
            x,
            y: count as f64 / total as f64,
            interval: Some(wilson95(count, total)),
            note: format!("{count} of {total}"),
        };
        let mut points: Vec<Point> = Vec::new();
        for (index, ratio) in ratios.iter().enumerate().filter(|(_, ratio)| shown(ratio)) {
            points.pop_if(|last| last.x == *ratio);
            points.push(point(*ratio, index + 1));
        }
        // From the first to the last multiple that any method has.
        if points.first().is_none_or(|first| first.x > 1.0) {
            points.insert(0, point(1.0, 0));
        }
        let count = ratios.partition_point(shown);
        points.push(point(largest, count));
        let label = group.methods[method].to_string();
        Series { methods: vec![method], label, style: Style::Steps, points }
    };
    Some(Figure {
        plot,
        title: format!("Performance profile, {unit}"),
        x: Axis::new(format!("multiple of the least {unit} of any method"), Scale::Log),
        y: Axis::new("trials solved", Scale::Share),
        series: ratios.iter().enumerate().map(series).collect(),
        maps: Vec::new(),
        note: format!(
            "{total} trials that all methods have. Bands: 95 % Wilson intervals, point by point. Dolan and More 2002."
        ),
    })
}
