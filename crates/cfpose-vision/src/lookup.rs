//! From a name to a format.

use std::path::Path;

use crate::error::Fault;
use crate::formats::{FORMATS, Format};

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
