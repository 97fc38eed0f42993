//! Camera files of the programs that calibrate, and what is wrong with others.

mod common;

use std::path::Path;

use cfpose::Points;
use cfpose_vision::{Camera, Lens, read_camera};
use common::CAMERAS;

fn read(name: &str, text: &str, choice: Option<&str>) -> Result<Camera, String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, text).unwrap();
    read_camera(&path, choice).map_err(|error| {
        let message = error.to_string();
        assert!(!message.contains('\n'), "{message}");
        message.split_once(&format!("{name}: ")).map_or(message.clone(), |(_, rest)| rest.to_string())
    })
}

#[test]
fn every_program_that_calibrates_is_understood() {
    let lens = Lens::polynomial(&[-0.28, 0.07, 0.0002, 0.000_017]).unwrap();
    let camera = Camera::new(460.5, 457.25, 367.0, 248.5).unwrap();
    for (name, text) in CAMERAS {
        let expected = if name == "camera_info.yaml" { camera } else { camera.with_lens(lens) };
        let choice = (name == "pair.yaml").then_some("cam0");
        let found = read(name, text, choice).unwrap();
        assert_eq!(found.with_size(None), expected, "{name}");
        // A size that the file names holds.
        assert!(found.for_size(752, 480).is_ok(), "{name}");
        // Other line ends and a byte order mark change nothing.
        let dressed = format!("\u{feff}{}", text.replace('\n', "\r\n"));
        assert_eq!(read(name, &dressed, choice), Ok(found), "{name}");
    }
    let sized = read(CAMERAS[0].0, CAMERAS[0].1, None).unwrap();
    assert!(sized.for_size(640, 480).unwrap_err().contains("752 x 480"));
    let second = read("pair.yaml", CAMERAS[8].1, Some("cam1")).unwrap();
    assert_eq!(second.lens(), Lens::equidistant([-0.01, 0.02, -0.015, 0.003]).unwrap());
    let fisheye = CAMERAS[0]
        .1
        .replace("flags: 0", "fisheye_model: 1")
        .replace("rows: 5", "rows: 4")
        .replace(", 0. ]\navg", " ]\navg");
    let equidistant = Lens::equidistant([-0.28, 0.07, 0.0002, 0.000_017]).unwrap();
    assert_eq!(read("fisheye.yaml", &fisheye, None).unwrap().lens(), equidistant);
    let stereo =
        "M1: [[500,0,1],[0,500,2],[0,0,1]]\nD1: [0.1,0,0,0]\nM2: [[600,0,1],[0,600,2],[0,0,1]]\nD2: [0.2,0,0,0]\n";
    assert_eq!(read("stereo.yaml", stereo, Some("2")).unwrap().intrinsics().fx, 600.0);
}

#[test]
fn what_is_no_camera_is_refused_with_the_reason() {
    let ros = CAMERAS[2].1;
    let kalibr = CAMERAS[4].1;
    let cases: Vec<(&str, String, &str)> = vec![
        ("a.yaml", "x: 1\n".into(), "there is no camera in it; give OpenCV"),
        ("a.yaml", "".into(), "there is nothing in it"),
        ("a.yaml", "[1, 2]".into(), "the file is no map of names"),
        ("a.yaml", "a: [1, 2\nb: 3".into(), "this is no YAML"),
        ("a.yaml", ros.replace("cols: 3", "cols: 4"), "rows 3 and cols 4 contradict 9 numbers"),
        ("a.yaml", ros.replace("457.25, 248.5, 0, 0, 1", "457.25, 248.5, 0, 0"), "contradict 8 numbers"),
        ("a.yaml", ros.replace("[460.5, 0,", "[460.5, 3,"), "the camera matrix is not fx 0 cx, 0 fy cy, 0 0 1"),
        ("a.yaml", ros.replace("460.5", "-460.5"), "focal lengths are above 0"),
        ("a.yaml", ros.replace("460.5", "nan"), "\"nan\" is no number"),
        ("a.yaml", format!("{ros}camera_matrix: [1]\n"), "\"camera_matrix\" is given twice"),
        ("a.yaml", format!("{ros}K: [1]\n"), "camera_matrix and K are both in it"),
        ("a.yaml", ros.replace("camera_matrix:", "K: &a [1]\nk: *a\nb:"), "aliases are not read"),
        ("a.yaml", format!("a: {}1{}", "[".repeat(99), "]".repeat(99)), "nested deeper than 16"),
        ("a.yaml", kalibr.replace("pinhole", "omni"), "the camera model \"omni\" is not supported, only pinhole"),
        ("a.yaml", kalibr.replace("radtan", "fov"), "the distortion model \"fov\" is not supported"),
        ("a.yaml", kalibr.replace(", 1.7e-05", ""), "the lens has 3 coefficients"),
        ("a.yaml", kalibr.replace("460.5, ", ""), "intrinsics has 3 number(s), not 4"),
        ("a.yaml", CAMERAS[8].1.into(), "the file holds several cameras; write FILE#cam0 or #cam1"),
        ("a.xml", "<opencv_storage><K>".into(), "this is no XML"),
        ("a.xml", "<svg/>".into(), "the outermost element is <svg>, not <opencv_storage>"),
        ("a.json", "{\"fx\": 1,".into(), "this is no JSON"),
        ("a.json", "{\"fx\": 1, \"fy\": 1, \"cx\": 0}".into(), "cy is missing or no number"),
    ];
    for (name, text, expected) in cases {
        let message = read(name, &text, None).unwrap_err();
        assert!(message.contains(expected), "{message}\nin place of: {expected}");
    }
    assert!(read("a.yaml", kalibr, Some("cam3")).unwrap_err().contains("there is no camera \"cam3\"; write FILE#cam0"));
    assert!(read_camera(Path::new("no/such.yaml"), None).unwrap_err().to_string().contains("there is no such file"));
    assert!(read("a.yaml", &"a: 1 \n".repeat(200_000), None).unwrap_err().contains("larger than"));
}

#[test]
fn a_lens_is_taken_off_at_the_door() {
    let camera = read("own.json", CAMERAS[6].1, None).unwrap();
    let rays: Vec<[f64; 2]> =
        (0..100).map(|k| [f64::from(k % 10) * 0.1 - 0.45, f64::from(k / 10) * 0.08 - 0.36]).collect();
    let points = Points::from_rows(&rays).unwrap();
    let pixels = camera.project(&points).unwrap();
    let bare = Camera::new(460.5, 457.25, 367.0, 248.5).unwrap();
    let (back, naive) = (camera.normalise(&pixels).unwrap(), bare.normalise(&pixels).unwrap());
    let worst = |found: &Points| {
        (0..100)
            .map(|k| (0..2).map(|d| (found.column(d)[k] - rays[k][d]).abs()).fold(0.0, f64::max))
            .fold(0.0, f64::max)
    };
    assert!(worst(&back) < 1e-12 && worst(&naive) > 0.02, "{} {}", worst(&back), worst(&naive));
    let far = Points::from_rows(&[[367.0, 248.5], [9000.0, 248.5]]).unwrap();
    let folded = bare.with_lens(Lens::polynomial(&[-0.28, 0.0, 0.0, 0.0]).unwrap());
    assert!(folded.normalise(&far).unwrap_err().to_string().starts_with("row 2,"));
}
