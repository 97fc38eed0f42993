//! What a reader may be told.

use std::str::FromStr;

/// Which pixels of a mask are its points.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Foreground {
    /// The side, bright or dark, to which at most half of the pixels on the image's border belong; bright if that is
    /// true of both.
    #[default]
    Auto,
    /// Pixels above the threshold.
    Bright,
    /// Pixels at or below the threshold.
    Dark,
}

/// Largest grey value (0 to 255) of a mask that still counts as dark.
///
/// ```
/// use cfpose_vision::Threshold;
/// assert_eq!("90".parse(), Ok(Threshold::Grey(90)));
/// assert_eq!("otsu".parse(), Ok(Threshold::Otsu));
/// assert!("256".parse::<Threshold>().unwrap_err().contains("0 to 255"));
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Threshold {
    /// 127; in an image of labels 0, 1, .., none of them above 127, the label 0, with a note.
    #[default]
    Auto,
    /// This value.
    Grey(u8),
    /// The value that separates the grey values best: largest variance between the two classes (N. Otsu, 1979).
    Otsu,
}

impl FromStr for Threshold {
    type Err = String;

    /// Read `otsu`, `auto` or a whole number from 0 to 255.
    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "auto" => Ok(Self::Auto),
            "otsu" => Ok(Self::Otsu),
            _ => {
                text.parse().map(Self::Grey).map_err(|_| format!("`{text}` is neither otsu nor a grey value, 0 to 255"))
            }
        }
    }
}

/// What happens to rows whose coordinates are not finite numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Invalid {
    /// A row that has no coordinate at all (all NaN; in an organised cloud: one that is not finite) is a missing point and
    /// skipped; any other such row is an error.
    #[default]
    Missing,
    /// Every such row is skipped, also one with an empty field or `NA` in place of a number.
    Skip,
    /// Every such row is an error.
    Refuse,
}

/// Most foreground pixels of a mask that are read when [`ReadOptions::max_points`] does not say otherwise (2048 x 2048).
pub const MASK_POINTS: usize = 1 << 22;

/// What a reader may be told.
///
/// ```
/// use cfpose_vision::{Foreground, ReadOptions, Threshold};
/// let options = ReadOptions { foreground: Foreground::Dark, ..ReadOptions::default() };
/// assert_eq!((options.threshold, options.min_distinct), (Threshold::Auto, 2));
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ReadOptions {
    /// Which pixels of a mask are its points.
    pub foreground: Foreground,
    /// Largest grey value (0 to 255) that still counts as dark.
    pub threshold: Threshold,
    /// Number of points, not all equal, that the file must hold at least; 0 and 1 accept any file with a point.
    pub min_distinct: usize,
    /// The coordinates, 1 to 3 columns by their name in the file or their number from 1; empty: by their names.
    pub columns: Vec<String>,
    /// The weight, a column by its name or its number from 1; `None`: the column `w` if there is one.
    pub weight_column: Option<String>,
    /// What happens to rows that are not finite.
    pub invalid: Invalid,
    /// Most points that are read; `None`: as many as the file holds, of a mask [`MASK_POINTS`].
    pub max_points: Option<usize>,
    /// Extension that names the format, instead of the file's own: for pipes, and for files without a known extension.
    pub format: Option<String>,
}

impl Default for ReadOptions {
    /// Automatic foreground and threshold, at least two distinct points, columns by their names.
    fn default() -> Self {
        Self {
            foreground: Foreground::Auto,
            threshold: Threshold::Auto,
            min_distinct: 2,
            columns: Vec::new(),
            weight_column: None,
            invalid: Invalid::Missing,
            max_points: None,
            format: None,
        }
    }
}
