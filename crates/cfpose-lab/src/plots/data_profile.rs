//! Data profiles: trials solved within a budget of evaluations.

use crate::figure::{Axis, Figure, Point, Scale, Series, Style};
use crate::group::Group;
use crate::plots::PlotEntry;
use crate::statistics::entries::data_profile::{budgets, solved};
use crate::statistics::wilson95;

/// The line of the table.
pub const ENTRY: PlotEntry = PlotEntry {
    name: "data-profile",
    summary: "share of the trials solved within a budget of evaluations (More and Wild)",
    draw,
};

fn draw(group: &Group<'_>) -> Option<Figure> {
    let all: Vec<Vec<f64>> = (0..group.methods.len()).map(|method| budgets(&solved(group, method))).collect();
    let finite = || all.iter().flatten().copied().filter(|budget| budget.is_finite());
    let (first, last) = (finite().fold(f64::INFINITY, f64::min), finite().fold(0.0, f64::max));
    if last == 0.0 {
        return None;
    }
    let series = |(method, budgets): (usize, &Vec<f64>)| {
        let total = budgets.len();
        let point = |x: f64, count: usize| Point {
            x,
            y: count as f64 / total as f64,
            interval: Some(wilson95(count, total)),
            note: format!("{count} of {total}"),
        };
        let mut points: Vec<Point> = vec![point(0.9 * first, 0)];
        for (index, budget) in budgets.iter().enumerate().filter(|(_, budget)| budget.is_finite()) {
            points.pop_if(|last| last.x == *budget);
            points.push(point(*budget, index + 1));
        }
        points.push(point(last, budgets.partition_point(|budget| budget.is_finite())));
        let label = group.methods[method].to_string();
        Series { methods: vec![method], label, style: Style::Steps, points }
    };
    Some(Figure {
        plot: ENTRY.name,
        title: "Data profile".to_string(),
        x: Axis::new("evaluations / (unknowns + 1)", Scale::Log),
        y: Axis::new("trials solved", Scale::Share),
        series: all.iter().enumerate().map(series).collect(),
        maps: Vec::new(),
        note: "Bands: 95 % Wilson intervals, point by point. More and Wild 2009.".to_string(),
    })
}
