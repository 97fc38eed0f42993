//! One file a statistic: its arithmetic and its line of the table.

pub mod basin_map;
pub mod convergence;
pub mod data_profile;
pub mod exponent;
pub mod mcnemar;
pub mod median;
pub mod performance_profile;
pub mod success;
pub mod wilcoxon;
