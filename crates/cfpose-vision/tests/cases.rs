//! The collected small files that once were read wrongly; listed as ignored where the data folder is absent.

mod common;

use std::path::{Path, PathBuf};

use cfpose_vision::{Foreground, Invalid, PointFile, ReadOptions, read_points};
use common::rows;

/// Return the folder of the cases.
fn cases() -> PathBuf {
    let default = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    std::env::var_os("CFPOSE_DATA").map_or(default, PathBuf::from).join("cases")
}

fn read_with(name: &str, options: &ReadOptions) -> Result<PointFile, String> {
    let path = cases().join(name);
    let message = |error: cfpose_vision::FileError| {
        let message = error.to_string();
        assert_eq!(message.lines().count(), 1);
        message.rsplit_once(&format!("{name}: ")).expect("the message names the file").1.to_string()
    };
    read_points(&path, options).map_err(message)
}

fn read(name: &str) -> Result<PointFile, String> {
    read_with(name, &ReadOptions::default())
}

#[test]
#[cfg_attr(not(shared_data), ignore = "no real data: set CFPOSE_DATA to their folder")]
fn columns_are_read_by_name() {
    let expected = read("09_xyz.csv");
    let expected = rows(&expected.unwrap());
    for name in ["09_units0.csv", "09_units1.csv", "09_units2.csv", "09_units3.csv", "09_yzx_plain.csv"] {
        assert_eq!(rows(&read(name).unwrap()), expected, "{name}");
    }
    let unclear = read("09_uvw.csv").unwrap_err();
    assert!(unclear.contains("--columns u,v,w"), "{unclear}");
    let columns = ["u", "v", "w"].map(String::from).to_vec();
    let chosen = read_with("09_uvw.csv", &ReadOptions { columns, ..ReadOptions::default() }).unwrap();
    assert_eq!((chosen.points.len(), chosen.points.dim()), (expected.len(), 3));
}

#[test]
#[cfg_attr(not(shared_data), ignore = "no real data: set CFPOSE_DATA to their folder")]
fn files_that_contradict_themselves_are_refused() {
    for (name, why) in [
        ("13_two_arrays.npy", "the header claims 150 rows, but more follow"),
        ("npy_extra.npy", "after the last point"),
        ("ply_2format.ply", "line 3: the header names the format twice"),
        ("ply_listx.ply", "gives x as a list"),
        ("pcd_width.pcd", "gives WIDTH without HEIGHT"),
        ("crcol.csv", "line 1: a carriage return stands alone"),
    ] {
        let result = read(name);
        let message = result.map(|file| file.points.len()).unwrap_err();
        assert!(
            message.contains(why) || name == "npy_extra.npy" && message.contains("more follow"),
            "{name}: {message}"
        );
    }
}

#[test]
#[cfg_attr(not(shared_data), ignore = "no real data: set CFPOSE_DATA to their folder")]
fn homogeneous_vertices_missing_points_and_labels() {
    let plain = read("09_xyz.csv");
    let plain = rows(&plain.unwrap());
    let file = read("15_obj_w.obj").unwrap();
    let worst = rows(&file).concat().iter().zip(plain.concat()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(file.points.len() == plain.len() && worst < 2e-5, "{worst}");
    let file = read("16_organised_nan.pcd").unwrap();
    assert_eq!((file.points.len() + file.skipped, file.notes.len()), (250, 1));
    assert!(file.skipped > 0 && file.notes[0].contains("--invalid refuse"), "{:?}", file.notes);
    let refuse = ReadOptions { invalid: Invalid::Refuse, ..ReadOptions::default() };
    assert!(read_with("16_organised_nan.pcd", &refuse).unwrap_err().contains("x is NaN"));
    let labels = read("17_labels01.png").unwrap();
    assert!(labels.notes[0].starts_with("read as labels 0 to 1"), "{:?}", labels.notes);
}

#[test]
#[cfg_attr(not(shared_data), ignore = "no real data: set CFPOSE_DATA to their folder")]
fn an_image_that_unpacks_to_millions_of_points_says_so() {
    let result = read("bomb4096.png");
    let message = "more than 4194304 points (16760836); give --max-points 16760836 or reduce the image";
    assert_eq!(result.map(|file| file.points.len()).unwrap_err(), message);
    let dark = ReadOptions { foreground: Foreground::Dark, ..ReadOptions::default() };
    assert_eq!(read_with("bomb4096.png", &dark).unwrap().points.len(), 4096 * 4096 - 16_760_836);
}
