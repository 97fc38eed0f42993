//! PNG and JPEG to pixels; sizes are checked before memory is taken for them.
//!
//! Memory: at most 16 bytes a pixel while the image is decoded. An orientation that a camera noted beside the pixels is ignored.

use std::io::Cursor;

use image::codecs::{jpeg::JpegDecoder, png::PngDecoder};
use image::{DynamicImage, ImageDecoder, ImageFormat, ImageResult, Limits};

use crate::error::{Fault, one_line};

/// Largest number of pixels (8192 x 8192): an honest image may still unpack to a thousand times its size.
const MOST_PIXELS: u64 = 1 << 26;

/// Most bits of raw pixels in a byte of deflated data.
const DEFLATE_BITS: u64 = 1032 * 8;

/// Most pixels in a byte of JPEG: a block of 8 x 8 takes at least one bit.
const JPEG_PIXELS: u64 = 64 * 8;

/// Decode a PNG or a JPEG file.
///
/// # Errors
/// [`Fault`] for other formats, what is cut off or claims more than it holds, and bytes after the image's end.
pub(crate) fn decode_image(bytes: &[u8]) -> Result<DynamicImage, Fault> {
    let failed = |error: image::ImageError| Fault::Image(one_line(&error.to_string()));
    let decoded = match image::guess_format(bytes) {
        Ok(ImageFormat::Png) => decode_png(bytes)?.map_err(failed)?,
        Ok(ImageFormat::Jpeg) => decode_jpeg(bytes)?.map_err(failed)?,
        _ => return Err(Fault::Image("it is neither PNG nor JPEG".into())),
    };
    let end = if bytes.starts_with(&[0xff]) { jpeg_end(bytes) } else { png_end(bytes) };
    if let Some(end) = end.filter(|end| *end < bytes.len()) {
        return Err(Fault::Image(format!("{} byte(s) follow its end", bytes.len() - end)));
    }
    Ok(decoded)
}

/// Return where a PNG ends: after its chunk IEND (PNG, section 5.3).
fn png_end(bytes: &[u8]) -> Option<usize> {
    let mut at = 8;
    loop {
        let head: &[u8; 8] = bytes.get(at..)?.first_chunk()?;
        let length = u32::from_be_bytes([head[0], head[1], head[2], head[3]]) as usize;
        // Length, name and checksum take 12 bytes.
        at = at.checked_add(length)?.checked_add(12)?;
        if head.ends_with(b"IEND") {
            return Some(at);
        }
    }
}

/// Return where a JPEG ends: after the marker that ends the image, which neither segments nor coded data hold (T.81, annex B).
fn jpeg_end(bytes: &[u8]) -> Option<usize> {
    let mut at = 2;
    loop {
        // Coded data and what fills the gaps before a marker.
        while bytes.get(at)? != &0xff || matches!(bytes.get(at + 1)?, 0x00 | 0xff | 0xd0..=0xd7) {
            at += 1;
        }
        if bytes[at + 1] == 0xd9 {
            return Some(at + 2);
        }
        let length = u16::from_be_bytes([*bytes.get(at + 2)?, *bytes.get(at + 3)?]);
        at += 2 + usize::from(length);
    }
}

/// Refuse a size before memory is taken for it.
fn check_size(width: u64, height: u64, most_held: u64) -> Result<(), Fault> {
    // Both sides come from fields of at most 32 bits, so the product fits.
    let pixels = width * height;
    if pixels == 0 {
        return Err(Fault::Image("it has no pixels".into()));
    }
    if pixels > most_held {
        let (claimed, held) = (format!("{width} x {height}"), format!("at most {most_held}"));
        return Err(Fault::Claims { what: "pixels".into(), claimed, held });
    }
    if pixels > MOST_PIXELS {
        let what = format!("an image of {width} x {height} pixels");
        return Err(Fault::Unsupported { what, advice: "reduce it to at most 8192 x 8192" });
    }
    Ok(())
}

fn decode_png(bytes: &[u8]) -> Result<ImageResult<DynamicImage>, Fault> {
    // Signature, length and name of the first chunk, width, height, depth and colour type: PNG, section 11.2.2.
    let Some(&[w0, w1, w2, w3, h0, h1, h2, h3, depth, colour]) = bytes.get(16..26) else {
        return Err(Fault::Image("it is cut off".into()));
    };
    let (width, height) = (u32::from_be_bytes([w0, w1, w2, w3]), u32::from_be_bytes([h0, h1, h2, h3]));
    let channels = match colour {
        2 => 3,
        4 => 2,
        6 => 4,
        _ => 1,
    };
    let bits = u64::from(depth.max(1)) * channels;
    check_size(width.into(), height.into(), bytes.len() as u64 * DEFLATE_BITS / bits)?;
    let mut limits = Limits::default();
    limits.max_alloc = Some(u64::from(width) * u64::from(height) * 8 + (32 << 20));
    Ok(PngDecoder::with_limits(Cursor::new(bytes), limits).and_then(DynamicImage::from_decoder))
}

fn decode_jpeg(bytes: &[u8]) -> Result<ImageResult<DynamicImage>, Fault> {
    // The decoder fills what is missing with grey; pixels are whole where the end marker follows the last scan.
    let find = |marker: u8| bytes.windows(2).rposition(|pair| pair == [0xff, marker]);
    if find(0xd9).is_none_or(|end| Some(end) < find(0xda)) {
        return Err(Fault::Image("it is cut off".into()));
    }
    let decoder = match JpegDecoder::new(Cursor::new(bytes)) {
        Ok(decoder) => decoder,
        Err(error) => return Ok(Err(error)),
    };
    let (width, height) = decoder.dimensions();
    check_size(width.into(), height.into(), bytes.len() as u64 * JPEG_PIXELS)?;
    Ok(DynamicImage::from_decoder(decoder))
}
