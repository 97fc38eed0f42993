//! Success rates that were published elsewhere beside ours.

use crate::figure::{Axis, Figure, Point, Scale, Series, Style};
use crate::group::Group;
use crate::plots::PlotEntry;
use crate::statistics::wilson95;

/// The line of the table.
pub const ENTRY: PlotEntry =
    PlotEntry { name: "published", summary: "published success rates beside ours, cell by cell", draw };

fn draw(group: &Group<'_>) -> Option<Figure> {
    if group.published.is_empty() {
        return None;
    }
    let mut cells: Vec<usize> = group.published.iter().map(|quoted| quoted.cell).collect();
    cells.dedup();
    let place = |cell: usize| cells.iter().position(|known| *known == cell).unwrap_or(0) as f64;
    let mut series = Vec::new();
    for (method, name) in group.methods.iter().enumerate() {
        let quoted: Vec<_> = group.published.iter().filter(|quoted| quoted.method == method).collect();
        if quoted.is_empty() {
            continue;
        }
        let ours = quoted.iter().map(|quoted| {
            let mine = group.problems.iter().filter(|problem| problem.cell == quoted.cell);
            let records = mine.filter_map(|problem| problem.records[method]);
            let (hits, trials) = records.fold((0, 0), |(hits, all), r| (hits + usize::from(r.success), all + 1));
            let (y, note) = (hits as f64 / trials as f64, format!("{}: {hits} of {trials}", quoted.table));
            Point { x: place(quoted.cell), y, interval: Some(wilson95(hits, trials)), note }
        });
        let ours = ours.collect();
        let theirs = quoted.iter().map(|quoted| Point {
            x: place(quoted.cell),
            y: quoted.share,
            interval: None,
            note: quoted.table.clone(),
        });
        let theirs = theirs.collect();
        let make = |label: String, style, points| Series { methods: vec![method], label, style, points };
        series.push(make(format!("{name}, ours"), Style::Dots, ours));
        series.push(make(format!("{name}, published"), Style::Diamonds, theirs));
    }
    let names = cells.iter().filter_map(|cell| Some(group.cells[group.place(*cell)?].1.clone())).collect();
    Some(Figure {
        plot: ENTRY.name,
        title: "Published figures beside ours".to_string(),
        x: Axis::of_names("cell", names),
        y: Axis::new("trials solved", Scale::Share),
        series,
        maps: Vec::new(),
        note: "Diamonds: as published. Dots: ours, with 95 % Wilson intervals.".to_string(),
    })
}
