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

use image::GrayImage;

use crate::columns::Layout;
use crate::error::{Fault, Flaw, Place};
use crate::gather::{Gather, PointTable};
use crate::options::{Foreground, MASK_POINTS, ReadOptions, Threshold};
use crate::picture::decode_image;

/// Threshold where nothing says otherwise.
const MIDDLE: u8 = 127;

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
    let decoded = decode_image(bytes)?;
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
