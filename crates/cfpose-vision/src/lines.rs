//! Ends of lines.

use std::borrow::Cow;

use crate::error::{Fault, Flaw, Place};

/// Return text whose lines end in `\n` or `\r\n`: a file of carriage returns alone (old Macintosh) gets line feeds.
///
/// # Errors
/// A carriage return that stands alone among other line ends, and text in UTF-16.
pub(crate) fn with_line_feeds(bytes: &[u8]) -> Result<Cow<'_, [u8]>, Flaw> {
    if bytes.starts_with(&[0xff, 0xfe]) || bytes.starts_with(&[0xfe, 0xff]) {
        return Err(Fault::Unsupported { what: "UTF-16 text".into(), advice: "save the file as UTF-8" }.into());
    }
    let Some(lone) = lone_return(bytes) else { return Ok(Cow::Borrowed(bytes)) };
    if bytes.contains(&b'\n') {
        return Err(alone(bytes, lone));
    }
    Ok(Cow::Owned(bytes.iter().map(|byte| if *byte == b'\r' { b'\n' } else { *byte }).collect()))
}

/// Refuse text with a carriage return that no line feed follows.
pub(crate) fn refuse_lone_returns(text: &[u8]) -> Result<(), Flaw> {
    lone_return(text).map_or(Ok(()), |lone| Err(alone(text, lone)))
}

fn lone_return(bytes: &[u8]) -> Option<usize> {
    let mut from = 0;
    while let Some(found) = bytes[from..].iter().position(|byte| *byte == b'\r') {
        let at = from + found;
        if bytes.get(at + 1) != Some(&b'\n') {
            return Some(at);
        }
        from = at + 2;
    }
    None
}

fn alone(bytes: &[u8], at: usize) -> Flaw {
    let line = 1 + bytes[..at].iter().filter(|byte| **byte == b'\n').count();
    Flaw::new(Place::Line(line), Fault::LoneReturn)
}
