//! Rows of other programs: exported points, imported thetas, the scenario's own rule for all.

use std::fs;
use std::path::Path;

use cfpose_lab::{Experiment, Lab, Rows, RunOptions, export, run, status};
use serde_json::{Value, json};

const TEXT: &str = "trials = 3\n[[scenario]]\nname = \"any-model\"\nmodel = \"rigid3\"\npoints = 50\nstart = 0.05\n\
                    [[method]]\nname = \"ours\"\npreset = \"paper\"\nfeatures = \"hermite[degree=3]\"\n\
                    [[method]]\nname = \"theirs\"\nexternal = true\n";

fn lines(path: &Path) -> Vec<Value> {
    fs::read_to_string(path).unwrap().lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

#[test]
fn rows_of_other_programs_are_measured_like_our_own() {
    let lab = Lab::default();
    let experiment = Experiment::parse(&lab, TEXT, "rows.toml").unwrap();
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data");
    let exported = export(&lab, &experiment, &data).unwrap();
    assert_eq!((exported.trials, exported.without_points), (3, 0));
    let trials = lines(&data.join("trials.jsonl"));
    for trial in &trials {
        for side in ["source", "target"] {
            let text = fs::read_to_string(data.join(trial[side].as_str().unwrap())).unwrap();
            assert_eq!(text.lines().count(), 51, "{text}");
        }
        assert_eq!((trial["truth"].as_array().unwrap().len(), trial["start"].as_array().unwrap().len()), (6, 6));
    }
    // Right, wrong, and nothing.
    let mut wrong = trials[1]["truth"].clone();
    wrong[3] = json!(wrong[3].as_f64().unwrap() + 1.0);
    let rows = [
        json!({ "key": trials[0]["key"], "method": "theirs", "theta": trials[0]["truth"], "seconds": 1.5, "verdict": "good" }),
        json!({ "key": trials[1]["key"], "method": "theirs", "theta": wrong, "verdict": "good" }),
        json!({ "key": trials[2]["key"], "method": "theirs", "theta": null, "usable": false, "message": "no pose" }),
    ];
    let file = folder.path().join("rows.jsonl");
    let write =
        |rows: &[Value]| fs::write(&file, rows.iter().map(|row| format!("{row}\n")).collect::<String>()).unwrap();
    write(&rows);

    // Without rows our own method runs, and nothing of it counts as missing.
    let out = folder.path().join("out");
    let report = run(&lab, &experiment, &RunOptions::new(&out)).unwrap();
    assert_eq!((report.computed, report.missing, report.records, report.expected), (3, 0, 3, 6));
    assert!(report.merged.is_none() && !report.cancelled);
    let loaded = Rows::load(&file, &experiment).unwrap();
    let report =
        run(&lab, &experiment, &RunOptions { rows: Some(&loaded), resume: true, ..RunOptions::new(&out) }).unwrap();
    assert_eq!((report.computed, report.resumed, report.missing), (3, 3, 0));
    let summary = report.merged.unwrap().rows;
    assert_eq!((summary[0].successes, summary[1].successes, summary[1].wrong_but_good), (3, 1, 1));
    let first = summary[1].metrics.iter().find(|metric| metric.name == "transfer").unwrap();
    assert!(
        first.median.is_some_and(|median| median > 0.1),
        "one right, one wrong, one without: the wrong one is the median"
    );
    let records = cfpose_lab::folder::read_records(&out.join("trials.jsonl")).unwrap();
    let theirs: Vec<_> = records.iter().map(|(_, record)| record).filter(|record| record.method == "theirs").collect();
    assert!(theirs[0].success && theirs[0].seconds == 1.5 && theirs[0].error.unwrap() < 1e-9);
    assert_eq!((theirs[2].usable, theirs[2].message.as_deref()), (false, Some("no pose")));
    assert_eq!(status(&lab, &out).unwrap().records, 6);

    // What is no row is named with its line.
    for (row, words) in [
        (json!({ "key": "0", "method": "ours", "theta": null }), "line 1: `ours` is no method with `external = true`"),
        (json!({ "key": "0", "method": "theirs" , "theta": null, "verdict": "fine" }), "the verdict is none of"),
        (json!({ "key": "0" }), "this is no row"),
    ] {
        write(&[row]);
        let error = Rows::load(&file, &experiment).unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
    }
    write(&[rows[0].clone(), rows[0].clone()]);
    assert!(Rows::load(&file, &experiment).unwrap_err().to_string().contains("a second row"));
}
