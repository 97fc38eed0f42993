//! Snakemake: a rule for the shards and one for the merge.

use super::{Emitted, EngineEntry, JobFile, Jobs, shell};

/// Write a text as a Python string; braces are doubled, because Snakemake fills them in.
fn python(text: &str) -> String {
    let escaped: String = text
        .chars()
        .map(|c| match c {
            '\\' => "\\\\".to_string(),
            '"' => "\\\"".to_string(),
            '\n' => "\\n".to_string(),
            '{' => "{{".to_string(),
            '}' => "}}".to_string(),
            other => other.to_string(),
        })
        .collect();
    format!("\"{escaped}\"")
}

fn emit(jobs: &Jobs) -> Emitted {
    // The index is the only thing that Snakemake puts in.
    let command = python(&shell(&jobs.shard("SHARD-INDEX"))).replace("SHARD-INDEX", "{wildcards.index}");
    let text = format!(
        "# Run: snakemake --cores all --retries 5\n\nrule merged:\n    input: expand(\"done/shard-{{index}}\", index=range({shards}))\n    \
         output: touch(\"done/merged\")\n    shell: {merge}\n\nrule shard:\n    output: touch(\"done/shard-{{index}}\")\n    threads: {threads}\n    \
         shell: {command}\n",
        shards = jobs.shards,
        merge = python(&shell(&jobs.merge())),
        threads = jobs.threads,
    );
    Emitted {
        files: vec![JobFile { name: "Snakefile".to_string(), text }],
        command: "snakemake --cores all --retries 5".to_string(),
    }
}

pub(super) const ENTRY: EngineEntry =
    EngineEntry { name: "snakemake", summary: "rules for the shards and the merge", emit };
