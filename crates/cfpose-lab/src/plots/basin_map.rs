//! Basin maps: success over the offset of the start in two directions, one map a method.

use crate::figure::{Axis, FieldMap, Figure, Scale};
use crate::group::Group;
use crate::plots::PlotEntry;
use crate::statistics::entries::basin_map::{count, directions, starts};
use crate::statistics::{quantile, wilson95};

/// The line of the table.
pub const ENTRY: PlotEntry =
    PlotEntry { name: "basin-map", summary: "success over the offset of the start in two directions", draw };

/// Trials that a field should hold on average, and the least and most fields along an axis.
const PER_FIELD: f64 = 12.0;
const FIELDS: [f64; 2] = [5.0, 15.0];

fn draw(group: &Group<'_>) -> Option<Figure> {
    let directions = directions(group)?;
    let all: Vec<_> = (0..group.methods.len()).map(|method| starts(group, method, &directions)).collect();
    // Wide enough for 98 % of the starts; the others count in the outermost fields.
    let half = |axis: usize| {
        let sizes: Vec<f64> = all.iter().flatten().map(|(offset, _)| offset[axis].abs()).collect();
        quantile(&sizes, 0.98).filter(|size| *size > 0.0)
    };
    let half = [half(0)?, half(1)?];
    let most = all.iter().map(Vec::len).max()? as f64;
    // Odd, so that a field has the truth in its middle.
    let fields = 2 * ((most / PER_FIELD).sqrt().clamp(FIELDS[0], FIELDS[1]) as usize / 2) + 1;
    let with_starts = all.iter().enumerate().filter(|(_, starts)| !starts.is_empty());
    let maps = with_starts.map(|(method, starts)| {
        let counts = count(starts, half, fields).counts;
        let intervals = counts.iter().map(|(hits, trials)| wilson95(*hits, *trials)).collect();
        FieldMap { method, label: group.methods[method].to_string(), half, fields, counts, intervals }
    });
    let maps = maps.collect();
    let [first, second] = directions;
    Some(Figure {
        plot: ENTRY.name,
        title: "Basin".to_string(),
        x: Axis::new(format!("offset of the start along {first}"), Scale::Linear),
        y: Axis::new(format!("along {second}"), Scale::Linear),
        series: Vec::new(),
        maps,
        note: "Offsets are tangent coordinates of the start at the truth, in the two directions in which starts differ most; \
               the outermost fields hold what lies beyond. Blue: always, orange: never. Hover for counts and 95 % Wilson intervals."
            .to_string(),
    })
}
