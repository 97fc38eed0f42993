//! One entry for property tests and fuzzers.

use crate::formats::FORMATS;
use crate::options::ReadOptions;

/// Read bytes as each format and assert what must hold for all input; the first byte chooses the options.
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
    let options = ReadOptions { threshold: *choice, ..ReadOptions::default() };
    for format in FORMATS {
        match (format.read)(bytes, &options) {
            Ok(table) => {
                assert!(table.points.len() <= MOST_POINTS_PER_BYTE * bytes.len(), "{}", format.name);
                let dim = table.points.dim();
                assert!((0..table.points.len()).all(|k| table.points.point(k)[..dim].iter().all(|x| x.is_finite())));
                assert!(table.columns.len() - dim <= 1, "{:?}", table.columns);
            }
            Err(flaw) => {
                let message = format!("{}{}", flaw.at, flaw.fault);
                assert!(!message.contains(['\n', '\r']) && message.len() < 400, "{message:?}");
            }
        }
    }
}

/// A byte of deflated one-bit pixels holds at most 1032 bytes of eight.
const MOST_POINTS_PER_BYTE: usize = 1032 * 8;
