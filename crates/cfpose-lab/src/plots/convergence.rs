//! Convergence curves: cost over evaluations.

use crate::figure::{Axis, Figure, Point, Scale, Series, Style};
use crate::group::Group;
use crate::plots::PlotEntry;
use crate::record::BUDGETS;
use crate::statistics::entries::convergence::curve;

/// The line of the table.
pub const ENTRY: PlotEntry =
    PlotEntry { name: "convergence", summary: "median cost over evaluations, relative to the start", draw };

/// Costs below this share of the first are drawn at it.
const FLOOR: f64 = 1e-16;

fn draw(group: &Group<'_>) -> Option<Figure> {
    let longest = group.problems.iter().flat_map(|p| p.records.iter().flatten()).map(|r| r.trace.len()).max()?;
    let budgets: Vec<usize> = (0..longest).collect();
    let series = |(method, name): (usize, &&str)| {
        let point = |(place, (middle, interval)): (usize, (f64, [f64; 2]))| Point {
            x: BUDGETS[place] as f64,
            y: middle.max(FLOOR),
            interval: Some(interval.map(|end| end.max(FLOOR))),
            note: String::new(),
        };
        let points = curve(group, method, &budgets).into_iter().enumerate().map(point).collect();
        Series { methods: vec![method], label: (*name).to_string(), style: Style::Line, points }
    };
    let series: Vec<Series> = group.methods.iter().enumerate().map(series).filter(|s| !s.points.is_empty()).collect();
    (!series.is_empty()).then(|| Figure {
        plot: ENTRY.name,
        title: "Convergence".to_string(),
        x: Axis::new("residual evaluations of the first solve", Scale::Log),
        y: Axis::new("lowest cost / cost at the start, median", Scale::Log),
        series,
        maps: Vec::new(),
        note: "Bands: 95 % bootstrap intervals of the median. Each method counts its own cost.".to_string(),
    })
}
