//! `.stl`: triangles, ascii and binary.
//!
//! Points are the corners of the facets, each distinct one once, in the order of the file.
//!
//! Source: 3D Systems, "StereoLithography interface specification", 1989. A file is binary where its size is that of the
//! number of facets at byte 80, ascii where it begins with `solid` otherwise.

use std::collections::HashMap;

use crate::columns::Layout;
use crate::cursor::Lines;
use crate::error::{Fault, Flaw, Place};
use crate::gather::{Gather, PointTable};
use crate::lines::with_line_feeds;
use crate::options::ReadOptions;
use crate::rows::number;
use crate::scalar::Scalar;

/// Bytes before the facets, and of a facet: normal, three corners, two bytes.
const HEAD: usize = 84;
const FACET: usize = 50;

/// Corners and where they stand, three for each facet.
type Corners = Vec<(Place, [f64; 3])>;

/// Read the distinct corners.
pub(super) fn read(bytes: &[u8], options: &ReadOptions) -> Result<PointTable, Flaw> {
    let mut gather = Gather::new(Layout::fixed(&["x", "y", "z"], options)?, options);
    let mut seen: HashMap<[u64; 3], ()> = HashMap::new();
    each_corner(bytes, |at, corner| {
        // -0 and 0 are one place.
        let key = corner.map(|x| (x + 0.0).to_bits());
        if seen.insert(key, ()).is_none() {
            gather.push(at, |axis, _| Ok(corner[axis]))?;
        }
        Ok(())
    })?;
    gather.finish()
}

/// Read the facets as indices of the distinct corners, of which there are `num_vertices`.
pub(crate) fn triangles(bytes: &[u8], num_vertices: usize) -> Result<Vec<[usize; 3]>, Flaw> {
    let mut index: HashMap<[u64; 3], usize> = HashMap::new();
    let mut corners: Vec<usize> = Vec::new();
    each_corner(bytes, |at, corner| {
        let next = index.len();
        corners.push(*index.entry(corner.map(|x| (x + 0.0).to_bits())).or_insert(next));
        if index.len() > num_vertices {
            let what = "a facet has a corner that is no point".to_string();
            return Err(Flaw::new(at, Fault::Face { what }));
        }
        Ok(())
    })?;
    Ok(corners.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect())
}

/// Visit the corners of every facet.
fn each_corner(bytes: &[u8], visit: impl FnMut(Place, [f64; 3]) -> Result<(), Flaw>) -> Result<(), Flaw> {
    let claimed = bytes.get(80..HEAD).map(|n| u32::from_le_bytes([n[0], n[1], n[2], n[3]]));
    let size = claimed.map(|claimed| HEAD as u64 + FACET as u64 * u64::from(claimed));
    let start = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes).trim_ascii_start();
    let solid = start.get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"solid"));
    if size == Some(bytes.len() as u64) || !solid {
        return binary(bytes, claimed, visit);
    }
    ascii(bytes, visit)
}

fn binary(
    bytes: &[u8],
    claimed: Option<u32>,
    mut visit: impl FnMut(Place, [f64; 3]) -> Result<(), Flaw>,
) -> Result<(), Flaw> {
    let claimed = claimed.ok_or_else(|| Fault::Header { what: "is cut off".into() })?;
    let facets = bytes[HEAD..].chunks_exact(FACET);
    let (held, rest) = (facets.len(), facets.remainder().len());
    if (claimed as usize) > held {
        let (claimed, held) = (claimed.to_string(), held.to_string());
        return Err(Fault::Claims { what: "facets".into(), claimed, held }.into());
    }
    if (claimed as usize) < held {
        return Err(Fault::Extra { what: "facets".into(), claimed: claimed.to_string() }.into());
    }
    if rest > 0 {
        return Err(Fault::Trailing { found: rest }.into());
    }
    for (row, facet) in facets.enumerate() {
        for corner in facet[12..48].chunks_exact(12) {
            let value = |axis: usize| Scalar::Float(4).decode(&corner[4 * axis..], false).unwrap_or(f64::NAN);
            visit(Place::Row(row + 1), [0, 1, 2].map(value))?;
        }
    }
    Ok(())
}

/// Read `solid .. facet normal .. outer loop, vertex x y z three times, endloop, endfacet .. endsolid`.
fn ascii(bytes: &[u8], mut visit: impl FnMut(Place, [f64; 3]) -> Result<(), Flaw>) -> Result<(), Flaw> {
    let bytes = with_line_feeds(bytes)?;
    let (mut facet, mut ended): (Corners, bool) = (Vec::new(), false);
    for (line, text) in Lines::new(&bytes) {
        let at = Place::Line(line);
        let fail = |what: &str| Flaw::new(at, Fault::Face { what: what.to_string() });
        let mut fields = text.split_whitespace();
        let Some(word) = fields.next() else { continue };
        match word.to_lowercase().as_str() {
            "vertex" => {
                let fields: Vec<&str> = fields.take(4).collect();
                if fields.len() != 3 {
                    let fault = Fault::Columns { found: fields.len(), expected: 3, than: "format asks for" };
                    return Err(Flaw::new(at, fault));
                }
                let mut corner = [0.0; 3];
                for axis in 0..3 {
                    let value = number(fields[axis], ["x", "y", "z"][axis]);
                    corner[axis] = value.map_err(|fault| Flaw::new(at, fault))?;
                }
                facet.push((at, corner));
                if facet.len() > 3 {
                    return Err(fail("the facet has more than three corners"));
                }
            }
            "endloop" if facet.len() != 3 => return Err(fail("the facet has fewer than three corners")),
            "endloop" => {
                for (at, corner) in facet.drain(..) {
                    visit(at, corner)?;
                }
            }
            "solid" | "facet" | "outer" | "endfacet" => ended = false,
            "endsolid" => ended = true,
            _ => return Err(fail("this is no line of an stl file")),
        }
    }
    if ended { Ok(()) } else { Err(Fault::Face { what: "the file ends before endsolid".into() }.into()) }
}
