//! The table of formats; one file for each.

mod las;
mod mask;
pub(crate) mod numpy;
pub(crate) mod obj;
mod pcd;
pub(crate) mod ply;
pub(crate) mod stl;
pub(crate) mod text;

use cfpose::Points;

use crate::error::{Fault, Flaw};
use crate::gather::PointTable;
use crate::options::ReadOptions;

/// Make points of the bytes of a whole file.
pub type ReadFn = fn(&[u8], &ReadOptions) -> Result<PointTable, Flaw>;

/// Make the bytes of a whole file of points.
pub type WriteFn = fn(&Points) -> Result<Vec<u8>, Fault>;

/// One way to keep points in a file.
#[derive(Debug, Clone, Copy)]
pub struct Format {
    /// Name, as [`crate::PointFile::format`] gives it.
    pub name: &'static str,
    /// Extensions in lower case, without the dot.
    pub extensions: &'static [&'static str],
    /// One line for a reader who wants to choose.
    pub summary: &'static str,
    /// Reader of the bytes of a whole file.
    pub read: ReadFn,
    /// Writer of the bytes of a whole file, where the format can be written.
    pub write: Option<WriteFn>,
}

/// Every format, in the order in which documents list them.
///
/// ```
/// use cfpose_vision::{FORMATS, ReadOptions};
/// let text = FORMATS.iter().find(|format| format.extensions.contains(&"csv")).unwrap();
/// let table = (text.read)(b"u;v\n1;2\n", &ReadOptions::default()).unwrap();
/// assert_eq!(table.columns, ["u", "v"]);
/// ```
pub const FORMATS: &[Format] = &[
    Format {
        name: "text",
        extensions: &["csv", "txt", "xyz", "asc"],
        summary: "1 to 3 columns, or more with names; comma, semicolon, tab or blanks; header optional; column w is a weight",
        read: text::read,
        write: Some(text::write),
    },
    Format {
        name: "tsv",
        extensions: &["tsv"],
        summary: "the same, written with tabs",
        read: text::read,
        write: Some(text::write_tsv),
    },
    Format {
        name: "pts",
        extensions: &["pts"],
        summary: "number of points, then x y z a line; intensity and colour may follow",
        read: text::read_pts,
        write: Some(text::write_pts),
    },
    Format {
        name: "ply",
        extensions: &["ply"],
        summary: "Stanford polygon file, ascii and binary; properties x, y, z, w and normal of the vertices",
        read: ply::read,
        write: Some(ply::write),
    },
    Format {
        name: "obj",
        extensions: &["obj"],
        summary: "Wavefront object; the vertices",
        read: obj::read,
        write: Some(obj::write),
    },
    Format {
        name: "stl",
        extensions: &["stl"],
        summary: "triangles, ascii and binary; their distinct corners",
        read: stl::read,
        write: None,
    },
    Format {
        name: "pcd",
        extensions: &["pcd"],
        summary: "Point Cloud Library, ascii, binary and binary_compressed; fields x, y, z, w and normal",
        read: pcd::read,
        write: Some(pcd::write),
    },
    Format {
        name: "las",
        extensions: &["las", "laz"],
        summary: "laser scan, versions 1.0 to 1.4, uncompressed",
        read: las::read,
        write: None,
    },
    Format {
        name: "npy",
        extensions: &["npy"],
        summary: "numpy array of N numbers, N x 1..3 or structured, floats or integers",
        read: numpy::read,
        write: Some(numpy::write),
    },
    Format {
        name: "npz",
        extensions: &["npz"],
        summary: "archive of numpy arrays: one, or columns by their names",
        read: numpy::read_archive,
        write: None,
    },
    Format {
        name: "mask",
        extensions: &["png", "jpg", "jpeg"],
        summary: "silhouette; the pixels of the region, centres at integers, x right, y down",
        read: mask::read,
        write: None,
    },
];
