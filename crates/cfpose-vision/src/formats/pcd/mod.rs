//! `.pcd`: point clouds of the Point Cloud Library, ascii, binary and binary_compressed.
//!
//! Read are the fields x, y, z and w, in any order, of any SIZE, TYPE and COUNT (of several values the first); other
//! fields are stepped over. An organised cloud marks missing points by NaN; here they are bad input, as in every format.
//!
//! Source: "The PCD (Point Cloud Data) file format", version 0.7.

mod body;
mod header;
mod lzf;

use cfpose::Points;

use crate::cursor::Lines;
use crate::error::{Fault, Flaw};
use crate::gather::{Gather, Layout, PointTable};
use crate::options::ReadOptions;
use crate::rows::{column_names, rows};

/// Read the points.
pub(super) fn read(bytes: &[u8], _options: &ReadOptions) -> Result<PointTable, Flaw> {
    let mut lines = Lines::new(bytes);
    let header = header::parse(&mut lines)?;
    let names: Vec<String> = header.fields.iter().map(|field| field.name.clone()).collect();
    let gather = Gather::new(Layout::by_xyz(&names, "field")?);
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
