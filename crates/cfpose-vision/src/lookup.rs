//! From a name to a format.

use std::path::Path;

use crate::error::Fault;
use crate::formats::{FORMATS, Format};

/// Find the format of a file name by its extension; `.gz` after it does not count.
///
/// # Errors
/// [`Fault::Extension`] with the nearest known extension and the list of all.
pub fn format_of(path: &Path) -> Result<&'static Format, Fault> {
    let name = path.file_name().map(|name| name.to_string_lossy().to_lowercase()).unwrap_or_default();
    let name = name.strip_suffix(GZIP).unwrap_or(&name);
    let extension = Path::new(name).extension().map(|ext| ext.to_string_lossy().into_owned()).unwrap_or_default();
    format_named(&extension)
}

/// Find a format by one of its extensions, in any case; `.gz` after it does not count.
///
/// # Errors
/// [`Fault::Extension`] with the nearest known extension and the list of all.
///
/// ```
/// assert_eq!(cfpose_vision::format_named("CSV").unwrap().name, "text");
/// assert!(cfpose_vision::format_named("cvs").unwrap_err().to_string().contains("did you mean \"csv\"?"));
/// ```
pub fn format_named(extension: &str) -> Result<&'static Format, Fault> {
    let lower = extension.to_lowercase();
    let found = lower.strip_suffix(GZIP).unwrap_or(&lower);
    if let Some(format) = FORMATS.iter().find(|format| format.extensions.contains(&found)) {
        return Ok(format);
    }
    let extensions = FORMATS.iter().flat_map(|format| format.extensions);
    let nearest = extensions.map(|name| (edit_distance(found, name), *name)).min();
    let suggestion = nearest.filter(|(distance, name)| *distance <= 2 && *distance < name.len()).map(|(_, name)| name);
    Err(Fault::Extension { found: crate::error::excerpt(found), suggestion, known: known() })
}

/// What a compressed file is called after its format.
pub(crate) const GZIP: &str = ".gz";

/// List every extension.
pub(crate) fn known() -> String {
    let known: Vec<&'static str> = FORMATS.iter().flat_map(|format| format.extensions).copied().collect();
    known.join(", ")
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
