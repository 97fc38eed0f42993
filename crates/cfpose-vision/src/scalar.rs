//! Binary numbers of every width and byte order that the formats use.

/// Type of a binary number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Scalar {
    /// Signed integer of 1, 2, 4 or 8 bytes.
    Signed(usize),
    /// Unsigned integer of 1, 2, 4 or 8 bytes.
    Unsigned(usize),
    /// IEEE number of 2, 4 or 8 bytes.
    Float(usize),
}

impl Scalar {
    /// Return the number of bytes.
    pub(crate) fn size(self) -> usize {
        match self {
            Self::Signed(size) | Self::Unsigned(size) | Self::Float(size) => size,
        }
    }

    /// Return the name of the type.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Signed(1) => "int8",
            Self::Signed(2) => "int16",
            Self::Signed(4) => "int32",
            Self::Signed(_) => "int64",
            Self::Unsigned(1) => "uint8",
            Self::Unsigned(2) => "uint16",
            Self::Unsigned(4) => "uint32",
            Self::Unsigned(_) => "uint64",
            Self::Float(2) => "float16",
            Self::Float(4) => "float32",
            Self::Float(_) => "float64",
        }
    }

    /// Say whether a number that is written in text can be of this type: whole and in range, or not beyond the largest.
    pub(crate) fn holds(self, value: f64) -> bool {
        let bits = 8 * self.size() as i32;
        match self {
            Self::Signed(_) => value.fract() == 0.0 && value >= -(2f64.powi(bits - 1)) && value < 2f64.powi(bits - 1),
            Self::Unsigned(_) => value.fract() == 0.0 && value >= 0.0 && value < 2f64.powi(bits),
            // A value that rounds to the largest one is held; what is not finite is looked at elsewhere.
            Self::Float(4) => !value.is_finite() || (value as f32).is_finite(),
            Self::Float(_) => true,
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
        if size == 2 && matches!(self, Self::Float(_)) {
            return Some(half(bits as u16));
        }
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

/// Decode an IEEE number of 16 bits: 1 of sign, 5 of exponent with a bias of 15, 10 of fraction.
fn half(bits: u16) -> f64 {
    let (exponent, fraction) = (i32::from(bits >> 10 & 31), f64::from(bits & 1023));
    let size = match exponent {
        0 => fraction * 2f64.powi(-24),
        31 if fraction == 0.0 => f64::INFINITY,
        31 => f64::NAN,
        _ => (1.0 + fraction / 1024.0) * 2f64.powi(exponent - 15),
    };
    if bits >> 15 == 1 { -size } else { size }
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
        for (bits, value) in [
            (0x3c00, 1.0),
            (0xc000, -2.0),
            (0x7bff, 65504.0),
            (0x0001, 2f64.powi(-24)),
            (0x3555, 0.333251953125),
            (0xfc00, f64::NEG_INFINITY),
        ] {
            assert_eq!(Scalar::Float(2).decode(&u16::to_le_bytes(bits), false), Some(value));
        }
        assert!(Scalar::Float(2).decode(&[0x7e, 0], true).unwrap().is_nan());
        assert_eq!(Scalar::Float(3).decode(&[0; 7], false), None);
    }

    #[test]
    fn a_type_holds_what_it_can_represent() {
        assert!(Scalar::Unsigned(1).holds(255.0) && !Scalar::Unsigned(1).holds(256.0));
        assert!(!Scalar::Unsigned(4).holds(-1.0) && !Scalar::Signed(2).holds(0.5));
        assert!(Scalar::Signed(1).holds(-128.0) && !Scalar::Signed(1).holds(128.0));
        assert!(Scalar::Float(4).holds(3.4e38) && !Scalar::Float(4).holds(1e39) && Scalar::Float(8).holds(1e39));
        assert!(!Scalar::Signed(4).holds(f64::NAN) && Scalar::Float(4).holds(f64::NAN));
    }
}
