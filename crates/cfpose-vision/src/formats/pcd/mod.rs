//! `.pcd`: point clouds of the Point Cloud Library, ascii, binary and binary_compressed.
//!
//! Read are the fields x, y, z and w, in any order, of any SIZE, TYPE and COUNT (of several values the first); other
//! fields are stepped over. normal_x, normal_y and normal_z are the normal. Of an organised cloud (HEIGHT above 1) points
//! that are not finite are missing and skipped.
//!
//! Source: "The PCD (Point Cloud Data) file format", version 0.7.

mod body;
mod header;
mod lzf;

use cfpose::Points;

use crate::columns::Layout;
use crate::cursor::Lines;
use crate::error::{Fault, Flaw, excerpt};
use crate::gather::{Gather, PointTable};
use crate::lines::refuse_lone_returns;
use crate::options::ReadOptions;
use crate::rows::{column_names, rows};

/// Read the points.
pub(super) fn read(bytes: &[u8], options: &ReadOptions) -> Result<PointTable, Flaw> {
    let mut lines = Lines::new(bytes);
    let header = header::parse(&mut lines)?;
    let names: Vec<String> = header.fields.iter().map(|field| field.name.clone()).collect();
    let layout = Layout::by_xyz(&names, "field", options)?;
    if let Some(empty) = layout.read().map(|index| &header.fields[index]).find(|field| field.count == 0) {
        return Err(Fault::Header { what: format!("gives the field {} a COUNT of 0", excerpt(&empty.name)) }.into());
    }
    // The text of the file, which in a binary one is the header.
    let binary = header.data != header::Data::Ascii;
    refuse_lone_returns(&bytes[..bytes.len() - if binary { lines.rest().len() } else { 0 }])?;
    let gather = Gather::new(layout, options).organised(header.organised);
    body::read(&header, lines, gather)?.finish()
}

/// Write ascii with fields of 8 bytes.
pub(super) fn write(points: &Points) -> Result<Vec<u8>, Fault> {
    let names = column_names(points);
    let (size, kind, count) = (" 8".repeat(names.len()), " F".repeat(names.len()), " 1".repeat(names.len()));
    let (fields, len) = (names.join(" "), points.len());
    let header = format!(
        "VERSION 0.7\nFIELDS {fields}\nSIZE{size}\nTYPE{kind}\nCOUNT{count}\nWIDTH {len}\nHEIGHT 1\n\
         VIEWPOINT 0 0 0 1 0 0 0\nPOINTS {len}\nDATA ascii\n"
    );
    Ok((header + &rows(points, " ", "")).into_bytes())
}
