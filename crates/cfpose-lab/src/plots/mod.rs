//! The plots of a report: each one file here and one line in [`ALL`].
//!
//! A plot turns the trials of a [`Group`] into a [`Figure`]: data, which the report draws in the browser and `report --svg` writes for
//! a paper. So a new plot needs no drawing code.

mod basin_map;
mod convergence;
mod data_profile;
mod errors;
mod mcnemar;
mod medians;
mod performance_profile;
mod published;
mod success;
mod time_over_points;
mod wilcoxon;

use crate::figure::{Axis, Figure};
use crate::group::Group;

/// One line of the table of plots.
///
/// ```
/// use cfpose_lab::plots;
/// let names: Vec<&str> = plots::ALL.iter().map(|entry| entry.name).collect();
/// assert!(names.contains(&"performance-profile") && names.contains(&"basin-map"));
/// ```
#[derive(Debug, Clone, Copy)]
pub struct PlotEntry {
    /// Name, kebab-case, unique.
    pub name: &'static str,
    /// One line for lists.
    pub summary: &'static str,
    /// Draw the figure; `None` where the trials have nothing to show.
    pub draw: fn(&Group<'_>) -> Option<Figure>,
}

/// All plots, in the order of the report.
pub static ALL: &[PlotEntry] = &[
    success::ENTRY,
    published::ENTRY,
    medians::ERROR,
    medians::EVALUATIONS,
    medians::SECONDS,
    errors::ENTRY,
    mcnemar::ENTRY,
    wilcoxon::ENTRY,
    performance_profile::EVALUATIONS,
    performance_profile::SECONDS,
    data_profile::ENTRY,
    basin_map::ENTRY,
    convergence::ENTRY,
    time_over_points::ENTRY,
];

/// Most cells side by side; the cells of a larger grid are looked at one by one.
const MAX_CELLS: usize = 400;

/// Return the axis of a plot by cell; a single cell gives its methods places of their own. `None` for too many cells.
fn place_names(group: &Group<'_>) -> Option<Axis> {
    match group.cells.as_slice() {
        [_] => Some(Axis::of_names("method", group.methods.iter().map(|name| (*name).to_string()).collect())),
        cells if cells.len() > MAX_CELLS => None,
        cells => Some(Axis::of_names("cell", cells.iter().map(|(_, name)| name.clone()).collect())),
    }
}

/// Return the place of a cell's method on that axis.
fn place_of(group: &Group<'_>, cell: usize, method: usize) -> f64 {
    (if group.cells.len() == 1 { method } else { cell }) as f64
}
