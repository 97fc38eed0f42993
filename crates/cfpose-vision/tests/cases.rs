//! The collected small files that once were read wrongly; skipped, visibly, where the data folder is absent.

mod common;

use std::path::{Path, PathBuf};

use cfpose_vision::{Foreground, Invalid, PointFile, ReadOptions, read_points};
use common::rows;

/// Return the folder, or say that the test is skipped.
fn cases() -> Option<PathBuf> {
    let default = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let folder = std::env::var_os("CFPOSE_DATA").map_or(default, PathBuf::from).join("cases");
    if folder.is_dir() {
        return Some(folder);
    }
    println!("skipped: no folder {}; set CFPOSE_DATA", folder.display());
    None
}

fn read_with(name: &str, options: &ReadOptions) -> Option<Result<PointFile, String>> {
    let path = cases()?.join(name);
    let message = |error: cfpose_vision::FileError| {
        let message = error.to_string();
        assert_eq!(message.lines().count(), 1);
        message.rsplit_once(&format!("{name}: ")).expect("the message names the file").1.to_string()
    };
    Some(read_points(&path, options).map_err(message))
}

fn read(name: &str) -> Option<Result<PointFile, String>> {
    read_with(name, &ReadOptions::default())
}

#[test]
fn columns_are_read_by_name() {
    let Some(expected) = read("09_xyz.csv") else { return };
    let expected = rows(&expected.unwrap());
    for name in ["09_units0.csv", "09_units1.csv", "09_units2.csv", "09_units3.csv", "09_yzx_plain.csv"] {
        assert_eq!(rows(&read(name).unwrap().unwrap()), expected, "{name}");
    }
    let unclear = read("09_uvw.csv").unwrap().unwrap_err();
    assert!(unclear.contains("--columns u,v,w"), "{unclear}");
    let columns = ["u", "v", "w"].map(String::from).to_vec();
    let chosen = read_with("09_uvw.csv", &ReadOptions { columns, ..ReadOptions::default() }).unwrap().unwrap();
    assert_eq!((chosen.points.len(), chosen.points.dim()), (expected.len(), 3));
}

#[test]
fn files_that_contradict_themselves_are_refused() {
    for (name, why) in [
        ("13_two_arrays.npy", "the header claims 150 rows, but more follow"),
        ("npy_extra.npy", "after the last point"),
        ("ply_2format.ply", "line 3: the header names the format twice"),
        ("ply_listx.ply", "gives x as a list"),
        ("pcd_width.pcd", "gives WIDTH without HEIGHT"),
        ("crcol.csv", "line 1: a carriage return stands alone"),
    ] {
        let Some(result) = read(name) else { return };
        let message = result.map(|file| file.points.len()).unwrap_err();
        assert!(
            message.contains(why) || name == "npy_extra.npy" && message.contains("more follow"),
            "{name}: {message}"
        );
    }
}

#[test]
fn homogeneous_vertices_missing_points_and_labels() {
    let Some(plain) = read("09_xyz.csv") else { return };
    let plain = rows(&plain.unwrap());
    let file = read("15_obj_w.obj").unwrap().unwrap();
    let worst = rows(&file).concat().iter().zip(plain.concat()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(file.points.len() == plain.len() && worst < 2e-5, "{worst}");
    let file = read("16_organised_nan.pcd").unwrap().unwrap();
    assert_eq!((file.points.len() + file.skipped, file.notes.len()), (250, 1));
    assert!(file.skipped > 0 && file.notes[0].contains("--invalid refuse"), "{:?}", file.notes);
    let refuse = ReadOptions { invalid: Invalid::Refuse, ..ReadOptions::default() };
    assert!(read_with("16_organised_nan.pcd", &refuse).unwrap().unwrap_err().contains("x is NaN"));
    let labels = read("17_labels01.png").unwrap().unwrap();
    assert!(labels.notes[0].starts_with("read as labels 0 to 1"), "{:?}", labels.notes);
}

#[test]
fn an_image_that_unpacks_to_millions_of_points_says_so() {
    let Some(result) = read("bomb4096.png") else { return };
    let message = "more than 4194304 points (16760836); give --max-points 16760836 or reduce the image";
    assert_eq!(result.map(|file| file.points.len()).unwrap_err(), message);
    let dark = ReadOptions { foreground: Foreground::Dark, ..ReadOptions::default() };
    assert_eq!(read_with("bomb4096.png", &dark).unwrap().unwrap().points.len(), 4096 * 4096 - 16_760_836);
}
