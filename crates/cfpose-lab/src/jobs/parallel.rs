//! GNU parallel: on one machine, or on several by its own --sshloginfile.

use super::{Emitted, EngineEntry, JobFile, Jobs, shell};

fn emit(jobs: &Jobs) -> Emitted {
    // One complete command a line: nothing has to be put in by another rule of quoting. Without a shell between, who kills the job kills it.
    let line = |index: usize| format!("exec {}\n", shell(&jobs.shard(&index.to_string())));
    let lines: Vec<String> = (0..jobs.shards).map(line).collect();
    let run = format!(
        "#!/bin/sh\n# Run the shards, a killed one up to 5 times, then merge. Arguments go to parallel: -j 4, --sshloginfile nodes, ..\nset -e\n\
         cd \"$(dirname \"$0\")\"\nparallel --will-cite --retries 5 --joblog shards.log \"$@\" < shards.txt\nexec {}\n",
        shell(&jobs.merge())
    );
    Emitted {
        files: vec![
            JobFile { name: "shards.txt".to_string(), text: lines.concat() },
            JobFile { name: "run.sh".to_string(), text: run },
        ],
        command: "sh run.sh".to_string(),
    }
}

pub(super) const ENTRY: EngineEntry =
    EngineEntry { name: "parallel", summary: "GNU parallel with retries, on one machine or by ssh on several", emit };
