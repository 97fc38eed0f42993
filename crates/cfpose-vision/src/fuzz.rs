//! One entry for property tests and fuzzers.

use cfpose::Points;

use crate::camera::parse_camera;
use crate::formats::FORMATS;
use crate::options::{Foreground, Invalid, ReadOptions, Threshold};
use crate::poses::parse;
use crate::read::read_as;

/// Read bytes as each format, as poses and as a camera, and assert what must hold for all input; the first byte chooses the options.
///
/// # Panics
/// When a reader panics, returns more points than bytes (for images: pixels) can hold, a point that is not finite,
/// or a message that is not one line.
///
/// ```
/// cfpose_vision::fuzz_one(b"\0ply\nformat ascii 1.0\nelement vertex 1000000000000000\nproperty float x\nend_header\n1\n");
/// ```
pub fn fuzz_one(data: &[u8]) {
    let Some((choice, bytes)) = data.split_first() else { return };
    let options = options(*choice);
    for format in FORMATS {
        match read_as(format, bytes, &options) {
            Ok(table) => {
                assert!(table.points.len() <= MOST_POINTS_PER_BYTE * bytes.len(), "{}", format.name);
                let dim = table.points.dim();
                assert!((0..table.points.len()).all(|k| table.points.point(k)[..dim].iter().all(|x| x.is_finite())));
                assert!(table.columns.len() - dim <= 1, "{:?}", table.columns);
                table.notes.iter().for_each(|note| assert_line(note));
            }
            Err(flaw) => assert_line(&format!("{}{}", flaw.at, flaw.fault)),
        }
    }
    match parse(bytes) {
        Ok(poses) => {
            assert!(poses.len() <= bytes.len());
            assert!(poses.iter().all(|pose| pose.pose.matrix().as_flattened().iter().all(|x| x.is_finite())));
        }
        Err(flaw) => assert_line(&format!("{}{}", flaw.at, flaw.fault)),
    }
    match parse_camera(bytes, (choice % 2 == 1).then_some("cam0")) {
        Ok(camera) => {
            let pixel = Points::from_rows(&[[f64::from(*choice), 1.0]]).expect("a finite pixel");
            if let Ok(point) = camera.normalise(&pixel) {
                assert!(point.point(0)[..2].iter().all(|x| x.is_finite()));
            }
        }
        Err(fault) => assert_line(&fault.to_string()),
    }
}

fn assert_line(message: &str) {
    assert!(!message.contains(['\n', '\r']) && message.len() < 500, "{message:?}");
}

/// Choose options by the bits of a byte.
fn options(choice: u8) -> ReadOptions {
    let columns: &[&str] = match choice >> 6 {
        0 | 1 => &[],
        2 => &["2", "1", "3"],
        _ => &["x", "y"],
    };
    ReadOptions {
        foreground: [Foreground::Auto, Foreground::Bright, Foreground::Dark][usize::from(choice % 3)],
        threshold: [Threshold::Auto, Threshold::Otsu, Threshold::Grey(choice)][usize::from(choice / 3 % 3)],
        invalid: [Invalid::Missing, Invalid::Skip, Invalid::Refuse][usize::from(choice / 9 % 3)],
        columns: columns.iter().map(|name| name.to_string()).collect(),
        weight_column: (choice % 16 == 5).then(|| "4".to_string()),
        max_points: (choice % 16 == 7).then_some(2),
        ..ReadOptions::default()
    }
}

/// A byte of deflated one-bit pixels holds at most 1032 bytes of eight.
const MOST_POINTS_PER_BYTE: usize = 1032 * 8;
