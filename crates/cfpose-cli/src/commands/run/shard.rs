//! Which part of a run this process computes: given, or from the environment of a job array.

use std::path::Path;

use cfpose_lab::Shard;

use crate::failure::Failure;

/// Variables that launchers set: index and count of a process.
const LAUNCHERS: [(&str, &str); 4] = [
    ("SLURM_PROCID", "SLURM_NTASKS"),
    ("OMPI_COMM_WORLD_RANK", "OMPI_COMM_WORLD_SIZE"),
    ("PMI_RANK", "PMI_SIZE"),
    ("CFPOSE_SHARD", "CFPOSE_SHARDS"),
];

/// Index of a task in its Slurm array.
const ARRAY_TASK: &str = "SLURM_ARRAY_TASK_ID";

/// Read `I/N`, `auto` (index and count of a regular array) or `auto/N` (the index is the number of the task, from 0).
///
/// `out` is the folder of the run: the shards that it holds say of how many an array was.
pub(super) fn parse(
    text: Option<&str>,
    out: &Path,
    variable: impl Fn(&str) -> Option<String>,
) -> Result<Shard, Failure> {
    let Some(text) = text else { return Ok(Shard::WHOLE) };
    let number = |name: &str| variable(name).and_then(|value| value.trim().parse::<usize>().ok());
    if let Some(count) = text.strip_prefix("auto/") {
        return numbered(count, number);
    }
    if text != "auto" {
        return Ok(text.parse()?);
    }
    if let Some(task) = number(ARRAY_TASK) {
        let shard = of_array(task, &number)?;
        return same_count(shard, task, out);
    }
    for (index, count) in LAUNCHERS {
        if let (Some(index), Some(count)) = (number(index), number(count)) {
            return Ok(format!("{index}/{count}").parse()?);
        }
    }
    let names: Vec<&str> = [ARRAY_TASK].into_iter().chain(LAUNCHERS.map(|(index, _)| index)).collect();
    Err(Failure::usage(format!("--shard auto: none of {} is set; give --shard I/N", names.join(", "))))
}

/// Return the shard of `auto/N`.
fn numbered(count: &str, number: impl Fn(&str) -> Option<usize>) -> Result<Shard, Failure> {
    let indices = [ARRAY_TASK].into_iter().chain(LAUNCHERS.map(|(index, _)| index));
    let Some(index) = indices.clone().find_map(number) else {
        let names: Vec<&str> = indices.collect();
        return Err(Failure::usage(format!(
            "--shard auto/{count}: none of {} is set; give --shard I/N",
            names.join(", ")
        )));
    };
    match count.trim().parse::<usize>() {
        Ok(count) if index < count => Ok(Shard { index, count }),
        Ok(count) if count > 0 => Err(Failure::usage(format!(
            "--shard auto/{count}: this is task {index}, and tasks count from 0; submit the array as 0-{}",
            count - 1
        ))),
        _ => Err(Failure::usage(format!("--shard auto/{count}: N is a whole number above 0"))),
    }
}

/// Return the shard of a task of a Slurm array that is regular: first, first + step, first + 2 step, ..
fn of_array(task: usize, number: &impl Fn(&str) -> Option<usize>) -> Result<Shard, Failure> {
    let get = |name: &str| number(&format!("SLURM_ARRAY_TASK_{name}"));
    let count = get("COUNT").unwrap_or(0);
    let (first, step) = (get("MIN").unwrap_or(0), get("STEP").unwrap_or(1).max(1));
    let last = get("MAX").unwrap_or(first + count.saturating_sub(1) * step);
    let is_regular = count > 0
        && task >= first
        && (task - first).is_multiple_of(step)
        && last == first + (count - 1) * step
        && task <= last
        && (count > 1 || task == 0);
    if !is_regular {
        return Err(Failure::usage(format!(
            "--shard auto: task {task} belongs to an array of {count} task(s) that is a part of another; \
             give --shard auto/N with the number N of all tasks, numbered from 0"
        )));
    }
    Ok(Shard { index: (task - first) / step, count })
}

/// Refuse an array of another size than the one whose shards are there: it may be a part of that one.
fn same_count(shard: Shard, task: usize, out: &Path) -> Result<Shard, Failure> {
    let files = if out.is_dir() { cfpose_lab::folder::record_files(out)? } else { Vec::new() };
    let count = |path: &std::path::PathBuf| {
        let name = path.file_stem()?.to_str()?;
        name.rsplit_once("-of-")?.1.parse::<usize>().ok()
    };
    match files.iter().filter_map(count).find(|count| *count != shard.count) {
        None => Ok(shard),
        Some(other) => Err(Failure::usage(format!(
            "--shard auto: this array has {} task(s), and {} holds shards of {other}; give --shard auto/{other} where task {task} \
             is one of those, or --shard {shard}",
            shard.count,
            out.display()
        ))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Return the shard in the environment of a Slurm array.
    fn slurm(text: &str, out: &Path, [task, count, first, last, step]: [usize; 5]) -> Result<Shard, String> {
        let variable = |name: &str| {
            let value = match name.strip_prefix("SLURM_ARRAY_TASK_")? {
                "ID" => task,
                "COUNT" => count,
                "MIN" => first,
                "MAX" => last,
                "STEP" => step,
                _ => return None,
            };
            Some(value.to_string())
        };
        parse(Some(text), out, variable).map_err(|failure| failure.message())
    }

    #[test]
    fn a_shard_comes_from_the_job_array() {
        let nowhere = Path::new("no-such-folder");
        let slurm = |text, array| slurm(text, nowhere, array);
        assert_eq!(slurm("auto", [3, 4, 1, 4, 1]), Ok(Shard { index: 2, count: 4 }));
        assert_eq!(slurm("0/2", [3, 4, 1, 4, 1]), Ok(Shard { index: 0, count: 2 }));
        assert_eq!(parse(None, nowhere, |_| None).unwrap(), Shard::WHOLE);
        assert!(parse(Some("auto"), nowhere, |_| None).unwrap_err().message().contains("SLURM_ARRAY_TASK_ID"));
        let launched = |name: &str| {
            [("PMI_RANK", "1"), ("PMI_SIZE", "3")]
                .iter()
                .find(|(key, _)| *key == name)
                .map(|(_, value)| (*value).to_string())
        };
        assert_eq!(parse(Some("auto"), nowhere, launched).unwrap(), Shard { index: 1, count: 3 });
    }

    #[test]
    fn arrays_with_steps_and_single_tasks_do_what_was_meant() {
        let nowhere = Path::new("no-such-folder");
        let meant = |text, array| slurm(text, nowhere, array);
        // --array=0-30:10
        assert_eq!(meant("auto", [20, 4, 0, 30, 10]), Ok(Shard { index: 2, count: 4 }));
        // Task 7 alone, and tasks 3 and 7: of how many is not known, unless it is said.
        for array in [[7, 1, 7, 7, 1], [3, 2, 3, 7, 1], [7, 2, 3, 7, 1]] {
            assert!(meant("auto", array).unwrap_err().contains("--shard auto/N"));
        }
        assert_eq!(meant("auto/8", [7, 1, 7, 7, 1]), Ok(Shard { index: 7, count: 8 }));
        assert_eq!(meant("auto/8", [3, 2, 3, 7, 1]), Ok(Shard { index: 3, count: 8 }));
        assert!(meant("auto/8", [8, 8, 1, 8, 1]).unwrap_err().contains("submit the array as 0-7"));
        assert!(meant("auto/x", [0, 1, 0, 0, 1]).unwrap_err().contains("a whole number"));
        // Tasks 3 and 4 again, in a folder that says that there were eight.
        let folder = std::env::temp_dir().join(format!("cfpose-shards-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        std::fs::write(folder.join("trials-0-of-8.jsonl"), "").unwrap();
        let refused = slurm("auto", &folder, [3, 2, 3, 4, 1]).unwrap_err();
        std::fs::remove_dir_all(&folder).unwrap();
        assert!(refused.contains("--shard auto/8"), "{refused}");
        assert_eq!(meant("auto", [3, 2, 3, 4, 1]), Ok(Shard { index: 0, count: 2 }));
    }
}
