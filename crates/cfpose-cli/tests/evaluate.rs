//! `evaluate` and `list`: what scripts read.

mod common;

use common::{Desk, apply, cloud, random_pose};
use serde_json::Value;

fn numbers(value: &Value) -> Vec<f64> {
    serde_json::from_value(value.clone()).expect("numbers")
}

#[test]
fn evaluation_is_consistent_with_itself() {
    let desk = Desk::new();
    let rows = cloud(200, 1);
    desk.write_rows("p.csv", &rows);
    desk.write_rows("q.csv", &apply(&random_pose(2, 0.2), &rows));
    let line = "evaluate --model rigid3 --source p.csv --target q.csv --features hermite[degree=3]";
    let theta = [0.3, -0.2, 0.1, 0.05, 0.0, -0.1];
    let at = |theta: &[f64]| theta.iter().map(|v| format!("{v:?}")).collect::<Vec<_>>().join(",");
    let evaluation = desk.json(&format!("{line} --at={}", at(&theta)));
    let names: Vec<&str> = evaluation.as_object().unwrap().keys().map(String::as_str).collect();
    let parts = ["model", "features", "normalise", "weighting", "noise", "nuisance"];
    assert_eq!(
        names,
        [&["theta", "residual", "jacobian", "source_means", "target_means", "cost"], &parts[..]].concat()
    );
    assert_eq!((&evaluation["model"], &evaluation["features"]), (&"rigid3".into(), &"hermite[degree=3]".into()));
    assert_eq!((&evaluation["weighting"], &evaluation["noise"]), (&"identity".into(), &"none".into()));
    let (residual, source, target) =
        (numbers(&evaluation["residual"]), numbers(&evaluation["source_means"]), numbers(&evaluation["target_means"]));
    assert_eq!([residual.len(), source.len(), target.len()], [19; 3]);
    assert!((0..19).all(|i| (source[i] - target[i] - residual[i]).abs() < 1e-12));
    let cost = 0.5 * residual.iter().map(|r| r * r).sum::<f64>();
    assert!((evaluation["cost"].as_f64().unwrap() - cost).abs() < 1e-14);
    assert!(numbers(&evaluation["theta"]).iter().zip(&theta).all(|(a, b)| (a - b).abs() < 1e-15));

    // The translation's columns against differences of residuals at theta +- h; the same theta as in a start file.
    let h = 1e-5;
    for j in 3..6 {
        let side = |sign: f64| {
            let mut moved = theta;
            moved[j] += sign * h;
            numbers(&desk.json(&format!("{line} --at {}", at(&moved)))["residual"])
        };
        let (plus, minus) = (side(1.0), side(-1.0));
        for i in 0..19 {
            let entry = numbers(&evaluation["jacobian"][i])[j];
            assert!(((plus[i] - minus[i]) / (2.0 * h) - entry).abs() < 1e-7 * (1.0 + entry.abs()), "{i} {j}");
        }
    }
    let table = desk.run(&format!("{line} --at=0,0,0,0,0,0"));
    assert!(table.out.starts_with("feature  source mean") && table.out.contains(" tz"), "{}", table.out);
}

#[test]
fn lists_name_every_entry() {
    let desk = Desk::new();
    let expected = [
        ("models", "rigid3"),
        ("families", "hermite"),
        ("solvers", "levenberg-marquardt"),
        ("normalisers", "whiten"),
        ("weightings", "identity"),
        ("starts", "pca"),
        ("presets", "paper"),
        ("formats", "ply"),
    ];
    for (kind, name) in expected {
        let list = desk.json(&format!("list {kind}"));
        let entries = list.as_array().unwrap();
        assert!(entries.iter().any(|entry| entry["name"] == name), "{list}");
        for entry in entries {
            let keys: Vec<&str> = entry.as_object().unwrap().keys().map(String::as_str).collect();
            assert_eq!(keys, ["name", "summary", "parameters", "source"]);
        }
        let table = desk.run(&format!("list {kind}"));
        assert!(table.code == 0 && entries.iter().all(|e| table.out.contains(e["name"].as_str().unwrap())));
    }
    let hermite = desk.json("list families");
    let hermite = hermite.as_array().unwrap().iter().find(|entry| entry["name"] == "hermite").unwrap();
    let degree = &hermite["parameters"][0];
    assert_eq!((&degree["name"], &degree["default"]), (&"degree".into(), &"3".into()));
    assert!(degree["meaning"].as_str().unwrap().contains("degree"));
}

#[test]
fn check_passes_on_random_and_on_given_points() {
    let desk = Desk::new();
    desk.write_rows("p.csv", &cloud(100, 3));
    for line in ["check rigid3", "check hermite[degree=2]", "check rigid3 --on p.csv"] {
        let report = desk.json(line);
        let pairs = report["pairs"].as_array().unwrap();
        assert!(pairs.iter().any(|line| line["passed"] == true), "{line}: {report}");
        assert!(pairs.iter().all(|line| line["passed"] != false), "{line}: {report}");
    }
    let report = desk.json("check levenberg-marquardt[damping=nielsen]");
    assert!(
        report["solvers"][0]["passed"] == true && report["solvers"][0]["num_cases"].as_u64() > Some(10),
        "{report}"
    );
}

#[test]
fn a_reader_that_goes_away_ends_the_program_quietly() {
    use std::io::Read;
    use std::process::{Command, Stdio};
    let mut child = Command::new(env!("CARGO_BIN_EXE_cfpose"))
        .args(["list", "families", "--json", "-"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let mut err = String::new();
    child.stderr.take().unwrap().read_to_string(&mut err).unwrap();
    assert!(child.wait().unwrap().code().is_some());
    assert_eq!(err, "");
}

#[test]
fn a_result_is_evaluated_as_it_was_minimised() {
    let desk = Desk::new();
    let rows = cloud(400, 5);
    desk.write_rows("p.csv", &rows);
    let mut moved = apply(&random_pose(6, 0.2), &rows);
    common::shuffle(&mut moved, 7);
    // A tenth of the target is clutter, so that rows are left out.
    moved.extend(cloud(40, 8).into_iter().map(|row| vec![row[0] + 3.0, row[1] - 2.0, row[2]]));
    desk.write_rows("q.csv", &moved);
    let files = "--source p.csv --target q.csv";
    for parts in ["", "--preset paper", "--weighting two-step --features hermite[degree=3]", "--free rx,ry,rz,tx"] {
        let result = desk.json(&format!("estimate --model rigid3 {files} {parts}"));
        desk.write("r.json", result.to_string());
        let evaluation = desk.json(&format!("evaluate --model rigid3 {files} --at r.json"));
        let [cost, again] = [&result, &evaluation].map(|value| value["cost"].as_f64().unwrap());
        assert!((cost - again).abs() <= 1e-9 * cost.abs(), "`{parts}`: {cost} {again}");
        if let Some(j) = result["j_statistic"].as_f64() {
            assert!((j - 2.0 * again).abs() <= 1e-9 * j, "`{parts}`: J {j}, cost {again}");
        }
        assert_eq!(evaluation["theta"], result["theta"]);
        for part in ["features", "normalise", "weighting"] {
            assert_eq!(evaluation[part], result[part]);
        }
        let width = evaluation["jacobian"][0].as_array().unwrap().len();
        let nuisance = evaluation["nuisance"].as_array().unwrap().len();
        assert_eq!(width, result["free"].as_array().unwrap().len() + nuisance);
    }
    // A result has parts of its own, and it is one of its model.
    let refused = desk.fails(2, &format!("evaluate --model rigid3 {files} --at r.json --features trig18"));
    assert!(refused.contains("--features beside a result"), "{refused}");
    let refused = desk.fails(3, &format!("evaluate --model similarity3 {files} --at r.json"));
    assert!(refused.contains("give --model 'rigid3'"), "{refused}");
}
