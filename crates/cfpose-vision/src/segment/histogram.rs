//! Otsu's threshold of a raster.

use crate::raster::Raster;

/// Number of bins.
const BINS: usize = 512;

/// Two classes of values.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Split {
    /// Largest value of the lower class.
    pub threshold: f32,
    /// Mean of the lower class.
    pub below: f32,
    /// Mean of the upper class.
    pub above: f32,
    /// Variance between the classes as a share of the whole variance.
    pub separability: f32,
}

/// Find the value that separates two classes of the largest variance between them; values lie in 0..`most`. `None` where all values
/// share a bin.
///
/// Source: N. Otsu, "A threshold selection method from gray-level histograms", 1979, equations 18 and 12.
pub fn otsu(raster: &Raster, most: f32) -> Option<Split> {
    let mut histogram = [0u32; BINS];
    let scale = BINS as f32 / most;
    for value in raster.values() {
        histogram[((value * scale).max(0.0) as usize).min(BINS - 1)] += 1;
    }
    let centre = |bin: usize| (bin as f64 + 0.5) / f64::from(scale);
    let total = raster.values().len() as f64;
    let sum: f64 = (0..BINS).map(|bin| centre(bin) * f64::from(histogram[bin])).sum();
    let square: f64 = (0..BINS).map(|bin| centre(bin).powi(2) * f64::from(histogram[bin])).sum();
    let (mut below, mut sum_below) = (0.0, 0.0);
    let mut best: Option<(f64, usize, f64, f64)> = None;
    for bin in 0..BINS - 1 {
        let count = f64::from(histogram[bin]);
        (below, sum_below) = (below + count, sum_below + centre(bin) * count);
        let above = total - below;
        if below > 0.0 && above > 0.0 {
            let (low, high) = (sum_below / below, (sum - sum_below) / above);
            let between = below * above * (high - low).powi(2);
            if best.is_none_or(|(most, ..)| between > most) {
                best = Some((between, bin, low, high));
            }
        }
    }
    let (between, bin, low, high) = best?;
    let variance = (square / total - (sum / total).powi(2)).max(1e-12);
    Some(Split {
        threshold: (bin + 1) as f32 / scale,
        below: low as f32,
        above: high as f32,
        separability: (between / (total * total) / variance) as f32,
    })
}
