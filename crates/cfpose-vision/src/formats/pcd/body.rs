//! The points of a pcd file.

use super::header::{Data, Field, Header};
use super::lzf;
use crate::cursor::Lines;
use crate::error::{Fault, Flaw, Place};
use crate::gather::Gather;
use crate::rows::typed;
use crate::unpack::Unpacked;

/// Gather the points.
pub(super) fn read(header: &Header, lines: Lines, gather: Gather) -> Result<Gather, Flaw> {
    match header.data {
        Data::Ascii => read_ascii(header, lines, gather),
        Data::Binary => read_binary(header, lines.rest(), gather),
        Data::Compressed => read_compressed(header, lines.rest(), gather),
    }
}

const UNPACK: &str = "write it as DATA binary";

fn claims(what: &str, claimed: u64, held: u64) -> Fault {
    Fault::Claims { what: what.to_string(), claimed: claimed.to_string(), held: held.to_string() }
}

/// Return where each field begins, in units of `size`, and where the last ends.
fn offsets(header: &Header, size: impl Fn(&Field) -> usize) -> Result<(Vec<usize>, usize), Fault> {
    let mut end = 0usize;
    let mut offsets = Vec::new();
    for field in &header.fields {
        offsets.push(end);
        let next = field.count.checked_mul(size(field)).and_then(|size| end.checked_add(size));
        end = next.ok_or_else(|| Fault::Header { what: "gives a point more bytes than a file can have".into() })?;
    }
    Ok((offsets, end))
}

fn decoded(field: &Field, bytes: &[u8]) -> Result<f64, Fault> {
    field.scalar.decode(bytes, false).ok_or(Fault::Header { what: "names a type of unknown width".into() })
}

fn read_ascii(header: &Header, lines: Lines, mut gather: Gather) -> Result<Gather, Flaw> {
    let (offsets, expected) = offsets(header, |_| 1)?;
    let rows = lines.map(|(line, text)| (Place::Line(line), text)).filter(|(_, text)| !text.trim().is_empty());
    let mut held = 0;
    for (at, text) in rows {
        if held == header.points {
            return Err(Flaw::new(at, extra(header)));
        }
        held += 1;
        let fields: Vec<&str> = text.split_whitespace().collect();
        if fields.len() != expected {
            return Err(Flaw::new(at, Fault::Columns { found: fields.len(), expected, than: "header names" }));
        }
        gather.push(at, |index, name| typed(fields[offsets[index]], name, header.fields[index].scalar))?;
    }
    if held < header.points { Err(claims("points", header.points, held).into()) } else { Ok(gather) }
}

fn extra(header: &Header) -> Fault {
    Fault::Extra { what: "points".to_string(), claimed: header.points.to_string() }
}

/// Check that the bytes hold just the points, and return how many there are; blanks may follow.
fn check_size(header: &Header, stride: usize, bytes: &[u8]) -> Result<usize, Fault> {
    let held = bytes.len() / stride.max(1);
    match usize::try_from(header.points) {
        Ok(points) if points == held && !bytes[held * stride..].iter().all(u8::is_ascii_whitespace) => {
            Err(Fault::Trailing { found: bytes.len() - held * stride })
        }
        Ok(points) if points == held || stride == 0 && points == 0 => Ok(points),
        Ok(points) if points < held => Err(extra(header)),
        _ => Err(claims("points", header.points, held as u64)),
    }
}

fn read_binary(header: &Header, bytes: &[u8], mut gather: Gather) -> Result<Gather, Flaw> {
    let (offsets, stride) = offsets(header, |field| field.scalar.size())?;
    for row in 0..check_size(header, stride, bytes)? {
        let point = &bytes[row * stride..(row + 1) * stride];
        gather.push(Place::Row(row + 1), |index, _| decoded(&header.fields[index], &point[offsets[index]..]))?;
    }
    Ok(gather)
}

fn read_compressed(header: &Header, bytes: &[u8], mut gather: Gather) -> Result<Gather, Flaw> {
    let (offsets, stride) = offsets(header, |field| field.scalar.size())?;
    let [a, b, c, d, e, f, g, h, packed @ ..] = bytes else {
        return Err(claims("points", header.points, 0).into());
    };
    let compressed = u32::from_le_bytes([*a, *b, *c, *d]);
    let unpacked_size = u32::from_le_bytes([*e, *f, *g, *h]);
    let Some((packed, rest)) = packed.split_at_checked(compressed as usize) else {
        return Err(claims("compressed bytes", compressed.into(), packed.len() as u64).into());
    };
    if !rest.iter().all(u8::is_ascii_whitespace) {
        return Err(Fault::Trailing { found: rest.len() }.into());
    }
    let differs = || Fault::Header { what: "does not agree with the compressed data".into() };
    // A copy of 264 bytes takes 3.
    if unpacked_size as usize / 88 > packed.len() {
        return Err(differs().into());
    }
    let limit = Unpacked::of(bytes.len());
    if unpacked_size as usize > limit.bytes {
        return Err(Fault::Unpacks { limit: limit.bytes, what: "bytes", advice: UNPACK }.into());
    }
    let unpacked = lzf::decompress(packed, unpacked_size as usize).ok_or_else(differs)?;
    let points = check_size(header, stride, &unpacked)?;
    if points > limit.points {
        return Err(Fault::Unpacks { limit: limit.points, what: "points", advice: UNPACK }.into());
    }
    for row in 0..points {
        gather.push(Place::Row(row + 1), |index, _| {
            let field = &header.fields[index];
            decoded(field, &unpacked[offsets[index] * points + row * field.count * field.scalar.size()..])
        })?;
    }
    Ok(gather)
}
