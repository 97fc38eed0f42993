//! Arguments of `pose`.

use std::path::PathBuf;

use clap::{Args, Subcommand, ValueEnum};

/// Arguments of `pose`.
#[derive(Debug, Args)]
pub struct PoseArgs {
    /// What to do.
    #[command(subcommand)]
    pub command: PoseCommand,
}

/// The commands of `pose`.
#[derive(Debug, Subcommand)]
pub enum PoseCommand {
    /// Convert poses (4x4, 3x4, TUM, KITTI, JSON) to standard output
    Convert {
        /// File of poses
        file: PathBuf,
        /// Form to write
        #[arg(long)]
        to: PoseTarget,
    },
}

/// Forms of pose files.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum PoseTarget {
    /// 4x4 matrices
    Matrix,
    /// time tx ty tz qx qy qz qw
    Tum,
    /// 3x4 row by row
    Kitti,
    /// JSON with the convention
    Json,
}
