//! `.ply`: Stanford polygon files, ascii and binary in both byte orders.
//!
//! Read are the properties x, y, z and w of the element `vertex`, in any order and of any scalar type; other
//! properties (also lists) and other elements are stepped over, and must be there. nx, ny and nz are the normal.
//!
//! Source: G. Turk, "The PLY polygon file format", 1994. As there, an ascii element stands on one line.

mod body;
mod faces;
mod header;

use cfpose::Points;

use crate::columns::Layout;
use crate::cursor::Lines;
use crate::error::{Fault, Flaw, excerpt};
use crate::gather::{Gather, PointTable};
use crate::lines::refuse_lone_returns;
use crate::options::ReadOptions;
use crate::rows::{column_names, rows};

/// Read the vertices.
pub(super) fn read(bytes: &[u8], options: &ReadOptions) -> Result<PointTable, Flaw> {
    let mut lines = Lines::new(bytes);
    let header = header::parse(&mut lines)?;
    let Some(vertex) = header.elements.iter().find(|element| element.name == "vertex") else {
        return Err(Fault::Header { what: "names no element vertex".into() }.into());
    };
    let names: Vec<String> = vertex.properties.iter().map(|property| property.name.clone()).collect();
    let layout = Layout::by_xyz(&names, "vertex property", options)?;
    if let Some(list) = layout.read().map(|index| &vertex.properties[index]).find(|p| p.length.is_some()) {
        return Err(Fault::Header { what: format!("gives {} as a list", excerpt(&list.name)) }.into());
    }
    // The text of the file, which in a binary one is the header.
    let binary = header.encoding != header::Encoding::Ascii;
    refuse_lone_returns(&bytes[..bytes.len() - if binary { lines.rest().len() } else { 0 }])?;
    body::read(&header, lines, Gather::new(layout, options))?.finish()
}

/// Read the faces of a file of so many vertices.
pub(crate) fn triangles(bytes: &[u8], num_vertices: usize) -> Result<Vec<[usize; 3]>, Flaw> {
    let mut lines = Lines::new(bytes);
    let header = header::parse(&mut lines)?;
    faces::read(&header, lines, num_vertices)
}

/// Write ascii with properties of type double.
pub(super) fn write(points: &Points) -> Result<Vec<u8>, Fault> {
    let mut text = format!("ply\nformat ascii 1.0\nelement vertex {}\n", points.len());
    for name in column_names(points) {
        text.push_str(&format!("property double {name}\n"));
    }
    text.push_str("end_header\n");
    text.push_str(&rows(points, " ", ""));
    Ok(text.into_bytes())
}
