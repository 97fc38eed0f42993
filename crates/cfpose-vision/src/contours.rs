//! Sub-pixel contours of a raster.

use std::collections::HashMap;

use crate::raster::Raster;

/// A contour: places in order, with the higher values on the side of (-t_y, t_x) of the direction t, so that (t_y, -t_x) points out of
/// a bright region.
#[derive(Debug, Clone, PartialEq)]
pub struct Contour {
    /// Places, x and y.
    pub places: Vec<[f64; 2]>,
    /// Whether the last place is followed by the first.
    pub closed: bool,
}

/// Return the contours of a level by marching squares, places interpolated along the edges of the grid; where four pixels leave two
/// ways, the mean of them decides.
///
/// Source: W. E. Lorensen and H. E. Cline, "Marching cubes", 1987, in two dimensions.
///
/// ```
/// use cfpose_vision::{Raster, contours_of};
/// let disc = Raster::from_fn(40, 40, |x, y| {
///     let radius = (x as f64 - 20.0).hypot(y as f64 - 19.0);
///     (10.5 - radius).clamp(0.0, 1.0) as f32
/// });
/// let [contour] = &contours_of(&disc, 0.5)[..] else { panic!("one contour") };
/// assert!(contour.closed);
/// assert!(contour.places.iter().all(|p| ((p[0] - 20.0).hypot(p[1] - 19.0) - 10.0).abs() < 0.09));
/// assert!((contour.signed_area() - 314.0).abs() < 2.0);
/// ```
pub fn contours_of(raster: &Raster, level: f32) -> Vec<Contour> {
    let segments = segments(raster, level);
    let next: HashMap<u32, u32> = segments.iter().copied().collect();
    let entered: std::collections::HashSet<u32> = segments.iter().map(|(_, to)| *to).collect();
    let mut used = std::collections::HashSet::with_capacity(segments.len());
    let mut all = Vec::new();
    // Contours that begin at the border first, then closed ones.
    let open = segments.iter().filter(|(from, _)| !entered.contains(from));
    for (start, _) in open.chain(&segments) {
        if !used.insert(*start) {
            continue;
        }
        let mut edges = vec![*start];
        let mut at = *start;
        let closed = loop {
            match next.get(&at) {
                Some(to) if to == start => break true,
                Some(to) => {
                    used.insert(*to);
                    edges.push(*to);
                    at = *to;
                }
                None => break false,
            }
        };
        let places = edges.iter().map(|edge| crossing(raster, level, *edge)).collect();
        all.push(Contour { places, closed });
    }
    all
}

/// Return where a level crosses an edge of the grid: even numbers run to the right of a pixel, odd ones down.
fn crossing(raster: &Raster, level: f32, edge: u32) -> [f64; 2] {
    let pixel = (edge / 2) as usize;
    let (x, y) = (pixel % raster.width(), pixel / raster.width());
    let (dx, dy) = if edge.is_multiple_of(2) { (1, 0) } else { (0, 1) };
    let (a, b) = (f64::from(raster.at(x, y)), f64::from(raster.at(x + dx, y + dy)));
    let share = ((f64::from(level) - a) / (b - a)).clamp(0.0, 1.0);
    [x as f64 + share * dx as f64, y as f64 + share * dy as f64]
}

/// Return directed pieces (from edge, to edge) of all cells.
fn segments(raster: &Raster, level: f32) -> Vec<(u32, u32)> {
    let (w, h) = (raster.width(), raster.height());
    let mut found = Vec::new();
    for y in 0..h.saturating_sub(1) {
        let (upper, lower) = (raster.row(y), raster.row(y + 1));
        for x in 0..w - 1 {
            let cell = [upper[x], upper[x + 1], lower[x + 1], lower[x]];
            let case = (0..4).map(|k| u8::from(cell[k] > level) << k).sum::<u8>();
            if case == 0 || case == 15 {
                continue;
            }
            let pixel = (y * w + x) as u32;
            let (top, left) = (2 * pixel, 2 * pixel + 1);
            let (bottom, right) = (2 * (pixel + w as u32), 2 * (pixel + 1) + 1);
            let high = cell.iter().sum::<f32>() > 4.0 * level;
            match case {
                1 => found.push((top, left)),
                2 => found.push((right, top)),
                3 => found.push((right, left)),
                4 => found.push((bottom, right)),
                6 => found.push((bottom, top)),
                7 => found.push((bottom, left)),
                8 => found.push((left, bottom)),
                9 => found.push((top, bottom)),
                11 => found.push((right, bottom)),
                12 => found.push((left, right)),
                13 => found.push((top, right)),
                14 => found.push((left, top)),
                5 if high => found.extend([(top, right), (bottom, left)]),
                5 => found.extend([(top, left), (bottom, right)]),
                _ if high => found.extend([(left, top), (right, bottom)]),
                _ => found.extend([(right, top), (left, bottom)]),
            }
        }
    }
    found
}

impl Contour {
    /// Return the length.
    pub fn length(&self) -> f64 {
        self.pieces().map(|(a, b)| (b[0] - a[0]).hypot(b[1] - a[1])).sum()
    }

    /// Return the area of a closed contour, positive around high values and negative around holes.
    pub fn signed_area(&self) -> f64 {
        self.pieces().map(|(a, b)| 0.5 * (a[0] * b[1] - b[0] * a[1])).sum::<f64>()
    }

    fn pieces(&self) -> impl Iterator<Item = ([f64; 2], [f64; 2])> + '_ {
        let count = self.places.len();
        let last = if self.closed { count } else { count.saturating_sub(1) };
        (0..last).map(move |k| (self.places[k], self.places[(k + 1) % count]))
    }

    /// Return places evenly spaced along the contour, about `spacing` pixels apart, and the direction of the contour there (norm 1).
    pub fn resampled(&self, spacing: f64) -> Vec<([f64; 2], [f64; 2])> {
        let length = self.length();
        let count = (length / spacing).round().max(3.0) as usize;
        let step = length / count as f64;
        let mut places = Vec::with_capacity(count);
        let (mut walked, mut wanted) = (0.0, 0.5 * step);
        for (a, b) in self.pieces() {
            let piece = (b[0] - a[0]).hypot(b[1] - a[1]);
            while wanted < walked + piece && places.len() < count {
                let share = (wanted - walked) / piece;
                places.push([a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])]);
                wanted += step;
            }
            walked += piece;
        }
        let total = places.len();
        let neighbour = |k: usize, forward: bool| match (self.closed, forward) {
            (true, true) => (k + 1) % total,
            (true, false) => (k + total - 1) % total,
            (false, true) => (k + 1).min(total - 1),
            (false, false) => k.saturating_sub(1),
        };
        let direction = |k: usize| {
            let (a, b) = (places[neighbour(k, false)], places[neighbour(k, true)]);
            let size = (b[0] - a[0]).hypot(b[1] - a[1]).max(1e-12);
            [(b[0] - a[0]) / size, (b[1] - a[1]) / size]
        };
        (0..total).map(|k| (places[k], direction(k))).collect()
    }
}
