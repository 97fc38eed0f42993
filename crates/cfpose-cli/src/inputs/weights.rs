//! Files of learned weights.

use std::path::Path;
use std::sync::Arc;

use cfpose::Registry;
use cfpose::families::learned::Weights;
use cfpose_vision::Fault;

use crate::failure::Failure;

/// Return the registry with the contents of the named files; relative names stand for files in `folder`.
///
/// # Errors
/// Input, with the file's name, where it cannot be read or holds no weights.
pub fn with_files(
    registry: &Registry,
    names: impl Iterator<Item = String>,
    folder: &Path,
) -> Result<Registry, Failure> {
    let mut registry = registry.clone();
    for name in names {
        let path = folder.join(&name);
        let bytes = std::fs::read(&path)
            .map_err(|error| Failure::input(format!("{}: {}", path.display(), Fault::from(error))))?;
        Weights::from_bytes(&bytes).map_err(|error| Failure::input(format!("{}: {error}", path.display())))?;
        registry.files.insert(name, Arc::from(bytes));
    }
    Ok(registry)
}
