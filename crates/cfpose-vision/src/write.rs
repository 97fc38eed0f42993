//! The entry point of writing: from points to a path.

use std::path::Path;

use cfpose::Points;

use crate::error::{Fault, FileError, Flaw};
use crate::lookup::format_of;

/// Write points; the file's extension, in any case, chooses the format.
///
/// Numbers are written so that reading them back gives the same bits. Weights are written as a column `w` unless all
/// are 1; attributes are not written.
///
/// # Errors
/// [`FileError`]: an unknown extension, a format that cannot hold these points, or what the operating system says.
pub fn write_points(path: &Path, points: &Points) -> Result<(), FileError> {
    let fail = |fault: Fault| Flaw::from(fault).in_file(path);
    let format = format_of(path).map_err(fail)?;
    if path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("gz")) {
        let what = "a gz file can be read and not written".to_string();
        return Err(fail(Fault::Unwritable { what, advice: "it without .gz" }));
    }
    let Some(write) = format.write else {
        let what = format!("a {} file can be read and not written", format.name);
        return Err(fail(Fault::Unwritable { what, advice: "csv" }));
    };
    let bytes = write(points).map_err(fail)?;
    std::fs::write(path, bytes).map_err(|error| fail(Fault::Io(error)))
}
