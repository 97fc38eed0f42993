//! Pictures of what was found: contour and axes on the frame, and a contact sheet of many frames.

use image::imageops::{FilterType, overlay, resize};
use image::{ExtendedColorType, ImageEncoder, Rgb, RgbImage};

use crate::error::Fault;
use crate::registration::FrameVerdict;

/// Width of a frame on the contact sheet, pixels.
const SMALL: u32 = 240;

/// Most frames on a contact sheet: the first ones and evenly spaced others.
const MOST: usize = 60;

/// Return the colour of a verdict: green, yellow, orange, red.
pub fn colour_of(verdict: FrameVerdict) -> [u8; 3] {
    match verdict {
        FrameVerdict::Good => [30, 200, 70],
        FrameVerdict::Ambiguous => [240, 210, 20],
        FrameVerdict::Suspect => [250, 130, 20],
        FrameVerdict::Lost => [230, 30, 30],
    }
}

/// Draw a line of places; a jump longer than `longest` pixels begins a new one.
pub fn draw_line(image: &mut RgbImage, places: &[[f64; 2]], longest: f64, colour: [u8; 3]) {
    for pair in places.windows(2) {
        let length = (pair[1][0] - pair[0][0]).hypot(pair[1][1] - pair[0][1]);
        if length.is_finite() && length <= longest {
            segment(image, pair[0], pair[1], colour);
        }
    }
}

/// Draw a straight line two pixels wide.
fn segment(image: &mut RgbImage, from: [f64; 2], to: [f64; 2], colour: [u8; 3]) {
    let length = (to[0] - from[0]).hypot(to[1] - from[1]);
    // Far outside nothing is seen, and the loop would be long.
    let count = (2.0 * length).ceil().clamp(1.0, 20_000.0) as usize;
    for k in 0..=count {
        let share = k as f64 / count as f64;
        let [x, y] = [0, 1].map(|d| (from[d] + share * (to[d] - from[d])).round());
        for (dx, dy) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)] {
            let (x, y) = (x + dx, y + dy);
            if x >= 0.0 && y >= 0.0 && x < f64::from(image.width()) && y < f64::from(image.height()) {
                image.put_pixel(x as u32, y as u32, Rgb(colour));
            }
        }
    }
}

/// Put small copies of images side by side.
pub fn contact_sheet(images: &[RgbImage]) -> RgbImage {
    let step = images.len().div_ceil(MOST).max(1);
    let chosen: Vec<&RgbImage> = images.iter().step_by(step).collect();
    let columns = (chosen.len() as f64).sqrt().ceil().max(1.0) as u32;
    let heights =
        chosen.iter().map(|i| i.height() * SMALL / i.width().max(1)).max().unwrap_or(SMALL).clamp(1, 4 * SMALL);
    let rows = (chosen.len() as u32).div_ceil(columns);
    let mut sheet = RgbImage::from_pixel(columns * SMALL, rows.max(1) * heights, Rgb([255, 255, 255]));
    for (k, image) in (0u32..).zip(chosen) {
        let tall = (image.height() * SMALL / image.width().max(1)).clamp(1, heights);
        let small = resize(image, SMALL, tall, FilterType::Triangle);
        overlay(&mut sheet, &small, i64::from(k % columns * SMALL), i64::from(k / columns * heights));
    }
    sheet
}

/// Write an image as PNG.
///
/// # Errors
/// [`Fault::Image`] with what the encoder says.
pub fn to_png(image: &RgbImage) -> Result<Vec<u8>, Fault> {
    encode(image.as_raw(), image.width(), image.height(), ExtendedColorType::Rgb8)
}

/// Write shares from 0 to 1 as a grey PNG of 8 bits; what is not a number is black.
///
/// # Errors
/// As [`to_png`].
pub fn shares_to_png(raster: &crate::Raster) -> Result<Vec<u8>, Fault> {
    let codes: Vec<u8> = raster.values().iter().map(|v| (v.clamp(0.0, 1.0) * 255.0).round() as u8).collect();
    encode(&codes, raster.width() as u32, raster.height() as u32, ExtendedColorType::L8)
}

fn encode(bytes: &[u8], width: u32, height: u32, kind: ExtendedColorType) -> Result<Vec<u8>, Fault> {
    let mut out = Vec::new();
    let encoder = image::codecs::png::PngEncoder::new(&mut out);
    encoder
        .write_image(bytes, width, height, kind)
        .map_err(|error| Fault::Image(crate::error::one_line(&error.to_string())))?;
    Ok(out)
}
