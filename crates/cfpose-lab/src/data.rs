//! Hashes of the files that scenarios read: results of other data are other results.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use cfpose::Registry;

use crate::error::LabError;
use crate::folder::io_error;
use crate::method::Method;
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

/// What precedes the names of files that a method reads, not a scenario.
const OF_METHOD: &str = "weights:";

/// Hash the weight files that the families of a method name, as the registry holds them.
pub(crate) fn of_method(registry: &Registry, method: &Method) -> DataHashes {
    let hash =
        |name: String| Some((format!("{OF_METHOD}{name}"), format!("{:016x}", fnv1a(registry.files.get(&name)?))));
    method.files().into_iter().filter_map(hash).collect()
}

/// Tell the files of the scenario from those of the method.
pub(crate) fn parts(data: &DataHashes) -> [DataHashes; 2] {
    let (method, scenario): (DataHashes, DataHashes) =
        data.iter().map(|(name, hash)| (name.clone(), hash.clone())).partition(|(name, _)| name.starts_with(OF_METHOD));
    [scenario, method]
}

fn hash_of(path: &Path) -> Result<String, LabError> {
    Ok(format!("{:016x}", fnv1a(&fs::read(path).map_err(io_error(path, "read"))?)))
}
