//! The program has its own entries in every command.

use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;

fn run(folder: &Path, line: &str) -> Output {
    let program =
        Command::new(env!("CARGO_BIN_EXE_own-lab")).args(line.split_whitespace()).current_dir(folder).output();
    program.expect("the program starts")
}

fn json(folder: &Path, line: &str) -> Value {
    let output = run(folder, &format!("{line} --json -"));
    assert_eq!(output.status.code(), Some(0), "{line}: {}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).expect("JSON")
}

fn fails(folder: &Path, line: &str) -> String {
    let output = run(folder, line);
    assert_eq!(output.status.code(), Some(2), "{line}");
    String::from_utf8(output.stderr).expect("UTF-8")
}

#[test]
fn lists_show_own_entries_beside_the_shipped_ones() {
    let folder = tempfile::tempdir().unwrap();
    let tables = [
        ("models", "stretch2", "rigid3"),
        ("families", "bumps", "trig18"),
        ("solvers", "delayed-gratification", "gauss-newton"),
        ("scenarios", "leaf", "planar-curve"),
    ];
    for (table, own, shipped) in tables {
        let list = json(folder.path(), &format!("list {table}"));
        for name in [own, shipped] {
            assert!(list.as_array().unwrap().iter().any(|entry| entry["name"] == name), "{table}: {name}");
        }
    }
}

/// Write an outline and its image under theta = (0.3, 1.2, 0.8, 0.5, -0.4), in another order.
fn write_points(folder: &Path) -> [f64; 5] {
    let theta = [0.3_f64, 1.2, 0.8, 0.5, -0.4];
    let (sine, cosine) = theta[0].sin_cos();
    let (mut source, mut target) = (String::new(), Vec::new());
    for k in 0..500 {
        let phi = f64::from(k) * std::f64::consts::TAU / 500.0;
        let radius = 1.0 + 0.4 * phi.cos() + 0.2 * (2.0 * phi).sin();
        let (x, y) = (1.5 * radius * phi.cos(), radius * phi.sin());
        source += &format!("{x},{y}\n");
        let (x, y) = (theta[1] * x, theta[2] * y);
        target.push(format!("{},{}\n", cosine * x - sine * y + theta[3], sine * x + cosine * y + theta[4]));
    }
    target.rotate_left(123);
    std::fs::write(folder.join("p.csv"), source).unwrap();
    std::fs::write(folder.join("q.csv"), target.concat()).unwrap();
    theta
}

#[test]
fn estimate_finds_a_known_theta_with_own_entries_alone() {
    let folder = tempfile::tempdir().unwrap();
    let truth = write_points(folder.path());
    let files = "estimate --model stretch2 --source p.csv --target q.csv";
    for rest in [
        "--preset paper --features bumps --solver delayed-gratification",
        "--features bumps[count=6] --solver delayed-gratification[lower=5]",
        "--preset paper --features orthonormalised[basis=bumps] --solver multi-start[solver=delayed-gratification,starts=2]",
    ] {
        let result = json(folder.path(), &format!("{files} {rest}"));
        for (j, truth) in truth.iter().enumerate() {
            let found = result["theta"][j].as_f64().unwrap();
            assert!((found - truth).abs() < 1e-6, "{rest}: theta_{j} = {found}, {truth}");
        }
    }
    let result = json(
        folder.path(),
        "evaluate --model stretch2 --source p.csv --target q.csv --preset paper --features bumps --at 0.3,1.2,0.8,0.5,-0.4",
    );
    assert!(result["cost"].as_f64().unwrap() < 1e-20);
}

#[test]
fn own_entries_pass_the_checks_that_all_entries_pass() {
    let folder = tempfile::tempdir().unwrap();
    for (name, table) in [("stretch2", "pairs"), ("bumps", "pairs"), ("delayed-gratification", "solvers")] {
        let report = json(folder.path(), &format!("check {name}"));
        assert!(!report[table].as_array().unwrap().is_empty(), "{name}");
    }
}

#[test]
fn a_run_compares_own_and_shipped_methods() {
    let folder = tempfile::tempdir().unwrap();
    let experiment = Path::new(env!("CARGO_MANIFEST_DIR")).join("compare.toml");
    let report = json(folder.path(), &format!("run {} --trials 5 --out out", experiment.display()));
    let rows = report["summary"].as_array().unwrap();
    assert_eq!(rows.len(), (2 + 1 + 1 + 2) * 3);
    for row in rows {
        assert_eq!(row["trials"], 5);
        assert!(row["median_error"].as_f64().unwrap() < 0.05, "{row}");
    }
    let of = |scenario: &str| rows.iter().find(|row| row["scenario"] == scenario).unwrap();
    let names = |row: &Value| -> Vec<String> {
        row["metrics"].as_array().unwrap().iter().map(|m| m["name"].as_str().unwrap().to_string()).collect()
    };
    // Metrics of its own, those of a model of its own in a shipped scenario, and of problems.
    assert_eq!(names(of("leaf")), ["misfit", "stretch", "shift"]);
    assert_eq!(names(of("any-model")), ["rotation_deg", "translation", "error", "transfer"]);
    assert_eq!(names(of("beacons")), ["misfit", "north"]);
    assert_eq!(of("beacons")["metrics"][1]["smaller_is_better"], false);
    assert_eq!(names(of("least-squares")), ["excess", "digits"]);
    assert!(of("least-squares")["metrics"][1]["median"].as_f64().unwrap() > 4.0);
    // What reads the folder again knows the scenario too.
    assert_eq!(&json(folder.path(), "merge out"), &report["summary"]);
    assert_eq!(json(folder.path(), "status out")["complete"], true);
}

#[test]
fn help_version_and_suggestions_are_those_of_the_program() {
    let folder = tempfile::tempdir().unwrap();
    let help = String::from_utf8(run(folder.path(), "--help").stdout).unwrap();
    assert!(help.contains("Usage: own-lab <COMMAND>"), "{help}");
    let help = String::from_utf8(run(folder.path(), "estimate --help").stdout).unwrap();
    assert!(help.contains("Usage: own-lab estimate"), "{help}");
    let version = String::from_utf8(run(folder.path(), "--version").stdout).unwrap();
    assert!(version.starts_with("own-lab ") && version.contains("cfpose"), "{version}");
    let message = fails(folder.path(), "check stretch");
    assert!(message.contains("did you mean stretch2?") && message.contains("`own-lab list models`"), "{message}");
    assert!(fails(folder.path(), "demo --scenario lef").contains("did you mean leaf?"));
    assert!(fails(folder.path(), "bogus").contains("own-lab"));
}
