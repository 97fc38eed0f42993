//! `.png`, `.jpg`, `.jpeg`: the pixels of a silhouette.
//!
//! Points are the pixels of the foreground, row by row; pixel centres are at integers, x to the right and y down, the
//! first pixel at (0, 0). A pixel is bright if its grey value, from 0 to 255, is above [`ReadOptions::threshold`]; in an
//! image whose opacity varies, opacity takes the place of grey. [`Foreground`] says which side the points are. An image
//! of labels 0, 1, .. (none above 127, at most 64 different ones) is split above label 0. An orientation that a camera
//! noted beside the pixels is ignored.
//!
//! Memory: at most 16 bytes a pixel while the image is decoded, then 1 a pixel and 24 a point; the numbers of pixels and
//! of points are limited and checked before memory is taken for them.

use std::io::Cursor;

use image::codecs::{jpeg::JpegDecoder, png::PngDecoder};
use image::{DynamicImage, GrayImage, ImageDecoder, ImageFormat, ImageResult, Limits};

use crate::columns::Layout;
use crate::error::{Fault, Flaw, Place, one_line};
use crate::gather::{Gather, PointTable};
use crate::options::{Foreground, MASK_POINTS, ReadOptions, Threshold};

/// Largest number of pixels (8192 x 8192): an honest image may still unpack to a thousand times its size.
const MOST_PIXELS: u64 = 1 << 26;

/// Threshold where nothing says otherwise.
const MIDDLE: u8 = 127;

/// Most bits of raw pixels in a byte of deflated data.
const DEFLATE_BITS: u64 = 1032 * 8;

/// Most pixels in a byte of JPEG: a block of 8 x 8 takes at least one bit.
const JPEG_PIXELS: u64 = 64 * 8;

/// Largest number of different values in an image of labels.
const MOST_LABELS: usize = 64;

/// Read the pixels of the foreground.
pub(super) fn read(bytes: &[u8], options: &ReadOptions) -> Result<PointTable, Flaw> {
    let layout = Layout::fixed(&["x", "y"], options)?;
    let grey = decode(bytes)?;
    let mut histogram = [0usize; 256];
    grey.as_raw().iter().for_each(|value| histogram[usize::from(*value)] += 1);
    let (threshold, labels) = threshold(&histogram, options.threshold);
    let bright = |value: u8| value > threshold;
    let wanted = match options.foreground {
        Foreground::Bright => true,
        Foreground::Dark => false,
        Foreground::Auto => labels || !border_is_bright(&grey, bright),
    };
    let above = histogram[usize::from(threshold) + 1..].iter().sum::<usize>();
    let found = if wanted { above } else { grey.as_raw().len() - above };
    if found == 0 {
        let (side, other) = if wanted { ("above", "dark") } else { ("at most", "bright") };
        return Err(Fault::NoForeground { side, threshold, other }.into());
    }
    let limit = options.max_points.unwrap_or(MASK_POINTS);
    if found > limit {
        let advice = format!("give --max-points {found} or reduce the image");
        return Err(Fault::TooMany { found: Some(found), limit, advice }.into());
    }
    let mut gather = Gather::new(layout, options);
    gather.reserve(found);
    if labels {
        let largest = histogram.iter().rposition(|count| *count > 0).unwrap_or(0);
        gather.note(format!(
            "read as labels 0 to {largest}: points are the pixels above 0; --threshold T splits elsewhere"
        ));
    }
    for (x, y, _) in grey.enumerate_pixels().filter(|(_, _, pixel)| bright(pixel.0[0]) == wanted) {
        gather.push(Place::Whole, |axis, _| Ok(f64::from(if axis == 0 { x } else { y })))?;
    }
    drop(grey);
    gather.finish()
}

/// Choose the largest value that counts as dark, and say whether the values are labels.
fn threshold(histogram: &[usize; 256], wanted: Threshold) -> (u8, bool) {
    match wanted {
        Threshold::Grey(value) => (value, false),
        Threshold::Otsu => (otsu(histogram).unwrap_or(MIDDLE), false),
        Threshold::Auto => {
            let different = histogram.iter().filter(|count| **count > 0).count();
            let low = histogram[usize::from(MIDDLE) + 1..].iter().all(|count| *count == 0);
            let labels = low && histogram[0] > 0 && (2..=MOST_LABELS).contains(&different);
            (if labels { 0 } else { MIDDLE }, labels)
        }
    }
}

/// Find the value that separates two classes of the largest variance between them, w0 w1 (m1 - m0)^2; `None` where all
/// values are equal.
///
/// Source: N. Otsu, "A threshold selection method from gray-level histograms", 1979, equation 18.
fn otsu(histogram: &[usize; 256]) -> Option<u8> {
    let total = histogram.iter().sum::<usize>() as f64;
    let sum = (0..256).map(|value| value as f64 * histogram[value] as f64).sum::<f64>();
    let (mut below, mut sum_below, mut best) = (0.0, 0.0, None);
    for value in 0..255u8 {
        let count = histogram[usize::from(value)] as f64;
        (below, sum_below) = (below + count, sum_below + f64::from(value) * count);
        let above = total - below;
        if below > 0.0 && above > 0.0 {
            let between = below * above * ((sum - sum_below) / above - sum_below / below).powi(2);
            if best.is_none_or(|(most, _)| between > most) {
                best = Some((between, value));
            }
        }
    }
    best.map(|(_, value)| value)
}

/// Say whether more than half of the pixels on the border are bright.
fn border_is_bright(grey: &GrayImage, bright: impl Fn(u8) -> bool) -> bool {
    let (right, bottom) = (grey.width() - 1, grey.height() - 1);
    let border = grey.enumerate_pixels().filter(|(x, y, _)| *x == 0 || *y == 0 || *x == right || *y == bottom);
    let (mut total, mut count) = (0usize, 0usize);
    for (_, _, pixel) in border {
        total += 1;
        count += usize::from(bright(pixel.0[0]));
    }
    2 * count > total
}

/// Decode to grey values, or to opacities where these vary.
fn decode(bytes: &[u8]) -> Result<GrayImage, Fault> {
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
    if decoded.color().has_alpha() {
        let opacity = decoded.to_rgba8();
        if opacity.pixels().any(|pixel| pixel.0[3] != opacity.get_pixel(0, 0).0[3]) {
            return Ok(GrayImage::from_fn(opacity.width(), opacity.height(), |x, y| {
                image::Luma([opacity.get_pixel(x, y).0[3]])
            }));
        }
    }
    Ok(decoded.into_luma8())
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
