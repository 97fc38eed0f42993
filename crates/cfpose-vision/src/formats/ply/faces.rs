//! The faces of a ply file.

use super::body::{measure, short};
use super::header::{Element, Encoding, Header};
use crate::cursor::Lines;
use crate::error::{Fault, Flaw, Place, excerpt};
use crate::triangles::push_fan;

/// Return the triangles of the element `face`, none where it has no list of vertices.
pub(super) fn read(header: &Header, mut lines: Lines, num_vertices: usize) -> Result<Vec<[usize; 3]>, Flaw> {
    let mut triangles = Vec::new();
    let mut rest = lines.rest();
    for element in header.elements.iter().filter(|element| !element.properties.is_empty()) {
        let list = (element.name == "face").then(|| list_of(element)).flatten();
        for row in 0..element.count {
            let polygon = match header.encoding {
                Encoding::Ascii => ascii(element, list, &mut lines, row)?,
                Encoding::Binary { big_endian } => binary(element, list, &mut rest, big_endian, row)?,
            };
            if let Some((at, polygon)) = polygon {
                push_fan(&mut triangles, &polygon, num_vertices).map_err(|fault| Flaw::new(at, fault))?;
            }
        }
    }
    Ok(triangles)
}

/// Find the property that lists the vertices.
fn list_of(element: &Element) -> Option<usize> {
    let names = ["vertex_indices", "vertex_index"];
    element.properties.iter().position(|p| p.length.is_some() && names.contains(&p.name.as_str()))
}

/// Where a face stands, and the indices of its vertices.
type Polygon = Option<(Place, Vec<usize>)>;

/// Take one line with content.
fn ascii(element: &Element, list: Option<usize>, lines: &mut Lines, row: u64) -> Result<Polygon, Flaw> {
    let Some((line, text)) = lines.find(|(_, text)| !text.trim().is_empty()) else { return Err(short(element, row)) };
    let Some(list) = list else { return Ok(None) };
    let at = Place::Line(line);
    let fields: Vec<&str> = text.split_whitespace().collect();
    let mut begin = 0;
    for (index, property) in element.properties.iter().enumerate() {
        let length = match property.length {
            None => 0,
            Some(_) => fields.get(begin).and_then(|field| field.parse::<usize>().ok()).unwrap_or(usize::MAX),
        };
        let end = (begin + 1).checked_add(length).filter(|end| *end <= fields.len());
        let cut = || Flaw::new(at, Fault::Face { what: "the face is cut off".into() });
        let end = end.ok_or_else(cut)?;
        if index == list {
            let read = |field: &&str| field.parse::<usize>().map_err(|_| Flaw::new(at, no_index(field)));
            return Ok(Some((at, fields[begin + 1..end].iter().map(read).collect::<Result<_, _>>()?)));
        }
        begin = end;
    }
    Ok(None)
}

/// Take the bytes of one element off the front.
fn binary(element: &Element, list: Option<usize>, rest: &mut &[u8], big: bool, row: u64) -> Result<Polygon, Flaw> {
    let at = Place::Row(row as usize + 1);
    let mut offsets = vec![0; element.properties.len()];
    let size = measure(&element.properties, rest, big, &mut offsets).map_err(|fault| Flaw::new(at, fault))?;
    let size = size.ok_or_else(|| short(element, row))?;
    let (bytes, after) = rest.split_at(size);
    *rest = after;
    let Some(list) = list else { return Ok(None) };
    let property = &element.properties[list];
    let wrong = || Fault::Face { what: "the face is cut off".into() };
    let fail = |fault| Flaw::new(at, fault);
    let length = property.length.ok_or_else(|| fail(wrong()))?;
    let count = length.decode(&bytes[offsets[list]..], big).ok_or_else(|| fail(wrong()))?;
    let begin = offsets[list] + length.size();
    let read = |k: usize| {
        let value = property.scalar.decode(&bytes[begin + k * property.scalar.size()..], big);
        let value = value.ok_or_else(|| fail(wrong()))?;
        let whole = value >= 0.0 && value.fract() == 0.0;
        if whole { Ok(value as usize) } else { Err(fail(no_index(&value.to_string()))) }
    };
    Ok(Some((at, (0..count as usize).map(read).collect::<Result<_, Flaw>>()?)))
}

fn no_index(text: &str) -> Fault {
    Fault::Face { what: format!("the face has the index {:?}", excerpt(text)) }
}
