//! The exact area of a polygon in each pixel, by signed areas.

use crate::raster::Raster;

/// Return the share of each pixel that a closed polygon covers; pixel (x, y) is the square of side 1 around (x, y).
///
/// Every edge is cut at the pixels' borders; a piece adds the area to its right within its pixel, and its height to all pixels further
/// right: sums along the row give the coverage (the accumulation buffer of font rasterisers). Corners may lie outside the image.
pub fn coverage(polygon: &[[f64; 2]], width: usize, height: usize) -> Raster {
    filled(&[polygon], |turns| turns.abs().min(1.0), width, height)
}

/// Return the share of each pixel that rings wind around: once or more, or an odd number of times. Exact where a pixel holds no crossing
/// of rings.
pub(crate) fn winding(rings: &[Vec<[f64; 2]>], even_odd: bool, width: usize, height: usize) -> Raster {
    let rings: Vec<&[[f64; 2]]> = rings.iter().map(Vec::as_slice).collect();
    match even_odd {
        true => filled(&rings, |turns| 1.0 - (1.0 - turns.rem_euclid(2.0)).abs(), width, height),
        false => filled(&rings, |turns| turns.abs().min(1.0), width, height),
    }
}

/// Sum the signed areas of rings and turn the sums into shares.
fn filled(rings: &[&[[f64; 2]]], share: impl Fn(f64) -> f64, width: usize, height: usize) -> Raster {
    let mut sums = vec![0.0f64; (width + 1) * height];
    for polygon in rings {
        for (k, from) in polygon.iter().enumerate() {
            let to = polygon[(k + 1) % polygon.len()];
            // Pixel borders at integers.
            edge([from[0] + 0.5, from[1] + 0.5], [to[0] + 0.5, to[1] + 0.5], width, height, &mut sums);
        }
    }
    let mut out = Raster::filled(width, height, 0.0);
    for y in 0..height {
        let mut total = 0.0;
        for (value, change) in out.row_mut(y).iter_mut().zip(&sums[y * (width + 1)..]) {
            total += change;
            *value = share(total) as f32;
        }
    }
    out
}

/// Add one edge.
fn edge(from: [f64; 2], to: [f64; 2], width: usize, height: usize, sums: &mut [f64]) {
    let (sign, [x0, y0], [x1, y1]) = if from[1] < to[1] { (1.0, from, to) } else { (-1.0, to, from) };
    if y0 == y1 {
        return;
    }
    let slope = (x1 - x0) / (y1 - y0);
    let (first, last) = (y0.max(0.0), y1.min(height as f64));
    let mut y = first;
    while y < last {
        let row = y.floor();
        let next = (row + 1.0).min(last);
        let (a, b) = (x0 + slope * (y - y0), x0 + slope * (next - y0));
        strip(a, b, next - y, sign, width, &mut sums[row as usize * (width + 1)..(row as usize + 1) * (width + 1)]);
        y = next;
    }
}

/// Add the piece of an edge within one row: from column a to b over a height.
fn strip(a: f64, b: f64, tall: f64, sign: f64, width: usize, row: &mut [f64]) {
    let (low, high) = (a.min(b), a.max(b));
    let most = width as f64;
    if high <= 0.0 {
        row[0] += sign * tall;
        return;
    }
    if low >= most {
        return;
    }
    let run = high - low;
    if run < 1e-12 {
        return piece(low, high, tall, sign, width, row);
    }
    if low < 0.0 {
        row[0] += sign * tall * (-low / run);
    }
    let mut x = low.max(0.0);
    let end = high.min(most);
    while x < end {
        let next = (x.floor() + 1.0).min(end);
        piece(x, next, tall * (next - x) / run, sign, width, row);
        x = next;
    }
}

/// Add a piece within one pixel.
fn piece(a: f64, b: f64, tall: f64, sign: f64, width: usize, row: &mut [f64]) {
    let pixel = (a.max(0.0).floor() as usize).min(width - 1);
    let right = 1.0 - ((a + b) / 2.0 - pixel as f64).clamp(0.0, 1.0);
    row[pixel] += sign * tall * right;
    row[pixel + 1] += sign * tall * (1.0 - right);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sum_of_all_pixels_is_the_area_of_the_polygon() {
        let ring: Vec<[f64; 2]> = (0..97)
            .map(|k| f64::from(k) / 97.0 * std::f64::consts::TAU)
            .map(|t| [20.3 + 11.7 * t.cos() + 3.0 * (3.0 * t).sin(), 17.9 + 12.2 * t.sin()])
            .collect();
        let area: f64 =
            (0..97).map(|k| (ring[k], ring[(k + 1) % 97])).map(|(a, b)| (a[0] * b[1] - b[0] * a[1]) / 2.0).sum();
        let sum: f64 = coverage(&ring, 50, 40).values().iter().map(|v| f64::from(*v)).sum();
        assert!((sum - area.abs()).abs() < 1e-3, "{sum} {area}");
    }

    #[test]
    fn what_lies_outside_the_image_is_cut_off() {
        let square = [[-10.5, -7.5], [4.5, -7.5], [4.5, 2.5], [-10.5, 2.5]];
        let cover = coverage(&square, 20, 10);
        assert_eq!(cover.values().iter().sum::<f32>(), 15.0);
        let right = [[15.5, 3.5], [40.0, 3.5], [40.0, 30.0], [15.5, 30.0]];
        assert_eq!(coverage(&right, 20, 10).values().iter().sum::<f32>(), 24.0);
    }
}
