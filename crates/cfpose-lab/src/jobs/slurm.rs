//! A Slurm job array, and a merge that waits for it.

use super::{Emitted, EngineEntry, JobFile, Jobs, shell};

fn emit(jobs: &Jobs) -> Emitted {
    let name = jobs.name();
    let (last, threads) = (jobs.shards - 1, jobs.threads);
    // Slurm starts a task anew after a lost node (requeue); the shard then goes on where it was.
    let shards = format!(
        "#!/bin/sh\n#SBATCH --job-name={name}\n#SBATCH --array=0-{last}\n#SBATCH --ntasks=1\n#SBATCH --cpus-per-task={threads}\n\
         #SBATCH --requeue\n#SBATCH --open-mode=append\n#SBATCH --output=shard-%a.log\nexec {}\n",
        shell(&jobs.shard("auto"))
    );
    let merge = format!(
        "#!/bin/sh\n#SBATCH --job-name={name}-merge\n#SBATCH --ntasks=1\n#SBATCH --output=merge.log\nexec {}\n",
        shell(&jobs.merge())
    );
    let submit = "#!/bin/sh\n# Submit the array, and the merge behind it. Tasks that failed: submit again, what is there stays.\nset -e\ncd \"$(dirname \"$0\")\"\n\
                  array=$(sbatch --parsable shards.sbatch)\nsbatch --parsable --dependency=afterok:\"$array\" merge.sbatch\n";
    let file = |name: &str, text: String| JobFile { name: name.to_string(), text };
    Emitted {
        files: vec![file("shards.sbatch", shards), file("merge.sbatch", merge), file("submit.sh", submit.to_string())],
        command: "sh submit.sh".to_string(),
    }
}

pub(super) const ENTRY: EngineEntry =
    EngineEntry { name: "slurm", summary: "a job array, and a merge that depends on it (sbatch)", emit };
