//! Which transfer function an image was written with, found from its edges.

use crate::contours::contours_of;
use crate::picture::{Picture, Transfer};
use crate::raster::Raster;
use crate::segment::{SegmentOptions, segment};

/// Half length of a profile, pixels.
const REACH: f64 = 8.0;

/// Distance between samples of a profile, pixels.
const STEP: f64 = 0.25;

/// Shares of a step whose places are compared with that of its middle: those and 1 minus those.
const SHARES: [f64; 3] = [0.08, 0.12, 0.16];

/// Find the transfer function under which the edges of a pattern are symmetric, over all images of one camera.
///
/// Blur and the area of a pixel are symmetric in light: in the mean profile across the contour the shares .1 and .9 of the step lie
/// equally far from its middle. In code values of another curve they do not, by up to 1.4 % of their distance at usual contrast: less
/// where the image is sharp, and there the choice matters less. The answer is the curve with the smaller asymmetry; where no image has
/// enough edges to tell it is sRGB, the rule for photographs.
///
/// ```
/// use cfpose_vision::{Exposure, Patch, Transfer, guess_transfer, render};
/// use rand_chacha::rand_core::SeedableRng;
/// let square = Patch { polygon: vec![[30.3, 20.1], [90.2, 24.3], [88.1, 70.4], [28.0, 66.2]], grey: 60.0 };
/// for transfer in [Transfer::Srgb, Transfer::Linear] {
///     let mut rng = rand_chacha::ChaCha12Rng::seed_from_u64(3);
///     let exposure = Exposure { transfer, blur: 1.5, ..Exposure::default() };
///     let picture = render(120, 96, &[square.clone()], &exposure, &mut rng);
///     assert_eq!(guess_transfer(&[&picture], &Default::default()), transfer);
/// }
/// ```
pub fn guess_transfer(pictures: &[&Picture], options: &SegmentOptions) -> Transfer {
    let mut sums = [0.0; 2];
    for picture in pictures.iter().filter(|picture| !picture.is_two_valued()) {
        let light = picture.light(Transfer::Srgb);
        let Ok(segmentation) = segment(&light, options) else { continue };
        let places: Vec<_> = contours_of(&segmentation.coverage, 0.5)
            .iter()
            .filter(|contour| contour.length() >= 16.0)
            .flat_map(|contour| contour.resampled(1.0))
            .collect();
        let both = [asymmetry(&light, &places), asymmetry(&picture.light(Transfer::Linear), &places)];
        if let [Some(as_srgb), Some(as_linear)] = both {
            sums[0] += as_srgb.abs();
            sums[1] += as_linear.abs();
        }
    }
    if sums[1] < sums[0] { Transfer::Linear } else { Transfer::Srgb }
}

/// Return by how much the mean profile across a contour is asymmetric, as a share of its width; `None` where too few profiles end in
/// plateaus.
fn asymmetry(light: &Raster, places: &[([f64; 2], [f64; 2])]) -> Option<f64> {
    let profiles: Vec<_> = places.iter().filter_map(|(p, t)| profile(light, *p, [t[1], -t[0]])).collect();
    if profiles.len() < 60 {
        return None;
    }
    let mut mean = vec![0.0; profiles[0].len()];
    profiles.iter().for_each(|profile| mean.iter_mut().zip(profile).for_each(|(sum, value)| *sum += value));
    mean.iter_mut().for_each(|value| *value /= profiles.len() as f64);
    let place = |share: f64| {
        let k = (0..mean.len() - 1).find(|k| mean[*k] >= share && mean[k + 1] < share)?;
        Some(STEP * (k as f64 + (mean[k] - share) / (mean[k] - mean[k + 1])))
    };
    let middle = place(0.5)?;
    let mut sum = 0.0;
    for share in SHARES {
        let (inner, outer) = (place(1.0 - share)?, place(share)?);
        sum += (0.5 * (inner + outer) - middle) / (outer - inner);
    }
    Some(sum / SHARES.len() as f64)
}

/// Return the shares of a step along a normal, the middle in the middle; `None` where its ends are no plateaus.
fn profile(light: &Raster, place: [f64; 2], normal: [f64; 2]) -> Option<Vec<f64>> {
    let count = (2.0 * REACH / STEP) as usize;
    let take = |shift: f64| -> Option<Vec<f64>> {
        let at = |k: usize| k as f64 * STEP - REACH + shift;
        (0..=count).map(|k| light.sample(place[0] + at(k) * normal[0], place[1] + at(k) * normal[1])).collect()
    };
    let mean = |part: &[f64]| part.iter().sum::<f64>() / part.len() as f64;
    let values = take(0.0)?;
    let (inside, outside) = (mean(&values[..8]), mean(&values[count - 7..]));
    let range = inside - outside;
    let flat = |part: &[f64], level: f64| part.iter().all(|v| (v - level).abs() < 0.2 * range.abs());
    if range == 0.0 || !flat(&values[..8], inside) || !flat(&values[count - 7..], outside) {
        return None;
    }
    let share = |v: f64| (v - outside) / range;
    let k = (0..count).find(|k| share(values[*k]) >= 0.5 && share(values[k + 1]) < 0.5)?;
    let (a, b) = (share(values[k]), share(values[k + 1]));
    let middle = STEP * (k as f64 + (a - 0.5) / (a - b)) - REACH;
    Some(take(middle)?.into_iter().map(share).collect())
}
