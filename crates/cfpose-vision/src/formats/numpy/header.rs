//! The header of an array.

use crate::columns::MOST_COLUMNS;
use crate::error::{Fault, excerpt};
use crate::scalar::Scalar;

pub(super) const MAGIC: &[u8] = b"\x93NUMPY";
const RESAVE: &str = "save it with numpy.save(name, array.astype(float)), one row a point";

/// A number in each item of an array.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Field {
    /// Name; empty where the items are plain numbers.
    pub name: String,
    /// Type.
    pub scalar: Scalar,
    /// Most significant byte first.
    pub big_endian: bool,
    /// Where the number begins in the item.
    pub offset: usize,
}

/// What precedes the data of an array.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Header {
    /// Numbers of an item: one without a name, or those of a structured type.
    pub fields: Vec<Field>,
    /// Bytes of an item.
    pub item: usize,
    /// Whether the first index runs fastest.
    pub fortran: bool,
    /// Number of rows as claimed.
    pub rows: u64,
    /// Items in a row.
    pub columns: usize,
    /// The shape as it stands there.
    pub shape: String,
}

/// Parse the header and return the data behind it.
pub(super) fn parse(bytes: &[u8]) -> Result<(Header, &[u8]), Fault> {
    let (text, data) = split(bytes)?;
    let (fields, item) = item_type(&text)?;
    let fortran = match value(&text, "fortran_order") {
        Some(text) if text.starts_with("True") => true,
        Some(text) if text.starts_with("False") => false,
        _ => return Err(Fault::Header { what: "does not say whether fortran_order is True".into() }),
    };
    let (rows, columns, shape) = shape(&text)?;
    Ok((Header { fields, item, fortran, rows, columns, shape }, data))
}

impl Header {
    /// Say that an array of this shape is no point set, and what to do.
    pub(super) fn refuse_shape(&self, advice: &'static str) -> Fault {
        Fault::Unsupported { what: format!("the shape ({})", self.shape), advice }
    }
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

/// Read the type of the items: one number, or a list of named numbers.
fn item_type(header: &str) -> Result<(Vec<Field>, usize), Fault> {
    let text = value(header, "descr").ok_or_else(|| Fault::Header { what: "names no descr".into() })?;
    let refuse = || Fault::Unsupported { what: format!("the dtype {:?}", excerpt(text)), advice: RESAVE };
    if let Some(list) = text.strip_prefix('[') {
        return structured(list).ok_or_else(refuse);
    }
    let (name, _) = quoted(text).ok_or_else(refuse)?;
    let refuse = || Fault::Unsupported { what: format!("the dtype {:?}", excerpt(name)), advice: RESAVE };
    let (scalar, big_endian) = number_type(name).ok_or_else(refuse)?;
    Ok((vec![Field { name: String::new(), scalar, big_endian, offset: 0 }], scalar.size()))
}

/// Read `('x', '<f8'), ('normal', '<f4', (3,)), ('', '|V4')]`: each number under its name, those of a sub-array under the
/// name and their index; what is no number is stepped over.
fn structured(list: &str) -> Option<(Vec<Field>, usize)> {
    let (mut fields, mut offset, mut rest) = (Vec::new(), 0usize, list.trim_start());
    while let Some(inside) = rest.strip_prefix('(') {
        let (name, after) = quoted(inside.trim_start())?;
        let (kind, after) = quoted(after.trim_start().strip_prefix(',')?.trim_start())?;
        let after = after.trim_start();
        let (count, after) = match after.strip_prefix(',').map(str::trim_start) {
            Some(after) if after.starts_with('(') => {
                let (inside, after) = after[1..].split_once(')')?;
                let sizes = inside.split(',').map(str::trim).filter(|size| !size.is_empty());
                let count = sizes.map(|size| size.parse::<usize>().ok()).try_fold(1usize, |a, b| a.checked_mul(b?))?;
                (Some(count), after.trim_start())
            }
            Some(after) => (None, after),
            None => (None, after),
        };
        rest = after.strip_prefix(')')?.trim_start();
        rest = rest.strip_prefix(',').unwrap_or(rest).trim_start();
        let number = number_type(kind);
        let size = number.map(|(scalar, _)| scalar.size()).or_else(|| width(kind))?;
        for index in 0..count.unwrap_or(1) {
            if fields.len() > MOST_COLUMNS {
                return None;
            }
            if let Some((scalar, big_endian)) = number {
                let name = if count.is_some() { format!("{name}_{index}") } else { name.to_string() };
                fields.push(Field { name, scalar, big_endian, offset });
                offset = offset.checked_add(size)?;
            } else {
                offset = offset.checked_add(size.checked_mul(count.unwrap_or(1))?)?;
                break;
            }
        }
    }
    (rest.starts_with(']') && !fields.is_empty()).then_some((fields, offset))
}

/// Take a Python string off the front of a text.
fn quoted(text: &str) -> Option<(&str, &str)> {
    let quote = text.chars().next().filter(|c| matches!(c, '\'' | '"'))?;
    text[1..].split_once(quote)
}

/// Return the bytes of a type that is no number: text, raw bytes, truth.
fn width(kind: &str) -> Option<usize> {
    let (_, kind) = kind.split_at_checked(1)?;
    let (letter, size) = kind.split_at_checked(1)?;
    let size: usize = size.parse().ok()?;
    match letter {
        "V" | "S" | "a" | "b" | "c" | "m" | "M" => Some(size),
        "U" => size.checked_mul(4),
        _ => None,
    }
}

fn number_type(name: &str) -> Option<(Scalar, bool)> {
    let (big_endian, kind) = match name.split_at_checked(1)? {
        ("<" | "=" | "|", kind) => (false, kind),
        (">", kind) => (true, kind),
        _ => return None,
    };
    let scalar = match kind {
        "f2" => Scalar::Float(2),
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
        _ => return None,
    };
    Some((scalar, big_endian))
}

/// Parse the shape into a number of rows, of columns, and its text; sides of length 1 between or before them do not count.
fn shape(header: &str) -> Result<(u64, usize, String), Fault> {
    let text = value(header, "shape").ok_or_else(|| Fault::Header { what: "names no shape".into() })?;
    let inside = text.strip_prefix('(').and_then(|text| text.split_once(')')).map(|(inside, _)| inside);
    let parsed: Option<Vec<u64>> = inside.and_then(|inside| {
        let fields = inside.split(',').map(str::trim).filter(|field| !field.is_empty());
        fields.take(32).map(|field| field.trim_end_matches('L').parse().ok()).collect()
    });
    let Some(mut sides) = parsed else {
        return Err(Fault::Header { what: format!("has the shape {:?}", excerpt(text.trim_end())) });
    };
    let shape = excerpt(inside.unwrap_or_default());
    while sides.len() > 2
        && let Some(one) = sides[..sides.len() - 1].iter().rposition(|side| *side == 1)
    {
        sides.remove(one);
    }
    let refuse = |advice| Fault::Unsupported { what: format!("the shape ({shape})"), advice };
    match sides[..] {
        [rows] => Ok((rows, 1, shape)),
        [rows, columns] if columns > 0 && columns <= MOST_COLUMNS as u64 => Ok((rows, columns as usize, shape)),
        [1..=3, _] => Err(refuse(TRANSPOSE)),
        [_, _, _, ..] => Err(refuse("save array.reshape(-1, array.shape[-1]), one row a point")),
        _ => Err(refuse(RESAVE)),
    }
}

/// Advice for an array that holds a coordinate in each row.
pub(super) const TRANSPOSE: &str = "save the transposed array, one row a point";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn structured_types_give_each_number_its_name_and_place() {
        let fields = |text: &str| {
            let (fields, item) = structured(text)?;
            Some((fields.into_iter().map(|field| (field.name, field.offset)).collect::<Vec<_>>(), item))
        };
        let named = |list: &[(&str, usize)]| list.iter().map(|(name, at)| (name.to_string(), *at)).collect::<Vec<_>>();
        let text = "('x', '<f8'), ('', '|V4'), ('n', '>f4', (2,)), (\"s\", '<U3'), ('i', '|u1')], more";
        assert_eq!(fields(text), Some((named(&[("x", 0), ("n_0", 12), ("n_1", 16), ("i", 32)]), 33)));
        for text in
            ["('x', '<c16')]", "('x', '<f8')", "('x')]", "]", "('x', [('y', '<f8')])]", "('x', '<f8', (99999,))]"]
        {
            assert_eq!(fields(text), None, "{text}");
        }
    }
}
