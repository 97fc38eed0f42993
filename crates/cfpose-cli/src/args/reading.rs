//! Arguments of how point files are read.

use clap::{Args, ValueEnum};

/// How point files are read.
#[derive(Debug, Default, Args)]
#[command(next_help_heading = "Reading of both files")]
pub struct ReadingArgs {
    /// The coordinates: 1 to 3 columns by name, or by number from 1
    #[arg(long, value_name = "A,B[,C]", value_delimiter = ',')]
    pub columns: Vec<String>,
    /// The weight: a column by name, or by number from 1; w when not given
    #[arg(long, value_name = "W")]
    pub weight_column: Option<String>,
    /// Format of standard input, of pipes and of files without a known extension; else of both files
    #[arg(long, value_name = "F")]
    pub format: Option<String>,
    /// Rows that are not finite; when not given, rows without any coordinate are skipped and others refused
    #[arg(long, value_name = "skip|refuse")]
    pub invalid: Option<InvalidRows>,
    /// Most points of a file
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub max_points: Option<u64>,
    /// Keep one point in each cell of this size (units of the file), or, with auto, of cells that leave about 20000 points
    #[arg(long, value_name = "SIZE|auto")]
    pub thin: Option<Thin>,
    /// Weights of the points: those of the file, by density (the length or area that each point stands for), or none
    #[arg(long, value_name = "file|density|none")]
    pub weights: Option<Weights>,
    /// Largest grey value of a mask that still is dark, 0 to 255, or otsu
    #[arg(long, value_name = "T|otsu")]
    pub threshold: Option<cfpose_vision::Threshold>,
    /// Side of the threshold that is the region of a mask; found by the border when not given
    #[arg(long, value_name = "dark|bright")]
    pub foreground: Option<Side>,
}

/// How many points of a file are kept.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Thin {
    /// About 20000.
    Auto,
    /// One in each cell of this size.
    Cells(f64),
}

impl std::str::FromStr for Thin {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "auto" {
            return Ok(Self::Auto);
        }
        let size = text.parse::<f64>().ok().filter(|size| *size > 0.0 && size.is_finite());
        size.map(Self::Cells).ok_or_else(|| "expected a size above 0, such as --thin 0.05, or auto".to_string())
    }
}

/// Where weights come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Weights {
    /// The file, 1 where it has none.
    File,
    /// The length or area that each point stands for.
    Density,
    /// All are 1.
    None,
}

/// What happens to rows that are not finite.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum InvalidRows {
    /// They are skipped.
    Skip,
    /// They are an error.
    Refuse,
}

/// A side of the threshold of a mask.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Side {
    /// At or below it.
    Dark,
    /// Above it.
    Bright,
}
