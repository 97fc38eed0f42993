//! Compressed data, within memory that the compressed size bounds.

use std::io::Read;

use flate2::read::{DeflateDecoder, MultiGzDecoder};

use crate::error::Fault;

/// How much a compressed file may unpack to, so that reading it takes at most 64 MiB and 40 times its size.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Unpacked {
    /// Bytes.
    pub bytes: usize,
    /// Points: 56 bytes each with weight and normal.
    pub points: usize,
}

impl Unpacked {
    /// Return the limits of a file of so many bytes.
    pub(crate) fn of(packed: usize) -> Self {
        Self { bytes: (16 << 20) + packed.saturating_mul(16), points: 700_000 + packed / 3 }
    }
}

/// Unpack a gzip file of one or several members.
///
/// # Errors
/// Damaged data, and more than the limit.
pub(crate) fn gunzip(packed: &[u8]) -> Result<Vec<u8>, Fault> {
    read_all(MultiGzDecoder::new(packed), Unpacked::of(packed.len()).bytes, "unpack it first (gunzip)")
}

/// Unpack a deflated part of a file to so many bytes at most.
///
/// # Errors
/// Damaged data, and more than the limit.
pub(crate) fn inflate(packed: &[u8], limit: usize, advice: &'static str) -> Result<Vec<u8>, Fault> {
    read_all(DeflateDecoder::new(packed), limit, advice)
}

fn read_all(reader: impl Read, limit: usize, advice: &'static str) -> Result<Vec<u8>, Fault> {
    let mut bytes = Vec::new();
    let read = reader.take(limit as u64 + 1).read_to_end(&mut bytes);
    read.map_err(|error| Fault::Packed { what: crate::error::one_line(&error.to_string()) })?;
    if bytes.len() > limit {
        return Err(Fault::Unpacks { limit, what: "bytes", advice });
    }
    Ok(bytes)
}
