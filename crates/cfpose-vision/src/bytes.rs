//! Bytes of a file.

use std::path::Path;

use crate::error::Fault;

/// Read a regular file whole: memory is then bounded by what the disk really holds.
pub(crate) fn read_bytes(path: &Path) -> Result<Vec<u8>, Fault> {
    let refuse = |error: std::io::Error| match error.kind() {
        std::io::ErrorKind::NotFound => Fault::Missing,
        _ => Fault::Io(error),
    };
    if !std::fs::metadata(path).map_err(refuse)?.is_file() {
        return Err(Fault::NotAFile);
    }
    let bytes = std::fs::read(path).map_err(refuse)?;
    if bytes.is_empty() { Err(Fault::Empty) } else { Ok(bytes) }
}
