//! The header of a ply file.

use crate::cursor::Lines;
use crate::error::{Fault, Flaw, Place, excerpt};
use crate::scalar::Scalar;

/// How numbers are stored after the header.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Encoding {
    /// One element a line.
    Ascii,
    /// Bytes without gaps.
    Binary {
        /// Most significant byte first.
        big_endian: bool,
    },
}

/// A property of an element.
#[derive(Debug, Clone)]
pub(super) struct Property {
    /// Name.
    pub name: String,
    /// Type of the number, or of the numbers of a list.
    pub scalar: Scalar,
    /// Type of the length, where the property is a list.
    pub length: Option<Scalar>,
}

/// A kind of element and how many the header claims.
#[derive(Debug, Clone)]
pub(super) struct Element {
    /// Name.
    pub name: String,
    /// Claimed number.
    pub count: u64,
    /// Properties in the order of the file.
    pub properties: Vec<Property>,
}

impl Element {
    /// Return the bytes of one binary element if it has no list.
    pub(super) fn stride(&self) -> Option<usize> {
        self.properties.iter().map(|p| if p.length.is_some() { None } else { Some(p.scalar.size()) }).sum()
    }
}

/// What precedes the data.
#[derive(Debug, Clone)]
pub(super) struct Header {
    /// Encoding of the data.
    pub encoding: Encoding,
    /// Elements in the order of the file.
    pub elements: Vec<Element>,
}

/// Parse the lines up to `end_header`.
pub(super) fn parse(lines: &mut Lines) -> Result<Header, Flaw> {
    if lines.next().is_none_or(|(_, text)| text.trim_end() != "ply") {
        return Err(Fault::Header { what: "does not begin with the line \"ply\"".into() }.into());
    }
    let mut encoding = None;
    let mut elements: Vec<Element> = Vec::new();
    for (line, text) in lines {
        let fail = |what: String| Flaw::new(Place::Line(line), Fault::Header { what });
        let words: Vec<&str> = text.split_whitespace().collect();
        match words.as_slice() {
            [] | ["comment", ..] | ["obj_info", ..] => {}
            ["format", ..] if encoding.is_some() => return Err(fail("names the format twice".into())),
            ["format", name, _version] => {
                encoding = Some(parse_encoding(name).map_err(|f| Flaw::new(Place::Line(line), f))?)
            }
            ["element", name, count] => {
                if elements.iter().any(|element| element.name == *name) {
                    return Err(fail(format!("names the element {:?} twice", excerpt(name))));
                }
                let count = count.parse().map_err(|_| fail(format!("counts {:?} elements", excerpt(count))))?;
                elements.push(Element { name: name.to_string(), count, properties: Vec::new() });
            }
            ["property", rest @ ..] => {
                let property =
                    parse_property(rest).ok_or_else(|| fail(format!("has the line {:?}", excerpt(&text))))?;
                let element = elements.last_mut().ok_or_else(|| fail("has a property before any element".into()))?;
                element.properties.push(property);
            }
            ["end_header"] => {
                let encoding = encoding.ok_or_else(|| fail("names no format".into()))?;
                return Ok(Header { encoding, elements });
            }
            _ => return Err(fail(format!("has the line {:?}", excerpt(&text)))),
        }
    }
    Err(Fault::Header { what: "has no end_header".into() }.into())
}

fn parse_encoding(name: &str) -> Result<Encoding, Fault> {
    match name {
        "ascii" => Ok(Encoding::Ascii),
        "binary_little_endian" => Ok(Encoding::Binary { big_endian: false }),
        "binary_big_endian" => Ok(Encoding::Binary { big_endian: true }),
        _ => Err(Fault::Unsupported {
            what: format!("the ply format {:?}", excerpt(name)),
            advice: "write ascii, binary_little_endian or binary_big_endian",
        }),
    }
}

fn parse_property(words: &[&str]) -> Option<Property> {
    match words {
        ["list", length, scalar, name] => {
            // A length that may be a fraction is no length.
            let length = parse_scalar(length).filter(|scalar| !matches!(scalar, Scalar::Float(_)))?;
            Some(Property { name: name.to_string(), scalar: parse_scalar(scalar)?, length: Some(length) })
        }
        [scalar, name] => Some(Property { name: name.to_string(), scalar: parse_scalar(scalar)?, length: None }),
        _ => None,
    }
}

fn parse_scalar(name: &str) -> Option<Scalar> {
    Some(match name {
        "char" | "int8" => Scalar::Signed(1),
        "uchar" | "uint8" => Scalar::Unsigned(1),
        "short" | "int16" => Scalar::Signed(2),
        "ushort" | "uint16" => Scalar::Unsigned(2),
        "int" | "int32" => Scalar::Signed(4),
        "uint" | "uint32" => Scalar::Unsigned(4),
        "float" | "float32" => Scalar::Float(4),
        "double" | "float64" => Scalar::Float(8),
        _ => return None,
    })
}
