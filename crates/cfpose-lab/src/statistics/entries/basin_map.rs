//! Basin maps: success over the offset of the start from the truth, in two directions.

use crate::group::Group;
use crate::statistics::{StatisticEntry, Table, TableCell, quantile, wilson95};

/// The line of the table.
pub const ENTRY: StatisticEntry = StatisticEntry {
    name: "basin-map",
    summary: "success of the quarter of the trials with the nearest starts, and of that with the farthest",
    source: "Wilson 1927; offsets are tangent coordinates of the start at the truth",
    compute,
};

/// Directions whose offsets are at least this share of the largest come in their own order.
const SAME_SPREAD: f64 = 0.8;

/// Return the two tangent directions in which starts differ most from the truth (root mean square); `None` below two directions.
///
/// Directions within a fifth of the largest count as equal and are taken in their order.
pub fn directions(group: &Group<'_>) -> Option<[String; 2]> {
    let mut spreads: Vec<(String, f64)> = Vec::new();
    for record in group.problems.iter().filter_map(|problem| problem.records.iter().flatten().next()) {
        for (name, offset) in &record.start_offset {
            match spreads.iter_mut().find(|(known, _)| known == name) {
                Some((_, sum)) => *sum += offset * offset,
                None => spreads.push((name.clone(), offset * offset)),
            }
        }
    }
    spreads.retain(|(_, sum)| *sum > 0.0);
    let mut chosen = Vec::new();
    while chosen.len() < 2 {
        let largest = spreads.iter().map(|(_, sum)| sum.sqrt()).fold(0.0, f64::max);
        let place = spreads.iter().position(|(_, sum)| sum.sqrt() >= SAME_SPREAD * largest)?;
        chosen.push(spreads.remove(place).0);
    }
    let second = chosen.pop()?;
    Some([chosen.pop()?, second])
}

/// Counts of a map of square fields.
#[derive(Debug, Clone, PartialEq)]
pub struct BasinMap {
    /// Half width of the map in both directions.
    pub half: [f64; 2],
    /// Fields along each direction.
    pub fields: usize,
    /// Successes and trials of every field, row by row from the lowest second offset.
    pub counts: Vec<(usize, usize)>,
}

/// Count successes over offsets in two directions. Offsets beyond the map count in its outermost fields.
///
/// ```
/// use cfpose_lab::statistics::entries::basin_map::count;
/// let map = count(&[([-0.9, -0.9], true), ([0.9, -0.8], false), ([0.9, -7.0], true)], [1.0, 1.0], 2);
/// assert_eq!(map.counts, [(1, 1), (1, 2), (0, 0), (0, 0)]);
/// ```
pub fn count(starts: &[([f64; 2], bool)], half: [f64; 2], fields: usize) -> BasinMap {
    let mut counts = vec![(0, 0); fields * fields];
    for (offset, success) in starts {
        let place = |axis: usize| {
            let share = 0.5 * (offset[axis] / half[axis] + 1.0);
            // A negative share saturates at 0.
            ((share * fields as f64) as usize).min(fields - 1)
        };
        let field = &mut counts[place(1) * fields + place(0)];
        *field = (field.0 + usize::from(*success), field.1 + 1);
    }
    BasinMap { half, fields, counts }
}

/// Return offsets in two directions and success of the trials of a method that have them.
pub fn starts(group: &Group<'_>, method: usize, directions: &[String; 2]) -> Vec<([f64; 2], bool)> {
    let of = |record: &crate::record::Record| {
        let offset = |direction: &String| record.start_offset.get(direction).copied();
        Some(([offset(&directions[0])?, offset(&directions[1])?], record.success))
    };
    group.of(method).filter_map(of).collect()
}

fn compute(group: &Group<'_>) -> Option<Table> {
    let row = |method: usize| {
        let norm =
            |offsets: &std::collections::BTreeMap<String, f64>| offsets.values().map(|v| v * v).sum::<f64>().sqrt();
        let with_start = group.of(method).filter(|record| !record.start_offset.is_empty());
        let starts: Vec<(f64, bool)> = with_start.map(|record| (norm(&record.start_offset), record.success)).collect();
        let norms: Vec<f64> = starts.iter().map(|(norm, _)| *norm).collect();
        let [near, far] = [quantile(&norms, 0.25)?, quantile(&norms, 0.75)?];
        let mut cells = vec![TableCell::Text(group.methods[method].to_string()), TableCell::Count(starts.len())];
        let rules: [(f64, &dyn Fn(f64) -> bool); 2] = [(near, &|norm| norm <= near), (far, &|norm| norm >= far)];
        for (bound, holds) in rules {
            let mine = starts.iter().filter(|(norm, _)| holds(*norm));
            let (hits, trials) = mine.fold((0, 0), |(hits, all), (_, success)| (hits + usize::from(*success), all + 1));
            cells.push(TableCell::Number(bound));
            cells.push(TableCell::Share(hits as f64 / trials as f64));
            cells.push(TableCell::ShareInterval(wilson95(hits, trials)));
        }
        Some(cells)
    };
    let rows: Vec<_> = (0..group.methods.len()).filter_map(row).collect();
    let columns = vec!["method", "starts", "offset up to", "success %", "95 %", "offset from", "success %", "95 %"];
    (!rows.is_empty()).then_some(Table { columns, rows })
}
