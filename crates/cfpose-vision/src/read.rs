//! The entry point of reading: from a path to points.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use cfpose::Points;

use crate::bytes::{is_piped, read_bytes};
use crate::error::{Fault, FileError, Flaw};
use crate::formats::Format;
use crate::gather::PointTable;
use crate::lookup::{GZIP, format_named, format_of, known};
use crate::options::ReadOptions;
use crate::unpack::{Unpacked, gunzip};

/// The content of a point file.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct PointFile {
    /// The points, in the units of the file.
    pub points: Points,
    /// Names of the coordinates, then `w` if the file has weights.
    pub columns: Vec<String>,
    /// Name of the format.
    pub format: &'static str,
    /// The file as it was named.
    pub path: PathBuf,
    /// Rows that were skipped because they are not finite; later rows of the file have a larger number than their point.
    pub skipped: usize,
    /// What a user should know about the reading, one line each.
    pub notes: Vec<String>,
}

/// Read a point file; its extension, in any case, chooses the format, of which [`ReadOptions::format`] can name another.
///
/// A name that ends in `.gz` is unpacked; `-` is standard input.
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
    let format = choose(path, options).map_err(|fault| fail(fault.into()))?;
    let bytes = read_bytes(path).map_err(|fault| fail(fault.into()))?;
    let table = read_as(format, &bytes, options).map_err(fail)?;
    table.points.require_spread(options.min_distinct).map_err(|error| fail(Fault::from(error).into()))?;
    let PointTable { points, columns, skipped, notes } = table;
    Ok(PointFile { points, columns, format: format.name, path: path.to_path_buf(), skipped, notes })
}

/// Choose a format by what the options say, else by the extension.
pub(crate) fn choose(path: &Path, options: &ReadOptions) -> Result<&'static Format, Fault> {
    match &options.format {
        Some(name) => format_named(name),
        None if is_piped(path) => format_of(path).map_err(|_| Fault::NoFormat { known: known() }),
        None => format_of(path),
    }
}

/// Unpack the content of a file if it is a gzip file.
pub(crate) fn unpacked(bytes: &[u8]) -> Result<Cow<'_, [u8]>, Fault> {
    match bytes.starts_with(&[0x1f, 0x8b]) {
        true => gunzip(bytes).map(Cow::Owned),
        false => Ok(Cow::Borrowed(bytes)),
    }
}

/// Read the content of a file, compressed or not, within memory that its size bounds.
pub(crate) fn read_as(format: &Format, bytes: &[u8], options: &ReadOptions) -> Result<PointTable, Flaw> {
    let Cow::Owned(plain) = unpacked(bytes)? else { return (format.read)(bytes, options) };
    let limit = Unpacked::of(bytes.len());
    // A mask has a limit of its own, and an archive in an archive unpacks twice.
    if ["mask", "npz"].contains(&format.name) {
        let what = format!("a {} file within a {GZIP} file", format.name);
        return Err(Fault::Unsupported { what, advice: "unpack it first (gunzip)" }.into());
    }
    let within = options.max_points.is_none_or(|most| most > limit.points);
    let most = if within { Some(limit.points) } else { options.max_points };
    (format.read)(&plain, &ReadOptions { max_points: most, ..options.clone() }).map_err(|flaw| match flaw.fault {
        Fault::TooMany { .. } if within => {
            Fault::Unpacks { limit: limit.points, what: "points", advice: "unpack it first (gunzip)" }.into()
        }
        _ => flaw,
    })
}
