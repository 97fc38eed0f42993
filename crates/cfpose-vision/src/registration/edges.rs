//! The search along a normal for the nearest crossing of the right polarity.

use crate::raster::Raster;

/// Distance between samples, pixels.
const STEP: f64 = 0.5;

/// Places from which both sides' levels are read, pixels from the crossing.
const BESIDE: f64 = 2.0;

/// Numbers over the places of an image.
pub trait Field {
    /// Return the number at a place, NaN where something hides it; `None` outside.
    fn sample(&self, x: f64, y: f64) -> Option<f64>;
}

impl Field for Raster {
    #[inline]
    fn sample(&self, x: f64, y: f64) -> Option<f64> {
        Raster::sample(self, x, y)
    }
}

/// Values of a field on the two sides of a contour.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Levels {
    /// Inside.
    pub inside: f32,
    /// Outside.
    pub outside: f32,
    /// Largest distance from these levels, 2 pixels to both sides of a crossing; `None`: not looked at.
    pub tolerance: Option<f32>,
}

impl Levels {
    /// Coverage: 1 inside, 0 outside.
    pub const COVERAGE: Self = Self { inside: 1.0, outside: 0.0, tolerance: None };
}

/// A crossing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Edge {
    /// Signed distance along the normal, pixels.
    pub distance: f64,
    /// Change of the field per pixel there, as a share of the difference of the levels.
    pub slope: f64,
}

/// Find the crossing of the middle between both levels that is nearest to a place along a normal (out of the region), from inside to
/// outside, within `reach` pixels. Samples that are NaN (hidden) or outside the field end no search and hold no crossing.
pub fn nearest(field: &impl Field, place: [f64; 2], normal: [f64; 2], reach: f64, levels: Levels) -> Option<Edge> {
    let middle = 0.5 * f64::from(levels.inside + levels.outside);
    let range = f64::from(levels.outside - levels.inside);
    // Negative inside, positive outside, difference 1.
    let value = |t: f64| match field.sample(place[0] + t * normal[0], place[1] + t * normal[1]) {
        Some(value) => (value - middle) / range,
        None => f64::NAN,
    };
    let crossing = |t: f64, a: f64, b: f64| {
        let hit = a < 0.0 && b >= 0.0;
        hit.then(|| Edge { distance: t + STEP * a / (a - b), slope: (b - a) / STEP })
    };
    let fits = |edge: &Edge| {
        let Some(tolerance) = levels.tolerance else { return true };
        let beside = |t: f64, level: f32| {
            let at = field.sample(place[0] + t * normal[0], place[1] + t * normal[1]);
            at.is_some_and(|value| (value - f64::from(level)).abs() < f64::from(tolerance))
        };
        beside(edge.distance - BESIDE, levels.inside) && beside(edge.distance + BESIDE, levels.outside)
    };
    let centre = value(0.0);
    let (mut out, mut back) = (centre, centre);
    let count = (reach / STEP).ceil() as i32;
    for k in 0..count {
        let t = f64::from(k) * STEP;
        let (next, before) = (value(t + STEP), value(-t - STEP));
        let outward = crossing(t, out, next).filter(fits);
        let inward = crossing(-t - STEP, before, back).filter(fits);
        let found = match (outward, inward) {
            (Some(a), Some(b)) => Some(if a.distance.abs() <= b.distance.abs() { a } else { b }),
            (a, b) => a.or(b),
        };
        if let Some(edge) = found {
            return Some(edge);
        }
        (out, back) = (next, before);
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_edge_of_the_right_polarity_is_found() {
        // A bright bar from 10 to 20.25.
        let bar = Raster::from_fn(40, 4, |x, _| match x {
            10..=19 => 1.0,
            20 => 0.75,
            _ => 0.0,
        });
        let search = |x: f64, reach: f64, normal: [f64; 2]| {
            nearest(&bar, [x, 1.5], normal, reach, Levels::COVERAGE).map(|edge| x + edge.distance * normal[0])
        };
        let right = search(17.0, 6.0, [1.0, 0.0]).unwrap();
        assert!((right - (20.0 + 0.25 / 0.75)).abs() < 1e-6, "{right}");
        // The left edge has the other polarity: it is passed over.
        assert_eq!(search(10.0, 6.0, [1.0, 0.0]), None);
        let left = search(12.0, 6.0, [-1.0, 0.0]).unwrap();
        assert!((left - 9.5).abs() < 1e-6);
        // Hidden pixels hold no edge.
        let mut hidden = bar.clone();
        hidden.row_mut(1)[19..22].fill(f32::NAN);
        assert_eq!(nearest(&hidden, [17.0, 1.5], [1.0, 0.0], 6.0, Levels::COVERAGE), None);
    }
}
