//! Binary numbers of every width and byte order that the formats use.

/// Type of a binary number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Scalar {
    /// Signed integer of 1, 2, 4 or 8 bytes.
    Signed(usize),
    /// Unsigned integer of 1, 2, 4 or 8 bytes.
    Unsigned(usize),
    /// IEEE number of 4 or 8 bytes.
    Float(usize),
}

impl Scalar {
    /// Return the number of bytes.
    pub(crate) fn size(self) -> usize {
        match self {
            Self::Signed(size) | Self::Unsigned(size) | Self::Float(size) => size,
        }
    }

    /// Decode the first [`Scalar::size`] bytes; `None` where there are fewer or the width is unknown.
    ///
    /// Integers above 2^53 are rounded to the nearest double.
    pub(crate) fn decode(self, bytes: &[u8], big_endian: bool) -> Option<f64> {
        let size = self.size();
        let bytes = bytes.get(..size)?;
        if !matches!(size, 1 | 2 | 4 | 8) {
            return None;
        }
        // Most significant byte first, so that one loop serves every width.
        let byte = |index: usize| u64::from(if big_endian { bytes[index] } else { bytes[size - 1 - index] });
        let bits = (0..size).fold(0u64, |bits, index| (bits << 8) | byte(index));
        let shift = 64 - 8 * size as u32;
        match self {
            Self::Signed(_) => Some((((bits << shift) as i64) >> shift) as f64),
            Self::Unsigned(_) => Some(bits as f64),
            Self::Float(4) => Some(f64::from(f32::from_bits(bits as u32))),
            Self::Float(8) => Some(f64::from_bits(bits)),
            Self::Float(_) => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_width_and_byte_order_decodes_what_the_standard_library_encodes() {
        for value in [0i64, 1, -1, 127, -128, 32_767, -32_768, 2_147_483_647, -2_147_483_648] {
            for size in [1usize, 2, 4, 8] {
                let (little, big) = (value.to_le_bytes(), value.to_be_bytes());
                let wrapped = (value << (64 - 8 * size)) >> (64 - 8 * size);
                assert_eq!(Scalar::Signed(size).decode(&little, false), Some(wrapped as f64));
                assert_eq!(Scalar::Signed(size).decode(&big[8 - size..], true), Some(wrapped as f64));
                let unsigned = (value as u64) & (u64::MAX >> (64 - 8 * size));
                assert_eq!(Scalar::Unsigned(size).decode(&little, false), Some(unsigned as f64));
            }
        }
        for value in [0.0f32, -1.5, 1e-30, f32::MAX] {
            assert_eq!(Scalar::Float(4).decode(&value.to_be_bytes(), true), Some(f64::from(value)));
            assert_eq!(Scalar::Float(8).decode(&f64::from(value).to_le_bytes(), false), Some(f64::from(value)));
        }
        assert_eq!(Scalar::Float(8).decode(&[0; 7], false), None);
        assert_eq!(Scalar::Float(2).decode(&[0; 7], false), None);
    }
}
