//! The header of a pcd file.

use crate::columns::MOST_COLUMNS;
use crate::cursor::Lines;
use crate::error::{Fault, Flaw, Place, excerpt};
use crate::scalar::Scalar;

/// How the points are stored after the header.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Data {
    /// One point a line.
    Ascii,
    /// One point after the other, little-endian.
    Binary,
    /// One field of all points after the other, compressed with LZF.
    Compressed,
}

/// A field of a point.
#[derive(Debug, Clone)]
pub(super) struct Field {
    /// Name; `_` is padding.
    pub name: String,
    /// Type of each value.
    pub scalar: Scalar,
    /// Number of values.
    pub count: usize,
}

/// What precedes the points.
#[derive(Debug, Clone)]
pub(super) struct Header {
    /// Fields in the order of the file.
    pub fields: Vec<Field>,
    /// Claimed number of points.
    pub points: u64,
    /// Whether the points are a grid, in which some may be missing.
    pub organised: bool,
    /// Storage.
    pub data: Data,
}

/// The lines of the header as words, by keyword.
#[derive(Default)]
struct Words {
    fields: Vec<String>,
    size: Vec<String>,
    kind: Vec<String>,
    count: Vec<String>,
    width: Vec<String>,
    height: Vec<String>,
    points: Vec<String>,
}

/// Parse the lines up to `DATA`.
pub(super) fn parse(lines: &mut Lines) -> Result<Header, Flaw> {
    let mut words = Words::default();
    for (line, text) in lines {
        let fail = |fault| Flaw::new(Place::Line(line), fault);
        let content = text.split('#').next().unwrap_or_default();
        let mut rest = content.split_whitespace();
        let Some(keyword) = rest.next() else { continue };
        let rest: Vec<String> = rest.take(MOST_COLUMNS + 1).map(str::to_string).collect();
        if rest.len() > MOST_COLUMNS {
            return Err(fail(Fault::Header { what: format!("gives {keyword} more than {MOST_COLUMNS} words") }));
        }
        let slot = match keyword {
            "VERSION" | "VIEWPOINT" => continue,
            "FIELDS" | "COLUMNS" => &mut words.fields,
            "SIZE" => &mut words.size,
            "TYPE" => &mut words.kind,
            "COUNT" => &mut words.count,
            "WIDTH" => &mut words.width,
            "HEIGHT" => &mut words.height,
            "POINTS" => &mut words.points,
            "DATA" => return words.finish(&rest).map_err(fail),
            _ => return Err(fail(Fault::Header { what: format!("has the line {:?}", excerpt(&text)) })),
        };
        if !slot.is_empty() {
            return Err(fail(Fault::Header { what: format!("has two lines {keyword}") }));
        }
        *slot = rest;
    }
    Err(Fault::Header { what: "has no line DATA".into() }.into())
}

impl Words {
    /// Make a header of the words.
    fn finish(&self, data: &[String]) -> Result<Header, Fault> {
        let data = match data.first().map(String::as_str) {
            Some("ascii") => Data::Ascii,
            Some("binary") => Data::Binary,
            Some("binary_compressed") => Data::Compressed,
            other => {
                let what = format!("DATA {:?}", excerpt(other.unwrap_or_default()));
                return Err(Fault::Unsupported { what, advice: "write ascii, binary or binary_compressed" });
            }
        };
        let counted = self.count.is_empty() || self.count.len() == self.fields.len();
        if self.size.len() != self.fields.len() || self.kind.len() != self.fields.len() || !counted {
            return Err(Fault::Header { what: "gives FIELDS, SIZE, TYPE and COUNT in different numbers".into() });
        }
        let fields = (0..self.fields.len()).map(|index| self.field(index)).collect::<Result<Vec<Field>, Fault>>()?;
        let organised = self.height.first().is_some_and(|height| height.parse::<u64>().is_ok_and(|height| height > 1));
        Ok(Header { fields, points: self.points()?, organised, data })
    }

    fn field(&self, index: usize) -> Result<Field, Fault> {
        let scalar = match (self.kind[index].as_str(), self.size[index].as_str()) {
            ("F", "4") => Scalar::Float(4),
            ("F", "8") => Scalar::Float(8),
            ("I", "1") => Scalar::Signed(1),
            ("I", "2") => Scalar::Signed(2),
            ("I", "4") => Scalar::Signed(4),
            ("I", "8") => Scalar::Signed(8),
            ("U", "1") => Scalar::Unsigned(1),
            ("U", "2") => Scalar::Unsigned(2),
            ("U", "4") => Scalar::Unsigned(4),
            ("U", "8") => Scalar::Unsigned(8),
            (kind, size) => {
                let what = format!("TYPE {:?} of SIZE {:?}", excerpt(kind), excerpt(size));
                return Err(Fault::Unsupported { what, advice: "write F of 4 or 8 bytes" });
            }
        };
        let count = self.count.get(index).map_or(Some(1), |count| count.parse().ok());
        let count = count.ok_or_else(|| Fault::Header { what: format!("counts {:?}", excerpt(&self.count[index])) })?;
        let name = self.fields[index].clone();
        if count == 0 && ["x", "y", "z", "w"].iter().any(|axis| name.eq_ignore_ascii_case(axis)) {
            return Err(Fault::Header { what: format!("gives the field {name} a COUNT of 0") });
        }
        Ok(Field { name, scalar, count })
    }

    /// Return POINTS or, as in old files, WIDTH times HEIGHT; where both are there they agree.
    fn points(&self) -> Result<u64, Fault> {
        let number = |words: &[String], name: &str| -> Result<u64, Fault> {
            let word = match words {
                [word] => word.as_str(),
                _ => {
                    return Err(Fault::Header {
                        what: format!("gives {name} {} numbers in place of one", words.len()),
                    });
                }
            };
            word.parse().map_err(|_| Fault::Header { what: format!("gives {name} as {:?}", excerpt(word)) })
        };
        let points = if self.points.is_empty() { None } else { Some(number(&self.points, "POINTS")?) };
        match (points, self.width.is_empty(), self.height.is_empty()) {
            (Some(points), true, true) => return Ok(points),
            (_, false, true) => return Err(Fault::Header { what: "gives WIDTH without HEIGHT".into() }),
            (_, true, false) => return Err(Fault::Header { what: "gives HEIGHT without WIDTH".into() }),
            _ => {}
        }
        let (width, height) = (number(&self.width, "WIDTH")?, number(&self.height, "HEIGHT")?);
        let product = width
            .checked_mul(height)
            .ok_or_else(|| Fault::Header { what: "gives WIDTH and HEIGHT beyond all files".into() })?;
        match points {
            Some(points) if points != product => {
                let what = format!("gives POINTS {points}, but WIDTH {width} x HEIGHT {height} are {product}");
                Err(Fault::Header { what })
            }
            _ => Ok(product),
        }
    }
}
