//! `.npy`: an array of numpy, N x 1..3 or of N numbers.
//!
//! Read are integers of 1 to 8 bytes and floats of 4 and 8, both byte orders, C and Fortran order, format versions 1
//! to 3. Source: numpy.lib.format.

use cfpose::Points;

use crate::error::{Fault, Flaw, Place, excerpt};
use crate::gather::{Gather, Layout, PointTable};
use crate::options::ReadOptions;
use crate::scalar::Scalar;

const MAGIC: &[u8] = b"\x93NUMPY";
const RESAVE: &str = "save it with numpy.save(name, array.astype(float)), one row a point";

/// Read an array.
pub(super) fn read(bytes: &[u8], _options: &ReadOptions) -> Result<PointTable, Flaw> {
    let (header, data) = split(bytes)?;
    let (scalar, big_endian) = number_type(&header)?;
    let fortran = match value(&header, "fortran_order") {
        Some(text) if text.starts_with("True") => true,
        Some(text) if text.starts_with("False") => false,
        _ => return Err(Fault::Header { what: "does not say whether fortran_order is True".into() }.into()),
    };
    let (rows, dim) = shape(&header)?;
    let stride = scalar.size() * dim;
    let held = data.len() / stride;
    // Compared as u64: a claimed number of rows need not fit the machine.
    if rows > held as u64 {
        return Err(Fault::Claims { what: "rows".into(), claimed: rows.to_string(), held: held.to_string() }.into());
    }
    let rows = rows as usize;
    let mut gather = Gather::new(Layout::anonymous(dim)?);
    for row in 0..rows {
        gather.push(Place::Row(row + 1), |d, _| {
            let index = if fortran { d * rows + row } else { row * dim + d };
            let decoded = scalar.decode(&data[index * scalar.size()..], big_endian);
            decoded.ok_or(Fault::Header { what: "names a number of unknown width".into() })
        })?;
    }
    gather.finish()
}

/// Split the file into the text of its header and its data.
fn split(bytes: &[u8]) -> Result<(String, &[u8]), Fault> {
    let header = |what: &str| Fault::Header { what: what.to_string() };
    let rest = bytes.strip_prefix(MAGIC).ok_or_else(|| header("does not begin with \\x93NUMPY"))?;
    let (length, rest) = match rest {
        [1, _, a, b, rest @ ..] => (u32::from(u16::from_le_bytes([*a, *b])), rest),
        [2 | 3, _, a, b, c, d, rest @ ..] => (u32::from_le_bytes([*a, *b, *c, *d]), rest),
        [version, _, _, _, ..] => {
            let what = format!("npy version {version}");
            return Err(Fault::Unsupported { what, advice: RESAVE });
        }
        _ => return Err(header("is cut off")),
    };
    let text = rest.get(..length as usize).ok_or_else(|| header("is cut off"))?;
    Ok((String::from_utf8_lossy(text).into_owned(), &rest[text.len()..]))
}

/// Find what follows a key of the Python dictionary that the header is.
fn value<'a>(header: &'a str, key: &str) -> Option<&'a str> {
    let quoted = [format!("'{key}'"), format!("\"{key}\"")];
    let after = quoted.iter().find_map(|key| header.split_once(key.as_str()))?.1;
    Some(after.trim_start().strip_prefix(':')?.trim_start())
}

fn number_type(header: &str) -> Result<(Scalar, bool), Fault> {
    let text = value(header, "descr").ok_or_else(|| Fault::Header { what: "names no descr".into() })?;
    let refuse = |text: &str| Fault::Unsupported { what: format!("the dtype {:?}", excerpt(text)), advice: RESAVE };
    let quote = text.chars().next().filter(|c| matches!(c, '\'' | '"')).ok_or_else(|| refuse(text))?;
    let name = text[1..].split(quote).next().unwrap_or_default();
    let (big_endian, kind) = match name.split_at_checked(1) {
        Some(("<" | "=" | "|", kind)) => (false, kind),
        Some((">", kind)) => (true, kind),
        _ => return Err(refuse(name)),
    };
    let scalar = match kind {
        "f4" => Scalar::Float(4),
        "f8" => Scalar::Float(8),
        "i1" => Scalar::Signed(1),
        "i2" => Scalar::Signed(2),
        "i4" => Scalar::Signed(4),
        "i8" => Scalar::Signed(8),
        "u1" => Scalar::Unsigned(1),
        "u2" => Scalar::Unsigned(2),
        "u4" => Scalar::Unsigned(4),
        "u8" => Scalar::Unsigned(8),
        _ => return Err(refuse(name)),
    };
    Ok((scalar, big_endian))
}

/// Parse the shape into a number of rows and of columns.
fn shape(header: &str) -> Result<(u64, usize), Fault> {
    let text = value(header, "shape").ok_or_else(|| Fault::Header { what: "names no shape".into() })?;
    let inside = text.strip_prefix('(').and_then(|text| text.split_once(')')).map(|(inside, _)| inside);
    let parsed: Option<Vec<u64>> = inside.and_then(|inside| {
        let fields = inside.split(',').map(str::trim).filter(|field| !field.is_empty());
        fields.map(|field| field.trim_end_matches('L').parse().ok()).collect()
    });
    let shape = format!("the shape ({})", excerpt(inside.unwrap_or_default()));
    let refuse = |advice| Fault::Unsupported { what: shape.clone(), advice };
    match parsed.as_deref() {
        Some([rows]) => Ok((*rows, 1)),
        Some([rows, dim @ 1..=3]) => Ok((*rows, *dim as usize)),
        Some([1..=3, _]) => Err(refuse("save the transposed array, one row a point")),
        Some(_) => Err(refuse(RESAVE)),
        None => Err(Fault::Header { what: format!("has the shape {:?}", excerpt(text.trim_end())) }),
    }
}

/// Write an N x dim array of little-endian doubles in C order, for points without weights.
pub(super) fn write(points: &Points) -> Result<Vec<u8>, Fault> {
    if !points.is_uniform() {
        return Err(Fault::Unwritable { what: "an npy array has no name for weights".into(), advice: "csv or ply" });
    }
    let dict = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({}, {}), }}", points.len(), points.dim());
    // Magic, version, length and text end, with a line feed, at a multiple of 64 bytes.
    let length = (10 + dict.len() + 1).next_multiple_of(64) - 10;
    let mut bytes = [MAGIC, &[1, 0], &(length as u16).to_le_bytes()].concat();
    bytes.extend_from_slice(format!("{dict:<width$}\n", width = length - 1).as_bytes());
    for k in 0..points.len() {
        bytes.extend(points.point(k)[..points.dim()].iter().flat_map(|value| value.to_le_bytes()));
    }
    Ok(bytes)
}
