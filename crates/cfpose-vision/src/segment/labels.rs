//! Masks: counts in windows, connected components, pixels that nothing explains.

use crate::raster::Raster;

/// Pixels of a region, 1 inside and 0 outside.
#[derive(Debug, Clone, PartialEq)]
pub struct Mask {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Row by row.
    pub values: Vec<u8>,
}

/// A connected region.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Component {
    /// Number of pixels.
    pub pixels: usize,
    /// First and last column and row: left, top, right, bottom.
    pub bounds: [usize; 4],
}

impl Mask {
    /// Make the mask of a condition.
    pub fn of(raster: &Raster, inside: impl Fn(f32) -> bool) -> Self {
        let values = raster.values().iter().map(|value| u8::from(inside(*value))).collect();
        Self { width: raster.width(), height: raster.height(), values }
    }
}

/// Count, for each pixel, the pixels of the mask within `reach` columns and rows, beside the size of that window inside the image.
pub fn counts(mask: &Mask, reach: usize) -> Vec<(u16, u16)> {
    let (w, h) = (mask.width, mask.height);
    let window = |at: usize, count: usize| (at.saturating_sub(reach), (at + reach).min(count - 1));
    let mut across = vec![0u16; w * h];
    for y in 0..h {
        let (row, out) = (&mask.values[y * w..(y + 1) * w], &mut across[y * w..(y + 1) * w]);
        let mut sum: u16 = row[..reach.min(w)].iter().map(|v| u16::from(*v)).sum();
        for x in 0..w {
            if x + reach < w {
                sum += u16::from(row[x + reach]);
            }
            if x > reach {
                sum -= u16::from(row[x - reach - 1]);
            }
            out[x] = sum;
        }
    }
    let mut sums = vec![0u16; w];
    for y in 0..reach.min(h) {
        sums.iter_mut().zip(&across[y * w..(y + 1) * w]).for_each(|(s, v)| *s += v);
    }
    let widths: Vec<u16> = (0..w).map(|x| (window(x, w).1 - window(x, w).0 + 1) as u16).collect();
    let mut all = Vec::with_capacity(w * h);
    for y in 0..h {
        if y + reach < h {
            sums.iter_mut().zip(&across[(y + reach) * w..(y + reach + 1) * w]).for_each(|(s, v)| *s += v);
        }
        if y > reach {
            sums.iter_mut().zip(&across[(y - reach - 1) * w..(y - reach) * w]).for_each(|(s, v)| *s -= v);
        }
        let rows = (window(y, h).1 - window(y, h).0 + 1) as u16;
        all.extend(sums.iter().zip(&widths).map(|(sum, width)| (*sum, width * rows)));
    }
    all
}

/// Remove connected regions (of 8 neighbours) below `least` pixels and below `share` of the largest; return the others, largest first.
pub fn keep_large(mask: &mut Mask, least: usize, share: f64) -> Vec<Component> {
    let (w, h) = (mask.width, mask.height);
    let mut labels = vec![0u32; w * h];
    let mut parents: Vec<u32> = vec![0];
    for y in 0..h {
        for x in 0..w {
            let at = y * w + x;
            if mask.values[at] == 0 {
                continue;
            }
            let label = |there: bool, place: usize| if there { labels[place] } else { 0 };
            let neighbours = [
                label(x > 0, at.wrapping_sub(1)),
                label(y > 0 && x > 0, at.wrapping_sub(w + 1)),
                label(y > 0, at.wrapping_sub(w)),
                label(y > 0 && x + 1 < w, (at + 1).wrapping_sub(w)),
            ];
            let least = neighbours.iter().filter(|label| **label > 0).map(|label| root(&mut parents, *label)).min();
            labels[at] = match least {
                Some(label) => {
                    for other in neighbours.into_iter().filter(|label| *label > 0) {
                        let other = root(&mut parents, other);
                        parents[other as usize] = label;
                    }
                    label
                }
                None => {
                    parents.push(parents.len() as u32);
                    parents.len() as u32 - 1
                }
            };
        }
    }
    let mut found = vec![Component { pixels: 0, bounds: [usize::MAX, usize::MAX, 0, 0] }; parents.len()];
    for (at, label) in labels.iter_mut().enumerate().filter(|(_, label)| **label > 0) {
        *label = root(&mut parents, *label);
        let component = &mut found[*label as usize];
        let (x, y, b) = (at % w, at / w, &mut component.bounds);
        component.pixels += 1;
        *b = [b[0].min(x), b[1].min(y), b[2].max(x), b[3].max(y)];
    }
    let largest = found.iter().map(|component| component.pixels).max().unwrap_or(0);
    let needed = least.max((share * largest as f64) as usize);
    for (value, label) in mask.values.iter_mut().zip(&labels) {
        *value = u8::from(found[*label as usize].pixels >= needed && *label > 0);
    }
    let mut kept: Vec<Component> = found.into_iter().filter(|component| component.pixels >= needed).collect();
    kept.sort_by_key(|component| std::cmp::Reverse(component.pixels));
    kept
}

fn root(parents: &mut [u32], label: u32) -> u32 {
    let mut at = label;
    while parents[at as usize] != at {
        parents[at as usize] = parents[parents[at as usize] as usize];
        at = parents[at as usize];
    }
    at
}

/// Mark what is neither background nor pattern over more than a seam between them, grown by 3 pixels; `None` where nothing is.
///
/// A seam of mixed pixels is a few pixels wide; an opening by 7 x 7 pixels leaves it out.
pub fn neither(smooth: &Raster, background: f32, pattern: f32) -> Option<Vec<bool>> {
    let tolerance = 0.25 * (background - pattern).abs();
    let odd = |value: f32| {
        let between = value > pattern + tolerance && value < background - tolerance;
        between || value < pattern - tolerance || value > background + tolerance
    };
    let mask = Mask::of(smooth, odd);
    let core: Vec<u8> = counts(&mask, 3).iter().map(|(count, full)| u8::from(count == full)).collect();
    let mut core = Mask { values: core, ..mask };
    if keep_large(&mut core, 20, 0.0).is_empty() {
        return None;
    }
    // Opened by 3 and grown by 4 more.
    Some(counts(&core, 7).iter().map(|(count, _)| *count > 0).collect())
}
