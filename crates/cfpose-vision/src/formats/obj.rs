//! `.obj`: the vertices of a Wavefront object; everything else is ignored.
//!
//! A vertex line is `v x y z`, `v x y z w` for the point (x/w, y/w, z/w), or `v x y z` and a colour of three numbers, which
//! is ignored. w is not the weight of a point.

use cfpose::Points;

use crate::columns::Layout;
use crate::cursor::Lines;
use crate::error::{Fault, Flaw, Place, excerpt};
use crate::gather::{Gather, PointTable};
use crate::lines::with_line_feeds;
use crate::options::ReadOptions;
use crate::rows::{number, rows};
use crate::triangles::push_fan;

/// Read the lines that begin with `v`.
pub(super) fn read(bytes: &[u8], options: &ReadOptions) -> Result<PointTable, Flaw> {
    let bytes = with_line_feeds(bytes)?;
    let mut gather = Gather::new(Layout::fixed(&["x", "y", "z"], options)?, options);
    for (line, text) in Lines::new(&bytes) {
        let fail = |fault| Flaw::new(Place::Line(line), fault);
        let mut fields = text.split('#').next().unwrap_or_default().split_whitespace();
        match fields.next() {
            Some("v") => {}
            Some(word @ ("V" | "VN" | "VT" | "F")) => {
                let what = format!("the keyword {word}");
                return Err(fail(Fault::Unsupported { what, advice: "write keywords in lower case" }));
            }
            _ => continue,
        }
        let fields: Vec<&str> = fields.take(8).collect();
        let weight = match fields.len() {
            3 | 6 => 1.0,
            4 => number(fields[3], "w").map_err(fail)?,
            0..3 => {
                let fault = Fault::Columns { found: fields.len(), expected: 3, than: "format asks for" };
                return Err(fail(fault));
            }
            found => {
                let what = format!("a vertex of {}{found} numbers", if found == 8 { "at least " } else { "" });
                return Err(fail(Fault::Unsupported { what, advice: "write x y z, x y z w or x y z and a colour" }));
            }
        };
        if weight == 0.0 || !weight.is_finite() {
            let what = format!("a vertex at infinity (w is {weight})");
            return Err(fail(Fault::Unsupported { what, advice: "remove the vertex" }));
        }
        gather.push(Place::Line(line), |index, name| Ok(number(fields[index], name)? / weight))?;
    }
    gather.finish()
}

/// Read the lines that begin with `f` in a file of so many vertices.
///
/// An index counts from 1, a negative one back from the vertex line above; what follows a slash names texture and normal.
pub(crate) fn triangles(bytes: &[u8], num_vertices: usize) -> Result<Vec<[usize; 3]>, Flaw> {
    let bytes = with_line_feeds(bytes)?;
    let (mut triangles, mut above) = (Vec::new(), 0_usize);
    for (line, text) in Lines::new(&bytes) {
        let mut fields = text.split('#').next().unwrap_or_default().split_whitespace();
        match fields.next() {
            Some("v") => above += 1,
            Some("f") => {
                let fail = |fault| Flaw::new(Place::Line(line), fault);
                let polygon: Result<Vec<usize>, Flaw> = fields.map(|field| index(field, above).map_err(fail)).collect();
                push_fan(&mut triangles, &polygon?, num_vertices).map_err(fail)?;
            }
            _ => {}
        }
    }
    Ok(triangles)
}

/// Return the index from 0 that a field of a face names.
fn index(field: &str, above: usize) -> Result<usize, Fault> {
    let number: Option<i64> = field.split('/').next().and_then(|word| word.parse().ok());
    let index = match number {
        Some(number @ 1..) => usize::try_from(number - 1).ok(),
        Some(number @ ..=-1) => usize::try_from(number.unsigned_abs()).ok().and_then(|back| above.checked_sub(back)),
        _ => None,
    };
    index.ok_or_else(|| Fault::Face { what: format!("the face has the index {:?}", excerpt(field)) })
}

/// Write one vertex a line, for points of dimension 3 without weights.
pub(super) fn write(points: &Points) -> Result<Vec<u8>, Fault> {
    if points.dim() != 3 || !points.is_uniform() {
        let what = "an obj file holds points of dimension 3 without weights".to_string();
        return Err(Fault::Unwritable { what, advice: "csv or ply" });
    }
    Ok(rows(points, " ", "v ").into_bytes())
}
