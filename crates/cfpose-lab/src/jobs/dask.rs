//! Dask: the commands as JSON, and the runner of `tools/`.

use serde_json::json;

use super::{Emitted, EngineEntry, JobFile, Jobs};

/// The runner; it needs Python 3 with `dask[distributed]`.
const RUNNER: &str = include_str!("../../../../tools/dask_runner.py");

fn emit(jobs: &Jobs) -> Emitted {
    let shards: Vec<Vec<String>> = (0..jobs.shards).map(|index| jobs.shard(&index.to_string())).collect();
    let value = json!({ "shards": shards, "merge": jobs.merge(), "threads": jobs.threads });
    Emitted {
        files: vec![
            JobFile { name: "jobs.json".to_string(), text: format!("{value:#}\n") },
            JobFile { name: "dask_runner.py".to_string(), text: RUNNER.to_string() },
        ],
        command: "python3 dask_runner.py jobs.json --workers 2   (or --scheduler tcp://HOST:8786)".to_string(),
    }
}

pub(super) const ENTRY: EngineEntry =
    EngineEntry { name: "dask", summary: "tasks of Dask, on local workers or a scheduler's", emit };
