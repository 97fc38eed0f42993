//! Time against the number of points, with the fitted power law.

use crate::figure::{Axis, Figure, Point, Scale, Series, Style};
use crate::group::Group;
use crate::plots::PlotEntry;
use crate::statistics::entries::exponent::{law, times};

/// The line of the table.
pub const ENTRY: PlotEntry = PlotEntry {
    name: "time-over-points",
    summary: "median time against the number of points, with the fitted exponent",
    draw,
};

/// Points of a fitted curve.
const SAMPLES: usize = 24;

fn draw(group: &Group<'_>) -> Option<Figure> {
    let (mut series, mut words) = (Vec::new(), Vec::new());
    for (method, name) in group.methods.iter().enumerate() {
        let times = times(group, method);
        let Some(law) = law(&times) else { continue };
        let [low, high] = law.interval;
        words.push(format!("{name}: exponent {:.3} ({low:.3} .. {high:.3})", law.exponent));
        let (first, last) = (times[0].0, times[times.len() - 1].0);
        let fitted = (0..SAMPLES).map(|k| first * (last / first).powf(k as f64 / (SAMPLES - 1) as f64)).map(|x| {
            let (y, interval) = law.at(x);
            Point { x, y, interval: Some(interval), note: String::new() }
        });
        let fitted = fitted.collect();
        let dots = times.iter().map(|(x, y)| Point { x: *x, y: *y, interval: None, note: String::new() }).collect();
        let make = |label: String, style, points| Series { methods: vec![method], label, style, points };
        series.push(make(format!("{name}, fit"), Style::Line, fitted));
        series.push(make((*name).to_string(), Style::Dots, dots));
    }
    (!series.is_empty()).then(|| Figure {
        plot: ENTRY.name,
        title: "Time against the number of points".to_string(),
        x: Axis::new("source points", Scale::Log),
        y: Axis::new("seconds, median of a cell", Scale::Log),
        series,
        maps: Vec::new(),
        note: format!("{}. Bands: 95 % intervals of the fitted line.", words.join("; ")),
    })
}
