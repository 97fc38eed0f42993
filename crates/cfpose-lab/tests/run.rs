//! Runs: what must not change a figure, and what must be refused.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use cfpose::Isa;
use cfpose_lab::folder::read_records;
use cfpose_lab::{Experiment, Lab, Progress, Record, RunOptions, Shard, merge, run, status};

/// Cheap trials of both scenarios, two methods, one of them with random starts of its own and a budget.
const TEXT: &str = r#"
    seed = 5
    trials = 3
    [[scenario]]
    name = "cloud3"
    points = [40, 70]
    noise = 0.001
    [[scenario]]
    name = "planar-curve"
    trials = 2
    b_p = 0.01
    [[method]]
    name = "paper"
    preset = "paper"
    [[method]]
    name = "cubic, short"
    preset = "paper"
    features = "hermite[degree=3]"
    start = "grid[count=4]"
    max_evaluations = 12
"#;

/// Records of a complete run: (2 x 3 + 1 x 2) x 2.
const NUM_RECORDS: usize = 16;

fn experiment(text: &str) -> Experiment {
    Experiment::parse(&Lab::default(), text, "test.toml").unwrap()
}

fn read(folder: &Path, name: &str) -> String {
    fs::read_to_string(folder.join(name)).unwrap()
}

fn options(folder: &Path) -> RunOptions<'static> {
    RunOptions::new(folder)
}

fn by_trial(folder: &Path) -> BTreeMap<(String, String), Record> {
    let records = read_records(&folder.join("trials.jsonl")).unwrap();
    records.into_iter().map(|(_, r)| ((r.key.clone(), r.method.clone()), r)).collect()
}

#[test]
fn results_do_not_depend_on_threads_shards_or_interruptions() {
    let (lab, experiment) = (Lab::default(), experiment(TEXT));
    let whole = tempfile::tempdir().unwrap();
    let report = run(&lab, &experiment, &options(whole.path())).unwrap();
    assert_eq!((report.computed, report.records, report.cancelled), (NUM_RECORDS, NUM_RECORDS, false));
    assert_eq!(report.merged.unwrap().rows.len(), 6);
    let expected = read(whole.path(), "results.csv");
    assert_eq!(expected.lines().count(), NUM_RECORDS + 1);

    for threads in [2, 3, 7] {
        let threaded = tempfile::tempdir().unwrap();
        run(&lab, &experiment, &RunOptions { threads, ..options(threaded.path()) }).unwrap();
        assert_eq!(read(threaded.path(), "results.csv"), expected);
    }

    // Shards in one folder: the last one to end writes the tables.
    let sharded = tempfile::tempdir().unwrap();
    for index in [1, 0, 6, 4, 5, 3, 2] {
        let shard = Shard { index, count: 7 };
        let report = run(&lab, &experiment, &RunOptions { shard, ..options(sharded.path()) }).unwrap();
        assert_eq!(report.merged.is_some(), index == 2);
    }
    assert_eq!(read(sharded.path(), "results.csv"), expected);

    // Shards in folders of their own, merged twice: the same bytes.
    let machines = tempfile::tempdir().unwrap();
    for index in 0..2 {
        let out = machines.path().join(format!("machine-{index}"));
        let report = run(&lab, &experiment, &RunOptions { shard: Shard { index, count: 2 }, ..options(&out) }).unwrap();
        assert!(report.merged.is_none());
    }
    assert_eq!(merge(&lab, machines.path()).unwrap().records, NUM_RECORDS);
    assert_eq!(read(machines.path(), "results.csv"), expected);
    let names = ["records.jsonl", "summary.json", "manifest.json", "timings.csv", "report.html", "tables.md"];
    let before = names.map(|name| read(machines.path(), name));
    merge(&lab, machines.path()).unwrap();
    assert_eq!(names.map(|name| read(machines.path(), name)), before);

    // A run that was stopped and left half a line goes on where it was.
    let stopped = tempfile::tempdir().unwrap();
    let cancel = AtomicBool::new(false);
    let stop_after_three = |progress: Progress| cancel.store(progress.computed >= 6, Ordering::Relaxed);
    let limited = RunOptions { cancel: Some(&cancel), progress: Some(&stop_after_three), ..options(stopped.path()) };
    let report = run(&lab, &experiment, &limited).unwrap();
    assert!(report.cancelled && report.computed == 6 && report.merged.is_none());
    let file = stopped.path().join("trials.jsonl");
    fs::write(&file, read(stopped.path(), "trials.jsonl") + "{\"experiment\":\"").unwrap();
    assert_eq!(status(&lab, stopped.path()).unwrap().records, 6);
    let refused = run(&lab, &experiment, &options(stopped.path())).unwrap_err();
    assert!(refused.to_string().contains("already holds 6 record(s)") && refused.is_usage());
    let report = run(&lab, &experiment, &RunOptions { resume: true, ..options(stopped.path()) }).unwrap();
    assert_eq!((report.resumed, report.computed), (6, NUM_RECORDS - 6));
    assert_eq!(read(stopped.path(), "results.csv"), expected);
}

#[test]
fn a_grid_that_grows_changes_no_old_trial() {
    let lab = Lab::default();
    let (small, large) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let text = TEXT.replace("[[method]]\n    name = \"cubic, short\"", "[[method]]\n    name = \"cubic\"");
    run(&lab, &experiment(&text), &options(small.path())).unwrap();
    // More values on an axis, in another order, more trials, a default written out, a method in front.
    let grown = text
        .replace("points = [40, 70]", "points = [1000, 70, 40.0]\n    sampling = \"permutation\"")
        .replace("trials = 3", "trials = 4")
        .replacen("[[method]]", "[[method]]\n    name = \"first\"\n    normalise = \"whiten\"\n    [[method]]", 1);
    run(&lab, &experiment(&grown), &options(large.path())).unwrap();
    let (small, large) = (by_trial(small.path()), by_trial(large.path()));
    assert!(large.len() > small.len());
    for (identity, old) in &small {
        let mut new = large[identity].clone();
        new.experiment.clone_from(&old.experiment);
        assert!(new.same_result(old), "{identity:?}");
    }
    // Every method sees the same data: the one that differs in nothing but its name gives the same theta.
    let twins = "trials = 1\n[[scenario]]\nname = \"cloud3\"\npoints = 40\n\
                 [[method]]\nname = \"a\"\n[[method]]\nname = \"b\"\n";
    let folder = tempfile::tempdir().unwrap();
    run(&lab, &experiment(twins), &options(folder.path())).unwrap();
    let thetas: Vec<_> = by_trial(folder.path()).into_values().map(|r| r.theta.unwrap()).collect();
    assert_eq!(thetas[0], thetas[1]);
    // Another seed gives other data.
    let other = tempfile::tempdir().unwrap();
    run(&lab, &experiment(&format!("seed = 6\n{twins}")), &options(other.path())).unwrap();
    assert_ne!(by_trial(other.path()).into_values().next().unwrap().theta.unwrap(), thetas[0]);
}

#[test]
fn mixed_and_damaged_folders_are_refused() {
    let lab = Lab::default();
    let text = "trials = 2\n[[scenario]]\nname = \"cloud3\"\npoints = 40\n[[method]]\nname = \"paper\"\n";
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let refusal = |result: Result<cfpose_lab::Merged, cfpose_lab::LabError>| result.unwrap_err().to_string();
    assert!(refusal(merge(&lab, path)).contains("holds no experiment.toml"));
    run(&lab, &experiment(text), &options(path)).unwrap();
    let file = path.join("trials.jsonl");
    let good = fs::read_to_string(&file).unwrap();

    // Another experiment: into the same folder, as a record, as a sub-folder.
    let other = experiment(&text.replace("trials = 2", "trials = 2\nseed = 9"));
    let resume = RunOptions { resume: true, ..options(path) };
    assert!(run(&lab, &other, &resume).unwrap_err().to_string().contains("belongs to experiment"));
    let foreign = good.replace(&experiment(text).fingerprint(), &other.fingerprint());
    fs::write(path.join("trials-0-of-2.jsonl"), &foreign).unwrap();
    assert!(refusal(merge(&lab, path)).contains("belongs to experiment"));
    fs::remove_file(path.join("trials-0-of-2.jsonl")).unwrap();
    run(&lab, &other, &options(&path.join("other"))).unwrap();
    assert!(refusal(merge(&lab, path)).contains("belongs to experiment"));
    fs::remove_dir_all(path.join("other")).unwrap();

    // Another instruction set.
    let isa = format!("\"isa\":\"{}\"", Isa::detect().name());
    fs::write(path.join("trials-1-of-2.jsonl"), good.replace(&isa, "\"isa\":\"another\"")).unwrap();
    let error = refusal(merge(&lab, path));
    assert!(error.contains("another") && error.contains("run all shards with the same --isa"), "{error}");
    fs::remove_file(path.join("trials-1-of-2.jsonl")).unwrap();
    if Isa::detect() != Isa::baseline() {
        let error = run(&lab, &experiment(text), &RunOptions { isa: Isa::baseline(), ..resume }).unwrap_err();
        assert!(error.to_string().contains("instruction set"));
    }

    // A record that contradicts, a line that is none, a trial from elsewhere; a true copy is no harm.
    fs::write(path.join("trials-0-of-2.jsonl"), &good).unwrap();
    assert_eq!(merge(&lab, path).unwrap().records, 2);
    fs::write(path.join("trials-0-of-2.jsonl"), good.replace("\"evaluations\":", "\"evaluations\":9")).unwrap();
    assert!(refusal(merge(&lab, path)).contains("line 1: contradicts another record"));
    fs::remove_file(path.join("trials-0-of-2.jsonl")).unwrap();
    fs::write(&file, format!("{good}nonsense\n")).unwrap();
    assert!(refusal(merge(&lab, path)).contains("line 3: this is no record"));
    fs::write(&file, good.replace("\"key\":\"", "\"key\":\"f")).unwrap();
    assert!(refusal(merge(&lab, path)).contains("not in the experiment"));

    // What is missing is counted.
    fs::write(&file, good.lines().next().unwrap().to_string() + "\n").unwrap();
    let merged = merge(&lab, path).unwrap();
    assert_eq!((merged.records, merged.expected), (1, 2));
    assert!(read(path, "manifest.json").contains("\"complete\": false"));
    let counted = status(&lab, path).unwrap();
    assert_eq!((counted.records, counted.expected, counted.cells[0].1, counted.cells[0].2), (1, 2, 1, 2));
}

#[test]
fn the_summary_holds_what_the_contract_names() {
    let lab = Lab::default();
    let folder = tempfile::tempdir().unwrap();
    run(&lab, &experiment(TEXT), &options(folder.path())).unwrap();
    let rows: Vec<serde_json::Value> = serde_json::from_str(&read(folder.path(), "summary.json")).unwrap();
    let first = &rows[0];
    for field in [
        "scenario",
        "parameters",
        "method",
        "trials",
        "successes",
        "success_rate",
        "wilson95",
        "median_rotation_deg",
        "median_translation",
        "median_error",
        "wrong_but_good",
        "median_seconds",
    ] {
        assert!(first.get(field).is_some(), "{field}");
    }
    assert_eq!(first["parameters"]["points"], 40);
    assert_eq!(first["parameters"]["noise"], 0.001);
    // The record, the table and the page agree with the summary.
    let planar = rows.iter().find(|row| row["scenario"] == "planar-curve" && row["method"] == "paper").unwrap();
    let csv = read(folder.path(), "results.csv");
    assert!(csv.lines().any(|line| line.contains("\"cubic, short\"")) && !csv.contains("seconds"));
    let successes = by_trial(folder.path())
        .values()
        .filter(|r| r.scenario == "planar-curve" && r.method == "paper" && r.success)
        .count();
    assert_eq!(planar["successes"], successes);
    assert_eq!(planar["success_rate"].as_f64().unwrap(), successes as f64 / 2.0);
    let page = read(folder.path(), "report.html");
    assert!(page.contains("planar-curve") && !page.contains("http"));
    // A budget is a limit on evaluations: it shows as the status, four starts of at most 12 each.
    let short: Vec<Record> = by_trial(folder.path()).into_values().filter(|r| r.method == "cubic, short").collect();
    assert!(short.iter().all(|r| r.starts == 4 && r.evaluations <= 48));
}
