//! Moments as files: the same bytes in any parts and order, the estimate of the points, refusals; job files of an experiment in shards.

mod common;

use std::io::Write;
use std::process::{Command, Stdio};

use common::{Desk, apply, cloud, degrees_between, euler_pose, pose_of, shuffle};
use serde_json::{Value, json};

/// A cloud, and its image under a pose with noise, in another order.
fn desk() -> Desk {
    let source = cloud(3000, 5);
    let mut target = apply(&euler_pose(ANGLES, SHIFT), &source);
    target.iter_mut().enumerate().for_each(|(k, p)| p[k % 3] += 0.003 * (k as f64 * 0.7).sin());
    shuffle(&mut target, 6);
    let desk = Desk::new();
    desk.write_rows("p.csv", &source);
    desk.write_rows("q.csv", &target);
    desk
}

const ANGLES: [f64; 3] = [0.2, -0.15, 0.1];
const SHIFT: [f64; 3] = [0.1, -0.05, 0.2];

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
}

fn distance(a: &Value, b: &Value) -> f64 {
    numbers(a).iter().zip(numbers(b)).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

#[test]
fn an_estimate_from_moments_is_that_from_the_points() {
    let desk = desk();
    for side in ["p", "q"] {
        desk.json(&format!("moments {side}.csv --features hermite[degree=3] --model rigid3 -o {side}.cfm"));
    }
    for (model, preset) in [("rigid3", "paper"), ("similarity3", "paper"), ("affine3", "paper")] {
        let common = format!("estimate --model {model} --preset {preset} --features hermite[degree=3]");
        let points = desk.json(&format!("{common} --source p.csv --target q.csv"));
        let moments = desk.json(&format!("{common} --source-moments p.cfm --target-moments q.cfm"));
        let apart = distance(&points["theta"], &moments["theta"]);
        assert!(apart < 1e-9, "{model}: {apart:e}");
        assert_eq!((&moments["verdict"], &moments["num_source"]), (&Value::Null, &json!(3000)));
    }
    // With the weights of the covariance: a statistic, and never more than suspect.
    let weighted = desk.json("estimate --model rigid3 --source-moments p.cfm --target-moments q.cfm");
    assert_eq!((&weighted["verdict"], &weighted["features"]), (&json!("suspect"), &json!("hermite[degree=3]")));
    assert_eq!((&weighted["weighting"], &weighted["starts"]), (&json!("two-step"), &json!(4)));
    let turned = degrees_between(&pose_of(&weighted["pose"]), &euler_pose(ANGLES, SHIFT));
    assert!(turned < 0.5, "{turned} degrees");
    let covariance = &weighted["covariance"];
    assert!((0..6).all(|i| covariance[i][i].as_f64().unwrap() > 0.0), "{weighted}");
    // Exact second derivatives come from moments too.
    let newton = "estimate --model rigid3 --preset paper --source-moments p.cfm --target-moments q.cfm --solver newton-trust-region";
    let points = "estimate --model rigid3 --preset paper --features hermite[degree=3] --source p.csv --target q.csv --solver newton-trust-region";
    assert!(distance(&desk.json(newton)["theta"], &desk.json(points)["theta"]) < 1e-8);
}

#[test]
fn parts_in_any_order_and_from_a_pipe_give_the_same_bytes() {
    let desk = desk();
    let text = desk.read("p.csv");
    let lines: Vec<&str> = text.lines().collect();
    desk.json("moments p.csv --features monomial[degree=2] --centre 0.5,0,0 -o whole.cfm");
    let whole = std::fs::read(desk.path("whole.cfm")).unwrap();
    let shards = 7;
    for shard in 0..shards {
        let rows: Vec<&str> = lines.iter().skip(shard).step_by(shards).copied().collect();
        desk.write(&format!("{shard}.xyz"), &(rows.join("\n") + "\n"));
        desk.json(&format!(
            "moments {shard}.xyz --features monomial[degree=2] --centre 0.5,0,0 -o {shard}.cfm --threads 1"
        ));
    }
    desk.json("moments --merge 3.cfm 1.cfm 6.cfm -o a.cfm");
    desk.json("moments --merge 5.cfm 0.cfm a.cfm 4.cfm 2.cfm -o merged.cfm");
    assert_eq!(std::fs::read(desk.path("merged.cfm")).unwrap(), whole);
    desk.json(
        "moments 0.xyz 1.xyz 2.xyz 3.xyz 4.xyz 5.xyz 6.xyz --features monomial[degree=2] --centre 0.5,0,0 -o all.cfm",
    );
    assert_eq!(std::fs::read(desk.path("all.cfm")).unwrap(), whole);
    let arguments = "moments - --format csv --features monomial[degree=2] --centre 0.5,0,0 -o piped.cfm";
    let mut piped = Command::new(env!("CARGO_BIN_EXE_cfpose"))
        .args(arguments.split_whitespace())
        .current_dir(desk.path(""))
        .stdin(Stdio::piped())
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    piped.stdin.take().unwrap().write_all(text.as_bytes()).unwrap();
    assert!(piped.wait().unwrap().success());
    assert_eq!(std::fs::read(desk.path("piped.cfm")).unwrap(), whole);
    // The same points as an array of numpy.
    let values: Vec<u8> = lines
        .iter()
        .flat_map(|line| line.split(',').map(|x| x.parse::<f64>().unwrap().to_le_bytes()).collect::<Vec<_>>())
        .flatten()
        .collect();
    let dict = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({}, 3), }}", lines.len());
    let head = [b"\x93NUMPY\x01\x00".as_slice(), &(dict.len() as u16).to_le_bytes(), dict.as_bytes()].concat();
    std::fs::write(desk.path("p.npy"), [head, values].concat()).unwrap();
    desk.json("moments p.npy --features monomial[degree=2] --centre 0.5,0,0 -o array.cfm");
    assert_eq!(std::fs::read(desk.path("array.cfm")).unwrap(), whole);
}

#[test]
fn what_cannot_be_used_is_refused_in_one_line() {
    let desk = desk();
    desk.json("moments p.csv --features hermite[degree=3] -o p.cfm");
    desk.json("moments p.csv --features hermite[degree=3] --centre 1,0,0 -o other.cfm");
    let bytes = std::fs::read(desk.path("p.cfm")).unwrap();
    std::fs::write(desk.path("cut.cfm"), &bytes[..bytes.len() / 2]).unwrap();
    let mut changed = bytes.clone();
    changed[100] ^= 1;
    std::fs::write(desk.path("changed.cfm"), changed).unwrap();
    desk.write("q.cfm", "x,y,z\n1,2,3\n");
    let estimate = "estimate --model rigid3 --source-moments p.cfm --target-moments";
    for (line, code, words) in [
        (
            "moments --merge p.cfm other.cfm -o m.cfm".to_string(),
            3,
            "other.cfm: the centres differ: 1,0,0, and 0,0,0 in p.cfm",
        ),
        ("moments --merge p.cfm cut.cfm -o m.cfm".to_string(), 3, "cut.cfm: the moment file is damaged"),
        ("moments p.csv --features trig18 -o m.cfm".to_string(), 2, "polynomials"),
        ("moments p.csv --features hermite[degree=3] --model bearing3 -o m.cfm".to_string(), 2, "--model bearing3"),
        ("moments p.csv -o m.cfm".to_string(), 2, "--features"),
        ("moments p.csv --features hermite[degree=3] --thin auto -o m.cfm".to_string(), 2, "--thin"),
        ("moments none.csv --features hermite[degree=3] -o m.cfm".to_string(), 3, "none.csv: there is no such file"),
        (format!("{estimate} changed.cfm"), 3, "changed.cfm: the moment file is damaged"),
        (format!("{estimate} q.cfm"), 3, "q.cfm: this is no moment file"),
        (format!("{estimate} p.cfm --features trig18"), 2, "polynomials"),
        (format!("{estimate} p.cfm --features hermite[degree=4]"), 2, "degree 8"),
        (format!("{estimate} p.cfm --weighting continuously-updated"), 2, "needs the points"),
        (format!("{estimate} p.cfm --plot x.svg"), 2, "--plot"),
        ("estimate --model rigid3 --source-moments p.cfm --target q.csv".to_string(), 2, "target"),
        (
            "estimate --model rigid2 --source-moments p.cfm --target-moments p.cfm".to_string(),
            3,
            "p.cfm: source points have 3",
        ),
    ] {
        let run = desk.run(&line);
        assert_eq!(run.code, code, "{line}: {}", run.err);
        assert!(run.err.contains(words), "{line}: {}", run.err);
        assert!(code == 2 || run.err.trim_end().lines().count() == 1, "{line}: {}", run.err);
    }
    assert!(!desk.path("m.cfm").exists());
}

#[test]
fn planned_shards_merge_to_the_bytes_of_one_run() {
    let desk = Desk::new();
    desk.write(
        "e.toml",
        "seed = 3\ntrials = 12\n[[scenario]]\nname = \"cloud3\"\npoints = 60\n[[method]]\nname = \"paper\"\npreset = \"paper\"\n",
    );
    desk.json("run e.toml --out whole");
    let planned = desk.json("plan e.toml --shards 7 --emit parallel --out parts --jobs jobs");
    assert_eq!((&planned["shards"], &planned["records"]), (&json!(7), &json!(12)));
    // What GNU parallel does: each line is a command; one of them twice, as after a kill.
    let commands = desk.read("jobs/shards.txt");
    let commands: Vec<&str> = commands.lines().collect();
    assert_eq!(commands.len(), 7);
    for command in commands.iter().rev().chain(&commands[2..3]) {
        let run = Command::new("sh").args(["-c", command]).stdout(Stdio::null()).status().unwrap();
        assert!(run.success(), "{command}");
    }
    let merge = desk.read("jobs/run.sh");
    let merge = merge.lines().last().unwrap().trim_start_matches("exec ");
    assert!(Command::new("sh").args(["-c", merge]).stdout(Stdio::null()).status().unwrap().success());
    assert_eq!(desk.read("parts/results.csv"), desk.read("whole/results.csv"));
    for (engine, file, words) in [
        ("slurm", "shards.sbatch", "#SBATCH --array=0-2"),
        ("dask", "jobs.json", "\"--shard\",\n      \"2/3\""),
        ("snakemake", "Snakefile", "{wildcards.index}/3"),
    ] {
        desk.json(&format!("plan e.toml --shards 3 --emit {engine} --jobs {engine}"));
        let text = desk.read(&format!("{engine}/{file}"));
        assert!(text.contains(words), "{text}");
    }
    assert!(desk.fails(2, "plan e.toml --shards 13 --emit slurm").contains("12 trials"));
    assert!(desk.fails(2, "plan e.toml --shards 3 --emit pbs").contains("slurm, parallel, dask, snakemake"));
}
