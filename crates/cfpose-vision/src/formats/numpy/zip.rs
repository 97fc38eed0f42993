//! The parts of a zip archive that `numpy.savez` uses: stored and deflated entries, also with 64-bit sizes.
//!
//! Source: PKWARE, "ZIP file format specification" 6.3.10, sections 4.3.7, 4.3.12, 4.3.16 and 4.5.3.

use std::borrow::Cow;

use crate::error::{Fault, excerpt};
use crate::unpack::inflate;

/// What to do with an archive that unpacks to too much.
pub(super) const STORE: &str = "save it with numpy.savez instead of savez_compressed";

/// Most entries that are looked at.
const MOST_ENTRIES: usize = 1024;

/// A file in an archive.
pub(super) struct Entry<'a> {
    /// Its name, as it can stand in a message.
    pub name: String,
    /// Its content.
    pub bytes: Cow<'a, [u8]>,
}

fn damaged(what: &str) -> Fault {
    Fault::Packed { what: what.to_string() }
}

/// Return a little-endian number of so many bytes.
fn number(bytes: &[u8], at: usize, size: usize) -> Result<usize, Fault> {
    let field =
        at.checked_add(size).and_then(|end| bytes.get(at..end)).ok_or_else(|| damaged("the archive is cut off"))?;
    let value = field.iter().rev().fold(0u64, |value, byte| value << 8 | u64::from(*byte));
    usize::try_from(value).map_err(|_| damaged("a size is beyond this machine"))
}

/// Unpack every entry, all together to at most `limit` bytes.
pub(super) fn entries(bytes: &[u8], limit: usize) -> Result<Vec<Entry<'_>>, Fault> {
    // The end record, of 22 bytes and a comment of at most 65535, closes the archive.
    let search = bytes.len().saturating_sub(22 + 65_535);
    let end = bytes[search..].windows(4).rposition(|mark| mark == b"PK\x05\x06");
    let end = search + end.ok_or_else(|| damaged("the archive has no directory"))?;
    if end + 22 + number(bytes, end + 20, 2)? != bytes.len() {
        return Err(damaged("bytes follow the directory"));
    }
    let (count, mut at) = (number(bytes, end + 10, 2)?, number(bytes, end + 16, 4)?);
    if count > MOST_ENTRIES {
        return Err(damaged("the archive has more than 1024 entries"));
    }
    let (mut entries, mut left) = (Vec::new(), limit);
    for _ in 0..count {
        let (entry, next) = entry(bytes, at, left)?;
        left = left.saturating_sub(entry.bytes.len());
        entries.push(entry);
        at = next;
    }
    if entries.is_empty() { Err(damaged("the archive is empty")) } else { Ok(entries) }
}

/// Unpack the entry whose record in the directory stands at `at`; return where the next record stands.
fn entry(bytes: &[u8], at: usize, limit: usize) -> Result<(Entry<'_>, usize), Fault> {
    if bytes.get(at..at.saturating_add(4)) != Some(&b"PK\x01\x02"[..]) {
        return Err(damaged("the directory is wrong"));
    }
    let (flags, method, crc) = (number(bytes, at + 8, 2)?, number(bytes, at + 10, 2)?, number(bytes, at + 16, 4)?);
    let (mut packed, mut size) = (number(bytes, at + 20, 4)?, number(bytes, at + 24, 4)?);
    let (name_len, extra_len) = (number(bytes, at + 28, 2)?, number(bytes, at + 30, 2)?);
    let (comment_len, mut local) = (number(bytes, at + 32, 2)?, number(bytes, at + 42, 4)?);
    let name = bytes.get(at + 46..at + 46 + name_len).ok_or_else(|| damaged("the archive is cut off"))?;
    let name = excerpt(&String::from_utf8_lossy(name)).escape_debug().to_string();
    // Sizes of 64 bits stand in the extra field 1, in this order, for those that are all ones here.
    let (mut extra, end) = (at + 46 + name_len, at + 46 + name_len + extra_len);
    while extra + 4 <= end {
        let (id, len) = (number(bytes, extra, 2)?, number(bytes, extra + 2, 2)?);
        let mut field = extra + 4;
        for slot in [&mut size, &mut packed, &mut local] {
            if id == 1 && *slot == u32::MAX as usize {
                *slot = number(bytes, field, 8)?;
                field += 8;
            }
        }
        extra += 4 + len;
    }
    if flags & 1 == 1 {
        return Err(Fault::Unsupported { what: "an encrypted archive".into(), advice: "save it without a password" });
    }
    if bytes.get(local..local.saturating_add(4)) != Some(&b"PK\x03\x04"[..]) {
        return Err(damaged("an entry is not where the directory says"));
    }
    let start = local + 30 + number(bytes, local + 26, 2)? + number(bytes, local + 28, 2)?;
    let data = start.checked_add(packed).and_then(|end| bytes.get(start..end));
    let data = data.ok_or_else(|| damaged("the archive is cut off"))?;
    let unpacked = match method {
        0 => Cow::Borrowed(data),
        8 => Cow::Owned(inflate(data, limit, STORE)?),
        _ => {
            let what = format!("method {method} of compression");
            return Err(Fault::Unsupported { what, advice: "save it with numpy.savez_compressed" });
        }
    };
    let mut check = flate2::Crc::new();
    check.update(&unpacked);
    if unpacked.len() != size || check.sum() as usize != crc {
        return Err(damaged(&format!("{name} is not what its check sum says")));
    }
    Ok((Entry { name, bytes: unpacked }, end + comment_len))
}
