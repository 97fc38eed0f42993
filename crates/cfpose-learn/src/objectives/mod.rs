//! The table of objectives. A new objective is one file here and one line in [`ALL`].

mod contraction;
mod covariance;
mod influence;
mod star_convexity;

use crate::objective::ObjectiveEntry;

/// All objectives.
pub const ALL: &[&ObjectiveEntry] =
    &[&contraction::ENTRY, &star_convexity::ENTRY, &covariance::ENTRY, &influence::ENTRY];
