//! What a reader may be told.

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

/// What a reader may be told.
///
/// ```
/// use cfpose_vision::{Foreground, ReadOptions};
/// let options = ReadOptions { foreground: Foreground::Dark, ..ReadOptions::default() };
/// assert_eq!((options.threshold, options.min_distinct), (127, 2));
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ReadOptions {
    /// Which pixels of a mask are its points.
    pub foreground: Foreground,
    /// Largest grey value (0 to 255) that still counts as dark.
    pub threshold: u8,
    /// Number of points, not all equal, that the file must hold at least; 0 and 1 accept any file with a point.
    pub min_distinct: usize,
}

impl Default for ReadOptions {
    /// Automatic foreground, threshold 127, at least two distinct points.
    fn default() -> Self {
        Self { foreground: Foreground::Auto, threshold: 127, min_distinct: 2 }
    }
}
