//! Experiments on correspondence-free pose estimation: scenarios, trials, records, statistics, reports.
//!
//! An experiment is data: a file that names scenarios with grids of parameters and methods to compare
//! ([`config::Experiment`]). [`run::run`] computes its trials into a folder, [`merge::merge`] turns the records of one or
//! many shards into tables, [`merge::status`] counts what is there.
//!
//! * [`scenario`]: what an author of a scenario writes, [`metric`]: what it measures; [`scenarios`]: the table.
//! * [`seed`]: why growing a grid changes no old trial.
//! * [`statistics`], [`calibration`], [`summary`], [`table`], [`report`], [`plot`]: what comes out;
//!   [`group`], [`plots`], [`figure`]: which trials are compared, and how that is drawn.
//!
//! The crate never parses arguments.

pub mod calibration;
mod cell;
pub mod conditions;
pub mod config;
pub mod curves;
mod data;
pub mod error;
pub mod figure;
pub mod folder;
pub mod group;
pub mod growth;
pub mod jobs;
pub mod lab;
pub mod merge;
pub mod method;
pub mod metric;
pub mod paired;
mod path;
pub mod plan;
pub mod plot;
pub mod plots;
pub mod record;
pub mod rendered;
pub mod report;
pub mod rows;
pub mod run;
mod sampling;
pub mod scenario;
pub mod scenarios;
pub mod seed;
mod shapes;
mod shard;
pub mod statistics;
pub mod summary;
pub mod table;
mod trial;
mod value;

/// The random numbers of scenarios, in the versions that [`Scenario::trial`] takes.
pub use rand_chacha::{self, ChaCha12Rng};
pub use {rand, rand_distr};

pub use config::Experiment;
pub use error::LabError;
pub use lab::Lab;
pub use merge::{FolderStatus, Merged, merge, status};
pub use method::Method;
pub use metric::{Metric, Score};
pub use plan::{Cell, Plan, Shard};
pub use record::Record;
pub use rows::Rows;
pub use run::{Exported, Progress, Replay, RunOptions, RunReport, export, replay, run};
pub use scenario::{Determined, Scenario, ScenarioEntry, ScenarioError, Success, Trial, problems};
pub use summary::{SummaryRow, summarise};
pub use trial::{nearest_score, nearest_truth};

#[cfg(doctest)]
#[doc = include_str!("../../../docs/adding/scenario.md")]
mod adding_a_scenario {}

#[cfg(doctest)]
#[doc = include_str!("../../../docs/adding/plot.md")]
mod adding_a_plot {}

#[cfg(doctest)]
#[doc = include_str!("../../../docs/experiments.md")]
mod experiments {}
