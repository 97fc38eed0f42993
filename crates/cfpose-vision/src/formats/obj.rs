//! `.obj`: the vertices of a Wavefront object; everything else is ignored.
//!
//! A vertex line is `v x y z`; what may follow (a homogeneous weight, a colour) is ignored, since neither is the weight
//! of a point.

use cfpose::Points;

use super::text::number;
use crate::cursor::Lines;
use crate::error::{Fault, Flaw, Place};
use crate::gather::{Gather, Layout, PointTable};
use crate::read::ReadOptions;
use crate::write::rows;

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

/// Write one vertex a line, for points of dimension 3 without weights.
pub(super) fn write(points: &Points) -> Result<Vec<u8>, Fault> {
    if points.dim() != 3 || !points.is_uniform() {
        let what = "an obj file holds points of dimension 3 without weights".to_string();
        return Err(Fault::Unwritable { what, advice: "csv or ply" });
    }
    Ok(rows(points, " ", "v ").into_bytes())
}
