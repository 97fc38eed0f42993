//! Success rates by cell, with Wilson's interval.

use crate::figure::{Axis, Figure, Point, Scale, Series, Style};
use crate::group::Group;
use crate::plots::{PlotEntry, place_names, place_of};
use crate::statistics::wilson95;

/// The line of the table.
pub const ENTRY: PlotEntry = PlotEntry { name: "success", summary: "success rate of every method in every cell", draw };

fn draw(group: &Group<'_>) -> Option<Figure> {
    let x = place_names(group)?;
    let series = |(method, name): (usize, &&str)| {
        let mut counts = vec![(0, 0); group.cells.len()];
        for problem in &group.problems {
            if let (Some(record), Some(place)) = (problem.records[method], group.place(problem.cell)) {
                counts[place].0 += usize::from(record.success);
                counts[place].1 += 1;
            }
        }
        let point = |(place, (hits, trials)): (usize, &(usize, usize))| Point {
            x: place_of(group, place, method),
            y: *hits as f64 / *trials as f64,
            interval: Some(wilson95(*hits, *trials)),
            note: format!("{hits} of {trials}"),
        };
        let points = counts.iter().enumerate().filter(|(_, (_, trials))| *trials > 0).map(point).collect();
        Series { methods: vec![method], label: (*name).to_string(), style: Style::Dots, points }
    };
    Some(Figure {
        plot: ENTRY.name,
        title: "Success".to_string(),
        x,
        y: Axis::new("trials solved", Scale::Share),
        series: group.methods.iter().enumerate().map(series).collect(),
        maps: Vec::new(),
        note: "Bars: 95 % Wilson intervals.".to_string(),
    })
}
