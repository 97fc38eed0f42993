//! Hashes of the files that scenarios read: results of other data are other results.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use crate::error::LabError;
use crate::folder::io_error;
use crate::record::DataHashes;
use crate::scenario::Scenario;
use crate::seed::fnv1a;

/// Hash the files of every scenario; a file that several read is read once.
///
/// # Errors
/// [`LabError::Io`] for a file that cannot be read.
pub(crate) fn hashes(scenarios: &[Box<dyn Scenario>]) -> Result<Vec<DataHashes>, LabError> {
    let mut known: BTreeMap<PathBuf, String> = BTreeMap::new();
    scenarios
        .iter()
        .map(|scenario| {
            let mut all = DataHashes::new();
            for path in scenario.files() {
                let hash = match known.get(&path) {
                    Some(hash) => hash.clone(),
                    None => known.entry(path.clone()).or_insert(hash_of(&path)?).clone(),
                };
                let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
                all.entry(name).and_modify(|other| *other += &format!("+{hash}")).or_insert(hash);
            }
            Ok(all)
        })
        .collect()
}

fn hash_of(path: &Path) -> Result<String, LabError> {
    Ok(format!("{:016x}", fnv1a(&fs::read(path).map_err(io_error(path, "read"))?)))
}
