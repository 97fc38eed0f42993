//! The scenario table: a new scenario is one file and one line here.

mod any_model;
mod cloud3;
mod hunt_planar;
mod hunt_space;
mod least_squares;
mod planar_curve;
mod rendered_pattern;

pub use crate::curves;
use crate::scenario::ScenarioEntry;

/// All scenarios of the laboratory.
pub const ALL: &[&ScenarioEntry] = &[
    &planar_curve::ENTRY,
    &cloud3::ENTRY,
    &any_model::ENTRY,
    &least_squares::ENTRY,
    &hunt_planar::ENTRY,
    &hunt_space::ENTRY,
    &rendered_pattern::ENTRY,
];
