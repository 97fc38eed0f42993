//! Flags of reading, and the collected small files that concern it (listed as ignored where the data folder is absent).

mod common;

use std::io::Write;
use std::path::PathBuf;
use std::process::{Command, Stdio};

use common::{Desk, data, degrees_between, pose_of};
use serde_json::Value;

/// Return the folder of the cases.
fn cases() -> PathBuf {
    data().join("cases")
}

/// Return the rotation and translation of a truth file.
fn truth(folder: &std::path::Path, name: &str) -> cfpose::Pose {
    cfpose_vision::read_poses(&folder.join(name)).unwrap()[0].pose
}

fn estimate(desk: &Desk, folder: &std::path::Path, model: &str, source: &str, target: &str, more: &str) -> common::Run {
    let (source, target) = (folder.join(source), folder.join(target));
    let line = format!("estimate --model {model} --source {} --target {}", source.display(), target.display());
    desk.run(&format!("{line} --threads 1 --json - {more}"))
}

#[test]
#[cfg_attr(not(shared_data), ignore = "no real data: set CFPOSE_DATA to their folder")]
fn columns_that_are_read_by_name_give_the_true_pose() {
    let folder = cases();
    let (desk, truth) = (Desk::new(), truth(&folder, "06_truth.txt"));
    for name in [
        "09_xyz.csv",
        "09_yzx_plain.csv",
        "09_units0.csv",
        "09_units1.csv",
        "09_units2.csv",
        "09_units3.csv",
        "15_obj_w.obj",
        "16_organised_nan.pcd",
    ] {
        let run = estimate(&desk, &folder, "rigid3", name, "09_target.csv", "");
        assert_eq!(run.code, 0, "{name}: {}", run.err);
        let result: Value = serde_json::from_str(&run.out).unwrap();
        let degrees = degrees_between(&pose_of(&result["pose"]), &truth);
        println!("{name}: {degrees:.5} deg");
        assert!(degrees < 0.05, "{name}: {degrees} deg");
    }
    let run = estimate(&desk, &folder, "rigid3", "16_organised_nan.pcd", "09_target.csv", "");
    assert!(run.err.contains("rows have no finite coordinates and are skipped"), "{}", run.err);
    let run = estimate(&desk, &folder, "rigid3", "16_organised_nan.pcd", "09_target.csv", "--invalid refuse");
    assert!(run.code == 3 && run.err.contains("x is NaN"), "{}", run.err);
    let run = estimate(&desk, &folder, "rigid3", "09_uvw.csv", "09_target.csv", "");
    assert!(run.code == 3 && run.err.contains("--columns u,v,w"), "{}", run.err);
}

#[test]
#[cfg_attr(not(shared_data), ignore = "no real data: set CFPOSE_DATA to their folder")]
fn files_that_contradict_themselves_end_with_exit_code_3_and_one_line() {
    let folder = cases();
    let desk = Desk::new();
    for name in [
        "13_two_arrays.npy",
        "npy_extra.npy",
        "ply_2format.ply",
        "ply_listx.ply",
        "pcd_width.pcd",
        "crcol.csv",
        "bomb4096.png",
    ] {
        let run = estimate(&desk, &folder, "rigid3", name, "09_target.csv", "");
        assert_eq!((run.code, run.err.trim_end().lines().count()), (3, 1), "{name}: {}", run.err);
        assert!(run.err.contains(name) && run.err.contains("; "), "{}", run.err);
    }
}

#[test]
#[cfg_attr(not(shared_data), ignore = "no real data: set CFPOSE_DATA to their folder")]
fn starts_with_a_mark_and_masks_of_labels_are_read() {
    let folder = cases();
    let desk = Desk::new();
    let start = folder.join("10_bom_pose.txt").display().to_string();
    let run = estimate(&desk, &folder, "rigid3", "08_source.csv", "08_target_clean.csv", &format!("--start {start}"));
    assert_eq!(run.code, 0, "{}", run.err);
    let run = estimate(&desk, &folder, "affine2", "17_labels01.png", "17_labels01.png", "");
    assert_eq!(run.code, 0, "{}", run.err);
    assert!(run.err.contains("read as labels 0 to 1"), "{}", run.err);
}

/// Rows x y z of a cloud as text in which they are called otherwise.
const ROWS: [&str; 8] =
    ["0,0,0", "1,0,0.1", "0,2,0.3", "0.2,0.1,3", "1,2,0.5", "0.7,0.3,2.5", "-0.5,1,1", "-1,-0.4,0.2"];

#[test]
fn flags_choose_columns_weights_formats_and_sides_of_masks() {
    let desk = Desk::new();
    let table = |header: &str| header.to_string() + "\n" + &ROWS.map(|row| format!("{row},0.5,a\n")).concat();
    desk.write("a.csv", table("p,q,r,s,t"));
    desk.write("b.csv", "x,y,z\n".to_string() + &ROWS.join("\n"));
    let line =
        "evaluate --model rigid3 --preset paper --features coordinates --at 0,0,0,0,0,0 --target b.csv --free tx,ty,tz";
    let message = desk.fails(3, &format!("{line} --source a.csv"));
    assert!(message.ends_with("do not say which are coordinates; choose them with --columns 1,2,3"), "{message}");
    let result = desk.json(&format!("{line} --source a.csv --columns 1,2,3"));
    assert_eq!(result["source_means"], result["target_means"]);
    assert!(desk.fails(3, &format!("{line} --source b.csv --columns x,y,q")).contains("there is no column \"q\""));
    assert!(desk.fails(3, &format!("{line} --source b.csv --max-points 7")).contains("more than 7 points"));
    desk.write("c.dat", ROWS.join("\n"));
    assert!(desk.fails(3, &format!("{line} --source c.dat")).contains("no format has the extension"));
    desk.json(&format!("{line} --source c.dat --format csv"));
    assert!(desk.fails(2, &format!("{line} --source c.dat --format cvs")).starts_with("error: --format: no format"));
    let run = desk.run(&format!("{line} --source c.dat --threshold 300"));
    assert!(run.code == 2 && run.err.contains("neither otsu nor a grey value, 0 to 255"), "{}", run.err);
    assert!(
        desk.fails(2, &line.replace("b.csv", "-").replace("evaluate", "evaluate --source -"))
            .contains("both standard input")
    );
}

#[test]
fn standard_input_is_read_in_the_format_that_is_named() {
    let desk = Desk::new();
    desk.write("b.csv", ROWS.join("\n"));
    let run = |more: &[&str]| {
        let mut child = Command::new(env!("CARGO_BIN_EXE_cfpose"))
            .args(
                "evaluate --model rigid3 --preset paper --features coordinates --free tx,ty,tz --at 0,0,0,0,0,0"
                    .split(' '),
            )
            .args(["--source", "-", "--target", desk.path("b.csv").to_str().unwrap(), "--json", "-"])
            .args(more)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        child.stdin.take().unwrap().write_all(ROWS.join("\n").as_bytes()).ok();
        child.wait_with_output().unwrap()
    };
    let output = run(&["--format", "csv"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let result: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(result["source_means"], result["target_means"]);
    let output = run(&[]);
    assert_eq!(output.status.code(), Some(3));
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(message.contains("-: nothing names the format of this input; give --format csv"), "{message}");
}
