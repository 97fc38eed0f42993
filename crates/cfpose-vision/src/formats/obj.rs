//! `.obj`: the vertices of a Wavefront object; everything else is ignored.
//!
//! A vertex line is `v x y z`; what may follow (a homogeneous weight, a colour) is ignored, since neither is the weight
//! of a point.

use cfpose::Points;

use crate::cursor::Lines;
use crate::error::{Fault, Flaw, Place, excerpt};
use crate::gather::{Gather, Layout, PointTable};
use crate::options::ReadOptions;
use crate::rows::{number, rows};
use crate::triangles::push_fan;

/// Read the lines that begin with `v`.
pub(super) fn read(bytes: &[u8], _options: &ReadOptions) -> Result<PointTable, Flaw> {
    let mut gather = Gather::new(Layout::anonymous(3)?);
    for (line, text) in Lines::new(bytes) {
        let mut fields = text.split('#').next().unwrap_or_default().split_whitespace();
        if fields.next() != Some("v") {
            continue;
        }
        let fields: Vec<&str> = fields.collect();
        if fields.len() < 3 {
            let fault = Fault::Columns { found: fields.len(), expected: 3, than: "format asks for" };
            return Err(Flaw::new(Place::Line(line), fault));
        }
        gather.push(Place::Line(line), |index, name| number(fields[index], name))?;
    }
    gather.finish()
}

/// Read the lines that begin with `f` in a file of so many vertices.
///
/// An index counts from 1, a negative one back from the vertex line above; what follows a slash names texture and normal.
pub(crate) fn triangles(bytes: &[u8], num_vertices: usize) -> Result<Vec<[usize; 3]>, Flaw> {
    let (mut triangles, mut above) = (Vec::new(), 0_usize);
    for (line, text) in Lines::new(bytes) {
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
