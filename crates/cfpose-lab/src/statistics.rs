//! Statistics of an experiment: a table of statistics, each one file in `statistics/entries/` and one line in [`ALL`].
//!
//! A statistic turns the trials of a [`Group`] into a small table. The arithmetic stands beside it as a function of plain numbers
//! (a p-value, an interval, a share), which the plots use too. What several share: `proportion`, `quantile`, `holm`,
//! [`bootstrap`].

pub mod bootstrap;
mod cell;
pub mod entries;
pub mod holm;
mod proportion;
mod quantile;

pub use cell::{Table, TableCell};
pub use holm::holm;
pub use proportion::wilson95;
pub use quantile::{median, quantile};

pub(crate) use proportion::Z_975;

use crate::group::Group;

/// One line of the table of statistics.
///
/// ```
/// use cfpose_lab::statistics;
/// let names: Vec<&str> = statistics::ALL.iter().map(|entry| entry.name).collect();
/// assert!(names.contains(&"mcnemar") && names.contains(&"exponent"));
/// ```
#[derive(Debug, Clone, Copy)]
pub struct StatisticEntry {
    /// Name, kebab-case, equal to its file name.
    pub name: &'static str,
    /// One line for lists and captions.
    pub summary: &'static str,
    /// Reference.
    pub source: &'static str,
    /// Compute the table; `None` where the trials cannot tell (one method alone, no offsets, one number of points).
    pub compute: fn(&Group<'_>) -> Option<Table>,
}

/// All statistics, in the order of the report.
pub static ALL: &[StatisticEntry] = &[
    entries::success::ENTRY,
    entries::median::ENTRY,
    entries::mcnemar::ENTRY,
    entries::wilcoxon::ENTRY,
    entries::performance_profile::ENTRY,
    entries::data_profile::ENTRY,
    entries::basin_map::ENTRY,
    entries::convergence::ENTRY,
    entries::exponent::ENTRY,
];
