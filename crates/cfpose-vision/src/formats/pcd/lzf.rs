//! Decompression of LZF.
//!
//! Source: M. Lehmann, LibLZF 3.6, `lzf_d.c`. A control byte below 32 announces that many literal bytes and one more;
//! any other holds the length in its upper 3 bits (7: one more byte is added) and the upper 5 bits of the distance.

/// Decompress to exactly `size` bytes; `None` where the data are malformed, end early or go beyond.
///
/// Memory grows with what has been decompressed, not with `size`.
pub(super) fn decompress(mut packed: &[u8], size: usize) -> Option<Vec<u8>> {
    let mut unpacked = Vec::new();
    while let Some((control, rest)) = packed.split_first() {
        let control = usize::from(*control);
        if control < 32 {
            let (literal, rest) = rest.split_at_checked(control + 1)?;
            unpacked.extend_from_slice(literal);
            packed = rest;
        } else {
            let (more, rest) = if control >> 5 == 7 { rest.split_first()? } else { (&0, rest) };
            let (low, rest) = rest.split_first()?;
            let length = (control >> 5) + usize::from(*more) + 2;
            let distance = ((control & 31) << 8) + usize::from(*low) + 1;
            let start = unpacked.len().checked_sub(distance)?;
            // Byte by byte: the copy may run into what it writes.
            for index in start..start + length {
                unpacked.push(unpacked[index]);
            }
            packed = rest;
        }
        if unpacked.len() > size {
            return None;
        }
    }
    (unpacked.len() == size).then_some(unpacked)
}

#[cfg(test)]
mod tests {
    use super::decompress;

    #[test]
    fn literals_and_overlapping_copies_unpack() {
        // "ab", then 7 bytes from 2 back (overlapping), then 12 bytes from 9 back with the long form.
        let packed = [1, b'a', b'b', 5 << 5, 1, 7 << 5, 3, 8];
        assert_eq!(decompress(&packed, 21).unwrap(), b"ababababaababababaaba");
    }

    #[test]
    fn malformed_data_are_refused() {
        assert_eq!(decompress(&[0, b'a'], 2), None);
        assert_eq!(decompress(&[1, b'a'], 2), None);
        assert_eq!(decompress(&[0, b'a', 1 << 5, 1], 4), None, "a copy from before the start");
        assert_eq!(decompress(&[0, b'a', 7 << 5], 4), None);
        assert_eq!(decompress(&[0, b'a', 7 << 5, 255, 0], 10), None, "more than announced");
        assert_eq!(decompress(&[], 0), Some(Vec::new()));
    }
}
