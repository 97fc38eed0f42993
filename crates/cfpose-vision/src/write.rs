//! The entry point of writing: from points to a path.

use std::path::Path;

use cfpose::Points;

use crate::error::{Fault, FileError, Flaw};
use crate::read::format_of;

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
    let Some(write) = format.write else {
        let what = format!("a {} file can be read and not written", format.name);
        return Err(fail(Fault::Unwritable { what, advice: "csv" }));
    };
    let bytes = write(points).map_err(fail)?;
    std::fs::write(path, bytes).map_err(|error| fail(Fault::Io(error)))
}

/// Return the names of the columns to write: the coordinates, then `w` if the weights differ from 1.
pub(crate) fn column_names(points: &Points) -> Vec<&'static str> {
    let mut names = vec!["x", "y", "z"];
    names.truncate(points.dim());
    if !points.is_uniform() {
        names.push("w");
    }
    names
}

/// Write one row a line, the columns of [`column_names`] with a separator between them, in the shortest decimal that
/// reads back to the same bits.
pub(crate) fn rows(points: &Points, separator: &str, prefix: &str) -> String {
    let mut text = String::new();
    for k in 0..points.len() {
        let mut values: Vec<f64> = points.point(k)[..points.dim()].to_vec();
        if !points.is_uniform() {
            values.push(points.weights()[k]);
        }
        let fields: Vec<String> = values.iter().map(|value| format!("{value:?}")).collect();
        text.push_str(prefix);
        text.push_str(&fields.join(separator));
        text.push('\n');
    }
    text
}
