//! The entry point of reading: from a path to points.

use std::path::{Path, PathBuf};

use cfpose::Points;

use crate::bytes::read_bytes;
use crate::error::{Fault, FileError, Flaw};
use crate::lookup::format_of;
use crate::options::ReadOptions;

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
