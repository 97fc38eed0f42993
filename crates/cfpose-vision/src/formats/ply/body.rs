//! The elements of a ply file.

use super::header::{Element, Encoding, Header, Property};
use crate::cursor::Lines;
use crate::error::{Fault, Flaw, Place, excerpt};
use crate::gather::Gather;
use crate::rows::typed;

/// Gather the vertices and step over everything else, up to the last element.
pub(super) fn read(header: &Header, mut lines: Lines, mut gather: Gather) -> Result<Gather, Flaw> {
    let mut seen = false;
    let mut rest = lines.rest();
    for element in &header.elements {
        // Without properties an element takes no byte, so its count bounds no loop.
        if element.properties.is_empty() {
            continue;
        }
        let vertices = (element.name == "vertex" && !seen).then_some(&mut gather);
        seen |= element.name == "vertex";
        match header.encoding {
            Encoding::Ascii => read_ascii(element, &mut lines, vertices)?,
            Encoding::Binary { big_endian } => rest = read_binary(element, rest, big_endian, vertices)?,
        }
    }
    check_end(header, lines, rest)?;
    Ok(gather)
}

/// Check that nothing but blanks follows the last element.
fn check_end(header: &Header, mut lines: Lines, rest: &[u8]) -> Result<(), Flaw> {
    let Some(last) = header.elements.iter().rfind(|element| !element.properties.is_empty()) else { return Ok(()) };
    let what = format!("elements of {:?}", excerpt(&last.name));
    let extra = Fault::Extra { what, claimed: last.count.to_string() };
    match header.encoding {
        Encoding::Ascii => match lines.find(|(_, text)| !text.trim().is_empty()) {
            Some((line, _)) => Err(Flaw::new(Place::Line(line), extra)),
            None => Ok(()),
        },
        Encoding::Binary { .. } if rest.iter().all(u8::is_ascii_whitespace) => Ok(()),
        Encoding::Binary { .. } => Err(Flaw::new(Place::Row(last.count.saturating_add(1) as usize), extra)),
    }
}

/// Say that the file ends before the elements that its header claims.
pub(super) fn short(element: &Element, held: u64) -> Flaw {
    let what = format!("elements of {:?}", excerpt(&element.name));
    Fault::Claims { what, claimed: element.count.to_string(), held: held.to_string() }.into()
}

/// Take one line for each element; lines without content do not count.
fn read_ascii(element: &Element, lines: &mut Lines, mut vertices: Option<&mut Gather>) -> Result<(), Flaw> {
    let mut held = 0;
    while held < element.count {
        let Some((line, text)) = lines.next() else { return Err(short(element, held)) };
        let mut fields: Vec<&str> = text.split_whitespace().collect();
        if fields.is_empty() {
            continue;
        }
        held += 1;
        let Some(gather) = vertices.as_deref_mut() else { continue };
        let at = Place::Line(line);
        drop_lists(&element.properties, &mut fields).map_err(|fault| Flaw::new(at, fault))?;
        if fields.len() != element.properties.len() {
            let (found, expected) = (fields.len(), element.properties.len());
            return Err(Flaw::new(at, Fault::Columns { found, expected, than: "header names" }));
        }
        gather.push(at, |index, name| typed(fields[index], name, element.properties[index].scalar))?;
    }
    Ok(())
}

/// Replace every list of a line by its length, so that one field is left for each property.
fn drop_lists(properties: &[Property], fields: &mut Vec<&str>) -> Result<(), Fault> {
    for (index, property) in properties.iter().enumerate() {
        let Some(scalar) = property.length else { continue };
        let Some(field) = fields.get(index) else { continue };
        let length: usize = field.parse().map_err(|_| not_a_length(property, field))?;
        if !scalar.holds(length as f64) {
            let column = format!("the length of {:?}", excerpt(&property.name));
            return Err(Fault::OutsideType { column, text: excerpt(field), kind: scalar.name() });
        }
        let end = length.checked_add(index + 1).filter(|end| *end <= fields.len());
        let Some(end) = end else {
            let what = format!("entries of {:?}", excerpt(&property.name));
            let held = (fields.len() - index - 1).to_string();
            return Err(Fault::Claims { what, claimed: length.to_string(), held });
        };
        fields.drain(index + 1..end);
    }
    Ok(())
}

/// Take the bytes of one kind of element and return the rest.
fn read_binary<'a>(
    element: &Element,
    bytes: &'a [u8],
    big_endian: bool,
    mut vertices: Option<&mut Gather>,
) -> Result<&'a [u8], Flaw> {
    let mut rest = bytes;
    if let Some(stride) = element.stride() {
        let held = (bytes.len() / stride) as u64;
        if held < element.count {
            return Err(short(element, held));
        }
        if vertices.is_none() {
            return Ok(&bytes[stride * element.count as usize..]);
        }
    }
    let mut offsets = vec![0; element.properties.len()];
    for row in 0..element.count {
        let at = Place::Row(row as usize + 1);
        let measured = measure(&element.properties, rest, big_endian, &mut offsets);
        let Some(size) = measured.map_err(|fault| Flaw::new(at, fault))? else { return Err(short(element, row)) };
        if let Some(gather) = vertices.as_deref_mut() {
            let value = |index: usize, _: &str| {
                let decoded = element.properties[index].scalar.decode(&rest[offsets[index]..], big_endian);
                decoded.ok_or(Fault::Header { what: "names a type of unknown width".into() })
            };
            gather.push(at, value)?;
        }
        rest = &rest[size..];
    }
    Ok(rest)
}

/// Find where each property of one element begins and where the element ends; `None` where the bytes end before.
pub(super) fn measure(
    properties: &[Property],
    bytes: &[u8],
    big_endian: bool,
    offsets: &mut [usize],
) -> Result<Option<usize>, Fault> {
    let mut end = 0usize;
    for (property, offset) in properties.iter().zip(offsets) {
        *offset = end;
        let size = match property.length {
            None => Some(property.scalar.size()),
            Some(length) => {
                let Some(count) = bytes.get(end..).and_then(|bytes| length.decode(bytes, big_endian)) else {
                    return Ok(None);
                };
                if count < 0.0 {
                    return Err(not_a_length(property, &count.to_string()));
                }
                (count as usize).checked_mul(property.scalar.size()).and_then(|size| size.checked_add(length.size()))
            }
        };
        match size.and_then(|size| end.checked_add(size)).filter(|end| *end <= bytes.len()) {
            Some(next) => end = next,
            None => return Ok(None),
        }
    }
    Ok(Some(end))
}

fn not_a_length(property: &Property, text: &str) -> Fault {
    let column = format!("the length of {:?}", excerpt(&property.name));
    Fault::NotANumber { column, text: excerpt(text), hint: "; lengths of lists are whole and not negative" }
}
