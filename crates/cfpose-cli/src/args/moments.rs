//! Arguments of `moments`.

use std::path::PathBuf;

use clap::Args;

use super::ReadingArgs;

/// Arguments of `moments`.
#[derive(Debug, Args)]
pub struct MomentsArgs {
    /// Point files, or with --merge moment files; - is standard input
    #[arg(value_name = "FILE", required = true)]
    pub files: Vec<PathBuf>,
    /// Add moment files about one centre; the same bytes in any order
    #[arg(long, conflicts_with_all = ["features", "model", "centre"])]
    pub merge: bool,
    /// Feature family that the moments are for, polynomials of a degree; twice that degree is summed
    #[arg(long, value_name = "F", required_unless_present = "merge")]
    pub features: Option<String>,
    /// Model that the moments are for: refuses what it cannot use
    #[arg(long, value_name = "M")]
    pub model: Option<String>,
    /// Place that the sums are about, the same for all files to be merged
    #[arg(long, value_name = "X,Y,Z", default_value = "0,0,0", allow_hyphen_values = true)]
    pub centre: String,
    /// Moment file to write
    #[arg(long, short, value_name = "P.cfm")]
    pub out: PathBuf,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub reading: ReadingArgs,
    /// Threads, all processors when not given; the result does not depend on it
    #[arg(long, value_name = "T", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Write JSON to a file, or to standard output for -
    #[arg(long, value_name = "FILE|-")]
    pub json: Option<PathBuf>,
}
