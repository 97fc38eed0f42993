//! The entry point of reading: from a path to points.

use std::path::{Path, PathBuf};

use cfpose::Points;

use crate::error::{Fault, FileError, Flaw};
use crate::formats::{FORMATS, Format};

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

/// The content of a point file.
#[derive(Debug, Clone, PartialEq)]
pub struct PointFile {
    /// The points, in the units of the file.
    pub points: Points,
    /// Names of the coordinates, then `w` if the file has weights.
    pub columns: Vec<String>,
    /// Name of the format in [`FORMATS`].
    pub format: &'static str,
    /// The file as it was named.
    pub path: PathBuf,
}

/// Read a point file; its extension, in any case, chooses the format.
///
/// # Errors
/// [`FileError`]: no such file, an unknown extension, or content that is not what the format asks for.
///
/// ```
/// use std::path::Path;
/// use cfpose_vision::{ReadOptions, read_points};
/// let error = read_points(Path::new("cloud.pyl"), &ReadOptions::default()).unwrap_err().to_string();
/// assert!(error.starts_with("cloud.pyl: no format has the extension \"pyl\" (did you mean \"ply\"?); known are csv,"));
/// ```
pub fn read_points(path: &Path, options: &ReadOptions) -> Result<PointFile, FileError> {
    let fail = |flaw: Flaw| flaw.in_file(path);
    let format = format_of(path).map_err(|fault| fail(fault.into()))?;
    let bytes = read_bytes(path).map_err(|fault| fail(fault.into()))?;
    let table = (format.read)(&bytes, options).map_err(fail)?;
    table.points.require_spread(options.min_distinct).map_err(|error| fail(Fault::from(error).into()))?;
    Ok(PointFile { points: table.points, columns: table.columns, format: format.name, path: path.to_path_buf() })
}

/// Find the format of a file name by its extension.
///
/// # Errors
/// [`Fault::Extension`] with the nearest known extension and the list of all.
pub fn format_of(path: &Path) -> Result<&'static Format, Fault> {
    let found = path.extension().map(|ext| ext.to_string_lossy().to_lowercase()).unwrap_or_default();
    if let Some(format) = FORMATS.iter().find(|format| format.extensions.contains(&found.as_str())) {
        return Ok(format);
    }
    let known: Vec<&'static str> = FORMATS.iter().flat_map(|format| format.extensions).copied().collect();
    let nearest = known.iter().map(|name| (edit_distance(&found, name), *name)).min();
    let suggestion = nearest.filter(|(distance, name)| *distance <= 2 && *distance < name.len()).map(|(_, name)| name);
    Err(Fault::Extension { found: crate::error::excerpt(&found), suggestion, known: known.join(", ") })
}

/// Read a regular file whole: memory is then bounded by what the disk really holds.
pub(crate) fn read_bytes(path: &Path) -> Result<Vec<u8>, Fault> {
    let refuse = |error: std::io::Error| match error.kind() {
        std::io::ErrorKind::NotFound => Fault::Missing,
        _ => Fault::Io(error),
    };
    if !std::fs::metadata(path).map_err(refuse)?.is_file() {
        return Err(Fault::NotAFile);
    }
    let bytes = std::fs::read(path).map_err(refuse)?;
    if bytes.is_empty() { Err(Fault::Empty) } else { Ok(bytes) }
}

/// Count the letters to insert, delete, replace or swap with a neighbour (optimal string alignment).
fn edit_distance(a: &str, b: &str) -> usize {
    let (a, b): (Vec<char>, Vec<char>) = (a.chars().take(16).collect(), b.chars().collect());
    let mut table = vec![vec![0usize; b.len() + 1]; a.len() + 1];
    for i in 0..=a.len() {
        for j in 0..=b.len() {
            table[i][j] = if i == 0 || j == 0 {
                i + j
            } else {
                let replaced = table[i - 1][j - 1] + usize::from(a[i - 1] != b[j - 1]);
                let moved = replaced.min(table[i - 1][j] + 1).min(table[i][j - 1] + 1);
                let swapped = i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1];
                if swapped { moved.min(table[i - 2][j - 2] + 1) } else { moved }
            };
        }
    }
    table[a.len()][b.len()]
}
