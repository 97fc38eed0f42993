//! From code values to light.

use std::str::FromStr;

/// How code values stand for light.
///
/// Coverage is a ratio of light. Taken from encoded values, every edge moves towards the brighter side by an amount that grows with the
/// blur (docs/vision.md, *Light*).
///
/// ```
/// use cfpose_vision::Transfer;
/// assert!((Transfer::Srgb.light(0.5) - 0.2140).abs() < 1e-4);
/// assert_eq!(Transfer::Linear.light(0.5), 0.5);
/// assert_eq!("srgb".parse(), Ok(Transfer::Srgb));
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Transfer {
    /// The curve of IEC 61966-2-1: photographs.
    #[default]
    Srgb,
    /// Code values are proportional to light: renders, industrial cameras.
    Linear,
}

impl Transfer {
    /// Return the name as it is written on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Srgb => "srgb",
            Self::Linear => "linear",
        }
    }

    /// Return the light of a code value, both from 0 to 1.
    pub fn light(self, code: f32) -> f32 {
        match self {
            Self::Linear => code,
            Self::Srgb if code <= 0.040_45 => code / 12.92,
            Self::Srgb => ((code + 0.055) / 1.055).powf(2.4),
        }
    }

    /// Return the code value of light, both from 0 to 1: the inverse of [`Transfer::light`].
    pub fn code(self, light: f32) -> f32 {
        match self {
            Self::Linear => light,
            Self::Srgb if light <= 0.003_130_8 => light * 12.92,
            Self::Srgb => 1.055 * light.powf(1.0 / 2.4) - 0.055,
        }
    }

    /// Return the light of all codes of 8 or 16 bits.
    pub(super) fn table(self, bytes: bool) -> Vec<f32> {
        let most = if bytes { 255 } else { 65535 };
        (0..=most).map(|code| self.light(code as f32 / most as f32)).collect()
    }
}

impl FromStr for Transfer {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "srgb" => Ok(Self::Srgb),
            "linear" => Ok(Self::Linear),
            _ => Err(format!("`{text}` is neither srgb nor linear")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_of_light_are_the_codes_it_came_from() {
        for transfer in [Transfer::Srgb, Transfer::Linear] {
            for code in 0..=255 {
                let code = code as f32 / 255.0;
                assert!((transfer.code(transfer.light(code)) - code).abs() < 1e-5);
            }
        }
    }
}
