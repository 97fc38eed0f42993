//! Runs that cannot be lost: killed, looked at while they compute, started twice, on a full disk, grown.
//!
//! `CFPOSE_KILLS=100` kills a run a hundred times instead of a few.

mod common;

use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::Duration;

use common::Desk;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha12Rng;
use serde_json::json;

/// An experiment that lasts about a second on one thread.
const EXPERIMENT: &str = "seed = 3\ntrials = 150\n[[scenario]]\nname = \"cloud3\"\npoints = [40, 200]\nnoise = 0.001\n\
                          [[method]]\nname = \"paper\"\npreset = \"paper\"\n\
                          [[method]]\nname = \"cubic, m\u{fc}de\"\npreset = \"paper\"\nfeatures = \"hermite[degree=3]\"\n";

/// Records of the experiment.
const NUM_RECORDS: usize = 600;

/// Moments at which a run is killed or looked at.
fn moments() -> usize {
    std::env::var("CFPOSE_KILLS").ok().and_then(|text| text.parse().ok()).unwrap_or(6)
}

fn desk() -> Desk {
    let desk = Desk::new();
    desk.write("e.toml", EXPERIMENT);
    desk
}

/// Return what an undisturbed run writes.
fn undisturbed(desk: &Desk) -> String {
    assert_eq!(desk.json("run e.toml --out whole --threads 2")["records"], NUM_RECORDS);
    desk.read("whole/results.csv")
}

fn start(desk: &Desk, line: &str) -> Child {
    let mut command = Command::new(env!("CARGO_BIN_EXE_cfpose"));
    command.args(line.split_whitespace()).current_dir(desk.path("")).stdout(Stdio::null()).stderr(Stdio::piped());
    command.spawn().expect("the program starts")
}

/// Wait for a program and return its exit code and what it said.
fn end(child: Child) -> (Option<i32>, String) {
    let output = child.wait_with_output().expect("the program ends");
    (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
}

/// Return the names in a folder that are not in `other`.
fn strangers(desk: &Desk, folder: &str, other: &str) -> Vec<String> {
    let names = |folder: &str| -> Vec<String> {
        let entries = std::fs::read_dir(desk.path(folder)).expect("a folder");
        entries.map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned()).collect()
    };
    let known = names(other);
    names(folder).into_iter().filter(|name| !known.contains(name)).collect()
}

#[test]
fn a_run_that_is_killed_at_any_moment_goes_on_and_loses_nothing() {
    let desk = desk();
    let expected = undisturbed(&desk);
    let mut rng = ChaCha12Rng::seed_from_u64(1);
    let mut most = 0;
    for _ in 0..moments() {
        let mut child = start(&desk, "run e.toml --out killed --resume --threads 1");
        sleep(Duration::from_secs_f64(rng.random_range(0.0..0.4)));
        child.kill().expect("the program is there");
        let (code, said) = end(child);
        assert!(code.is_none() || code == Some(0), "{said}");
        if !desk.path("killed/experiment.toml").exists() {
            continue;
        }
        let there = desk.json("status killed")["records"].as_u64().expect("a number");
        assert!(there >= most, "{there} of {most} records are left");
        most = there;
        if most == NUM_RECORDS as u64 {
            std::fs::remove_dir_all(desk.path("killed")).expect("a folder");
            most = 0;
        }
    }
    let last = desk.json("run e.toml --out killed --resume --threads 2");
    assert_eq!((&last["complete"], &last["missing"]), (&json!(true), &json!(0)));
    assert_eq!(desk.read("killed/results.csv"), expected);
    assert_eq!(desk.read("killed/manifest.json"), desk.read("whole/manifest.json"));
    assert_eq!(strangers(&desk, "killed", "whole"), Vec::<String>::new());
}

#[test]
fn readers_beside_a_run_change_nothing() {
    let desk = desk();
    let expected = undisturbed(&desk);
    let mut rng = ChaCha12Rng::seed_from_u64(2);
    for shards in [1, 2] {
        let out = format!("read{shards}");
        let line = |i| format!("run e.toml --out {out} --threads 1 --shard {i}/{shards}");
        let runs: Vec<Child> = (0..shards).map(|i| start(&desk, &line(i))).collect();
        let mut looked = 0;
        while looked < 3 * moments() {
            sleep(Duration::from_secs_f64(rng.random_range(0.0..0.05)));
            if desk.path(&format!("{out}/experiment.toml")).exists() {
                let command = ["merge", "report", "status"][looked % 3];
                let run = desk.run(&format!("{command} {out}"));
                assert_eq!(run.code, 0, "{command}: {}", run.err);
                looked += 1;
            }
        }
        for run in runs {
            let (code, said) = end(run);
            assert_eq!((code, said.as_str()), (Some(0), ""));
        }
        assert_eq!(desk.json(&format!("status {out}"))["records"], NUM_RECORDS);
        assert_eq!(desk.read(&format!("{out}/results.csv")), expected);
    }
}

#[test]
fn two_runs_in_one_folder_do_not_mix() {
    let desk = desk();
    let expected = undisturbed(&desk);
    let pair = [0, 1].map(|_| start(&desk, "run e.toml --out twice --threads 1 --resume"));
    let mut ends = pair.map(end);
    ends.sort();
    assert_eq!(ends[0], (Some(0), String::new()));
    // The second says so, unless the first was done before it looked.
    let (code, said) = &ends[1];
    let refused = said.contains("twice/trials.jsonl: another run is writing here (process ");
    assert!(*code == Some(0) || (*code == Some(2) && refused), "{ends:?}");
    assert_eq!(desk.read("twice/results.csv"), expected);
    // A whole run and a shard compute the same records: they agree.
    let line = |shard| format!("run e.toml --out both --threads 1 --shard {shard} --resume");
    let pair = ["0/1", "1/3"].map(|shard| start(&desk, &line(shard)));
    for (code, said) in pair.map(end) {
        assert_eq!(code, Some(0), "{said}");
    }
    assert_eq!(desk.read("both/results.csv"), expected);
}

#[cfg(unix)]
#[test]
fn a_full_disk_loses_nothing_that_was_written() {
    let desk = desk();
    let expected = undisturbed(&desk);
    for (index, blocks) in [0, 1, 2, 3, 8, 40, 120, 300, 600, 900].into_iter().enumerate() {
        let out = format!("full{index}");
        // A limit on the size of files refuses writes as a full disk does, once its signal is ignored.
        let program = env!("CARGO_BIN_EXE_cfpose");
        let line = format!("trap '' XFSZ; ulimit -f {blocks}; exec {program} run e.toml --out {out} --threads 2");
        let limited = Command::new("sh").args(["-c", &line]).current_dir(desk.path("")).output().expect("a shell");
        let said = String::from_utf8_lossy(&limited.stderr);
        assert!([Some(0), Some(3)].contains(&limited.status.code()), "{said}");
        assert!(limited.status.code() == Some(0) || (said.contains(&out) && said.lines().count() == 1), "{said}");
        let before = if desk.path(&format!("{out}/experiment.toml")).exists() {
            desk.json(&format!("status {out}"))["records"].as_u64().expect("a number")
        } else {
            0
        };
        let resumed = desk.json(&format!("run e.toml --out {out} --threads 2 --resume"));
        assert_eq!((&resumed["resumed"], &resumed["complete"]), (&json!(before), &json!(true)));
        assert_eq!(desk.read(&format!("{out}/results.csv")), expected);
        assert_eq!(strangers(&desk, &out, "whole"), Vec::<String>::new());
    }
}

#[test]
fn rows_that_vanish_are_counted() {
    let desk = desk();
    let child = start(&desk, "run e.toml --out robbed --threads 1");
    while !desk.path("robbed/trials.jsonl").exists() {
        sleep(Duration::from_millis(5));
    }
    sleep(Duration::from_millis(100));
    desk.write("robbed/other", "");
    std::fs::rename(desk.path("robbed/other"), desk.path("robbed/trials.jsonl")).expect("a file to replace");
    let (code, said) = end(child);
    assert_eq!(code, Some(4), "{said}");
    assert!(said.contains("error: robbed: 600 record(s) of shard 0/1 are missing"), "{said}");
    assert_eq!(desk.json("run e.toml --out robbed --resume --threads 2")["complete"], true);
}

#[test]
fn a_run_grows_by_trials_and_methods() {
    let desk = desk();
    let expected = undisturbed(&desk);
    let small = EXPERIMENT.split("[[method]]\nname = \"cubic").next().expect("a part").replace("[40, 200]", "40");
    desk.write("small.toml", &small);
    assert_eq!(desk.json("run small.toml --out grown --trials 20 --threads 2")["records"], 20);
    assert!(desk.fails(2, "run e.toml --out grown").contains("belongs to experiment"));
    assert_eq!(desk.json("run small.toml --out grown --trials 30 --resume --threads 2")["computed"], 10);
    let grown = desk.json("run e.toml --out grown --resume --threads 2");
    assert_eq!((&grown["resumed"], &grown["computed"], &grown["complete"]), (&json!(30), &json!(570), &json!(true)));
    assert_eq!(desk.read("grown/results.csv"), expected);
    assert_eq!(desk.read("grown/manifest.json"), desk.read("whole/manifest.json"));
    // Records of every age carry the experiment as it is now.
    assert_eq!(desk.json("merge grown"), desk.json("report grown"));
    // What is smaller, or was changed, is another experiment.
    assert!(desk.fails(2, "run small.toml --out grown --resume").contains("belongs to experiment"));
    desk.write("changed.toml", EXPERIMENT.replace("degree=3", "degree=4"));
    assert!(desk.fails(2, "run changed.toml --out grown --resume").contains("belongs to experiment"));
}

#[test]
fn records_that_differ_from_what_was_computed_are_refused() {
    let desk = Desk::new();
    let cloud = |shift: f64| {
        let rows = common::cloud(60, 4).into_iter().map(|row| format!("{} {} {}\n", row[0] + shift, row[1], row[2]));
        rows.collect::<String>()
    };
    desk.write("cloud.xyz", cloud(0.0));
    desk.write(
        "e.toml",
        "trials = 3\n[[scenario]]\nname = \"cloud3\"\npoints = 50\nshape = \"cloud.xyz\"\n[[method]]\nname = \"paper\"\n",
    );
    assert_eq!(desk.json("run e.toml --out r")["records"], 3);
    let good = desk.read("r/trials.jsonl");
    let first: serde_json::Value = serde_json::from_str(good.lines().next().expect("a line")).expect("JSON");
    assert_eq!(first["version"], env!("CARGO_PKG_VERSION"));
    assert_eq!(first["data"]["cloud.xyz"].as_str().map(str::len), Some(16));
    assert_eq!(first["checksum"].as_str().map(str::len), Some(16));

    // A digit that changed on the disk.
    desk.write("r/trials.jsonl", good.replacen("\"evaluations\":", "\"evaluations\":1", 1));
    assert!(desk.fails(3, "merge r").contains("r/trials.jsonl: line 1: the record does not match its checksum"));
    assert!(desk.fails(3, "run e.toml --out r --resume").contains("checksum"));
    // Another version of the program.
    let version = format!("\"version\":\"{}\"", env!("CARGO_PKG_VERSION"));
    desk.write("r/trials.jsonl", good.replacen(&version, "\"version\":\"0.0.9\"", 1));
    assert!(desk.fails(2, "merge r").contains("holds records of version 0.1.0 beside 0.0.9"));
    // A part of the records, and other data.
    desk.write("r/trials.jsonl", good.lines().next().expect("a line").to_string() + "\n");
    desk.write("cloud.xyz", cloud(0.5));
    let refused = desk.fails(3, "run e.toml --out r --resume");
    assert!(
        refused.contains("r/trials.jsonl: line 1: scenario cloud3[") && refused.contains("computed from other data")
    );
    // The tables need no data.
    assert_eq!(desk.run("merge r").code, 0);
    desk.write("cloud.xyz", cloud(0.0));
    assert_eq!(desk.json("run e.toml --out r --resume")["computed"], 2);
    assert_eq!(desk.json("status r")["records"], 3);
}

#[cfg(unix)]
#[test]
fn a_signal_ends_a_run_in_order_and_a_second_one_at_once() {
    let desk = desk();
    let expected = undisturbed(&desk);
    let send = |child: &Child, signal: &str| {
        let sent = Command::new("kill").args([signal, &child.id().to_string()]).status().expect("the command kill");
        assert!(sent.success());
    };
    for (signal, name, code) in [("-INT", "SIGINT", 130), ("-TERM", "SIGTERM", 143)] {
        let out = format!("stopped{signal}");
        let child = start(&desk, &format!("run e.toml --out {out} --threads 1 --json {out}.json"));
        let trials = desk.path(&format!("{out}/trials.jsonl"));
        while !std::fs::metadata(&trials).is_ok_and(|data| data.len() > 10_000) {
            sleep(Duration::from_millis(2));
        }
        send(&child, signal);
        let (found, said) = end(child);
        assert_eq!(found, Some(code), "{said}");
        assert!(
            said.starts_with(&format!("error: stopped by {name}: ")) && said.contains("go on with --resume"),
            "{said}"
        );
        // The tables hold what is there.
        let report: serde_json::Value = serde_json::from_str(&desk.read(&format!("{out}.json"))).expect("JSON");
        let records = report["records"].as_u64().expect("a number") as usize;
        assert_eq!(
            (&report["complete"], report["missing"].as_u64()),
            (&json!(false), Some((NUM_RECORDS - records) as u64))
        );
        assert_eq!(desk.read(&format!("{out}/results.csv")).lines().count(), records + 1);
        let resumed = desk.json(&format!("run e.toml --out {out} --threads 2 --resume"));
        assert_eq!((&resumed["resumed"], &resumed["complete"]), (&json!(records), &json!(true)));
        assert_eq!(desk.read(&format!("{out}/results.csv")), expected);
    }
    // A trial that lasts: the second signal does not wait for it.
    desk.write(
        "long.toml",
        EXPERIMENT.replace("[40, 200]", "400000").replace("preset = \"paper\"", "preset = \"auto\""),
    );
    let child = start(&desk, "run long.toml --out long --threads 1");
    // It prepares its first trial before it claims the folder: the signals are caught from before that.
    sleep(Duration::from_millis(600));
    send(&child, "-TERM");
    sleep(Duration::from_millis(20));
    let begun = std::time::Instant::now();
    let sent = Command::new("kill").args(["-TERM", &child.id().to_string()]).status();
    let (found, _) = end(child);
    assert_eq!(found, Some(143), "{sent:?}");
    assert!(begun.elapsed() < Duration::from_secs(2), "{:?}", begun.elapsed());
}
