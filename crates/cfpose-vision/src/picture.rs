//! Images as light: decoded, with the camera's transfer function undone.

mod decode;
mod hue;
mod transfer;

use std::path::Path;

use image::{DynamicImage, RgbImage};

use crate::bytes::read_bytes;
use crate::error::{Fault, FileError, Flaw};
use crate::raster::Raster;

pub(crate) use decode::decode_image;
pub use hue::{Filter, Hue, HueError};
pub use transfer::Transfer;

/// Code values from which a pixel counts as over-exposed, as a share of the largest.
const CLIPPED: f32 = 0.995;

/// A decoded image: code values from 0 to 1, colours kept where there are any.
#[derive(Debug, Clone)]
pub struct Picture {
    width: usize,
    height: usize,
    /// Grey, or red, green, blue one after the other.
    planes: Vec<Vec<u16>>,
    /// Whether codes have 8 bits (times 257).
    bytes: bool,
}

/// Read an image file.
///
/// # Errors
/// [`FileError`] for a file that cannot be read or holds no PNG or JPEG image, for one that is cut off, and for more than 8192 x 8192
/// pixels; sizes are checked before memory is taken.
pub fn read_picture(path: &Path) -> Result<Picture, FileError> {
    read_bytes(path).and_then(|bytes| Picture::decode(&bytes)).map_err(|fault| Flaw::from(fault).in_file(path))
}

impl Picture {
    /// Decode the bytes of a PNG or JPEG file.
    ///
    /// # Errors
    /// [`Fault`].
    pub fn decode(bytes: &[u8]) -> Result<Self, Fault> {
        let decoded = decode_image(bytes)?;
        let (width, height) = (decoded.width() as usize, decoded.height() as usize);
        if width < 8 || height < 8 {
            return Err(Fault::Image(format!(
                "{width} x {height} pixels are too few for a contour; 8 x 8 are the least"
            )));
        }
        let bytes = matches!(
            decoded,
            DynamicImage::ImageLuma8(_)
                | DynamicImage::ImageLumaA8(_)
                | DynamicImage::ImageRgb8(_)
                | DynamicImage::ImageRgba8(_)
        );
        let coloured = decoded.color().has_color();
        let planes = if coloured {
            let rgb = decoded.into_rgb16();
            let plane = |c: usize| rgb.as_raw().iter().skip(c).step_by(3).copied().collect();
            (0..3).map(plane).collect()
        } else {
            vec![decoded.into_luma16().into_raw()]
        };
        Ok(Self { width, height, planes, bytes })
    }

    /// Make a picture of grey code values, 0 to 255, row by row; `None` where their number is not width x height.
    pub fn from_grey(width: usize, height: usize, codes: &[u8]) -> Option<Self> {
        let plane: Vec<u16> = codes.iter().map(|code| u16::from(*code) * 257).collect();
        (plane.len() == width * height).then_some(Self { width, height, planes: vec![plane], bytes: true })
    }

    /// Return the number of columns.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Return the number of rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Return light from 0 to 1: code values with the transfer function undone, of colours the luminance of ITU-R BT.709.
    pub fn light(&self, transfer: Transfer) -> Raster {
        let table = transfer.table(self.bytes);
        let light = |plane: &[u16]| -> Vec<f32> {
            match <&[f32; 256]>::try_from(table.as_slice()) {
                // Any byte is an index of this table: nothing is checked per pixel.
                Ok(table) => plane.iter().map(|code| table[usize::from((*code >> 8) as u8)]).collect(),
                Err(_) => plane.iter().map(|code| table[usize::from(*code)]).collect(),
            }
        };
        let values = match self.planes.as_slice() {
            [red, green, blue] => {
                let mut sum: Vec<f32> = light(red).iter().map(|v| 0.2126 * v).collect();
                sum.iter_mut().zip(light(green)).for_each(|(s, v)| *s += 0.7152 * v);
                sum.iter_mut().zip(light(blue)).for_each(|(s, v)| *s += 0.0722 * v);
                sum
            }
            planes => light(&planes[0]),
        };
        Raster::from_values(self.width, self.height, values)
            .unwrap_or_else(|| Raster::filled(self.width, self.height, 0.0))
    }

    /// Return red, green and blue light of a pixel, equal where the image is grey.
    pub fn colour(&self, x: usize, y: usize, transfer: Transfer) -> [f32; 3] {
        let at = y * self.width + x;
        let plane = |c: usize| self.planes[c.min(self.planes.len() - 1)][at];
        [0, 1, 2].map(|c| transfer.light(f32::from(plane(c)) / 65535.0))
    }

    /// Say whether nearly all pixels have one of two values: a mask, whose edges tell nothing about light.
    pub fn is_two_valued(&self) -> bool {
        let plane = &self.planes[0];
        let (low, high) = plane.iter().fold((u16::MAX, 0), |(a, b), v| (a.min(*v), b.max(*v)));
        let between = plane.iter().filter(|v| **v != low && **v != high).count();
        1000 * between < plane.len()
    }

    /// Say whether the image has colours.
    pub fn is_coloured(&self) -> bool {
        self.planes.len() == 3
    }

    /// Say whether a pixel is over-exposed: a code value at the largest one.
    pub fn is_clipped(&self, x: usize, y: usize) -> bool {
        let at = y * self.width + x;
        self.planes.iter().any(|plane| f32::from(plane[at]) >= CLIPPED * 65535.0)
    }

    /// Return the image as 8-bit colours, to draw on.
    pub fn to_rgb(&self) -> RgbImage {
        RgbImage::from_fn(self.width as u32, self.height as u32, |x, y| {
            let at = y as usize * self.width + x as usize;
            image::Rgb([0, 1, 2].map(|c| (self.planes[c.min(self.planes.len() - 1)][at] >> 8) as u8))
        })
    }
}
