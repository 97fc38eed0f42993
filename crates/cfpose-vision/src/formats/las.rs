//! `.las`: airborne and terrestrial scans, versions 1.0 to 1.4, uncompressed.
//!
//! Read are the coordinates, scale and offset of the header applied; everything else in a point record is ignored.
//!
//! Source: ASPRS, "LAS specification", 1.2 (public header, records 0 to 3), 1.3 (4, 5) and 1.4 (6 to 10).

use crate::columns::Layout;
use crate::error::{Fault, Flaw, Place};
use crate::gather::{Gather, PointTable};
use crate::options::ReadOptions;
use crate::scalar::Scalar;

/// Least bytes of a point record, by its format.
const RECORDS: [u64; 11] = [20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67];

/// What is needed of the public header.
struct Header {
    /// Where the points begin.
    begin: usize,
    /// Bytes of a point.
    stride: usize,
    /// Number of points.
    points: usize,
    scale: [f64; 3],
    offset: [f64; 3],
}

/// Read the points.
pub(super) fn read(bytes: &[u8], options: &ReadOptions) -> Result<PointTable, Flaw> {
    let header = parse(bytes)?;
    let mut gather = Gather::new(Layout::fixed(&["x", "y", "z"], options)?, options);
    gather.reserve(header.points.min(options.max_points.unwrap_or(usize::MAX)));
    for row in 0..header.points {
        let point = &bytes[header.begin + row * header.stride..];
        gather.push(Place::Row(row + 1), |axis, _| {
            let whole = Scalar::Signed(4).decode(&point[4 * axis..], false).unwrap_or(f64::NAN);
            Ok(whole * header.scale[axis] + header.offset[axis])
        })?;
    }
    gather.finish()
}

fn wrong(what: impl Into<String>) -> Fault {
    Fault::Header { what: what.into() }
}

/// Return an unsigned number of the header.
fn whole(bytes: &[u8], at: usize, size: usize) -> Result<u64, Fault> {
    let field = bytes.get(at..at + size).ok_or_else(|| wrong("is cut off"))?;
    Ok(field.iter().rev().fold(0, |value, byte| value << 8 | u64::from(*byte)))
}

fn parse(bytes: &[u8]) -> Result<Header, Fault> {
    if !bytes.starts_with(b"LASF") {
        return Err(wrong("does not begin with LASF"));
    }
    let (major, minor) = (whole(bytes, 24, 1)?, whole(bytes, 25, 1)?);
    let least = match (major, minor) {
        (1, 0..=2) => 227,
        (1, 3) => 235,
        (1, 4) => 375,
        _ => {
            let what = format!("las version {major}.{minor}");
            return Err(Fault::Unsupported { what, advice: "write version 1.2 to 1.4" });
        }
    };
    let (size, begin) = (whole(bytes, 94, 2)?, whole(bytes, 96, 4)?);
    if size < least || begin < size || begin > bytes.len() as u64 {
        return Err(wrong(format!("of version 1.{minor} takes {size} bytes, and the points begin at byte {begin}")));
    }
    let (format, stride) = (whole(bytes, 104, 1)?, whole(bytes, 105, 2)?);
    if format >= 128 {
        let what = "a compressed (laz) point record".to_string();
        return Err(Fault::Unsupported { what, advice: "decompress it (laszip, or pdal translate to .las)" });
    }
    let record = RECORDS.get(format as usize).ok_or_else(|| wrong(format!("names the point format {format}")))?;
    if stride < *record {
        return Err(wrong(format!("gives a point of format {format} {stride} bytes; it has at least {record}")));
    }
    let points = count(bytes, minor)?;
    let (held, end) = ((bytes.len() as u64 - begin) / stride, begin.saturating_add(points.saturating_mul(stride)));
    if points > held {
        let (claimed, held) = (points.to_string(), held.to_string());
        return Err(Fault::Claims { what: "points".into(), claimed, held });
    }
    // What may follow the points: waveforms (1.3, 1.4) and extended records (1.4), where the header says.
    let mut after = vec![bytes.len() as u64];
    if minor >= 3 {
        after.push(whole(bytes, 227, 8)?);
    }
    if minor >= 4 {
        after.push(whole(bytes, 235, 8)?);
    }
    let next = after.into_iter().filter(|at| *at != 0).min().unwrap_or(end);
    if next != end {
        let found = next.abs_diff(end) as usize;
        return Err(if next > end {
            Fault::Trailing { found }
        } else {
            wrong("lets other data begin among the points")
        });
    }
    let double = |at: usize| Scalar::Float(8).decode(&bytes[at..], false).unwrap_or(f64::NAN);
    let scale = [131, 139, 147].map(double);
    let offset = [155, 163, 171].map(double);
    if !scale.iter().all(|s| s.is_finite() && *s != 0.0) || !offset.iter().all(|o| o.is_finite()) {
        return Err(wrong(format!("gives the scale {scale:?} and the offset {offset:?}")));
    }
    Ok(Header { begin: begin as usize, stride: stride as usize, points: points as usize, scale, offset })
}

/// Return the number of points; version 1.4 gives it twice, the old field 0 where it does not fit.
fn count(bytes: &[u8], minor: u64) -> Result<u64, Fault> {
    let old = whole(bytes, 107, 4)?;
    if minor < 4 {
        return Ok(old);
    }
    let new = whole(bytes, 247, 8)?;
    if old != 0 && old != new {
        return Err(wrong(format!("counts {old} points, and {new}")));
    }
    Ok(new)
}
