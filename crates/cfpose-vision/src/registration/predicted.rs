//! What a blurred frame would show of the mapped reference, and where the search would find its edges there.
//!
//! Blur moves edges: towards the centre of curvature, and away from corners and from other parts of the outline. The search makes the same
//! error on the frame and on the reference mapped and blurred alike, so the difference of both distances is free of it (analysis by
//! synthesis). The blur's covariance is found from the areas between the profiles across the outline and a sharp step.

use nalgebra::{Matrix3, Vector3};

use super::backward::Backward;
use super::edges::{self, Field};
use super::fit::Found;
use super::pattern::Pattern;
use super::registrar::{Outlined, Registrar};
use super::sight::Sight;
use super::view::View;
use crate::raster::Raster;

/// Distance between samples of a profile and of a path of motion, pixels.
const STEP: f64 = 0.5;

/// Half the length of a profile, pixels, at most: [`View::unbounded`] is a step beyond.
const LONGEST: f64 = 7.5;

/// Fewest profiles from which a blur is found.
const FEWEST: usize = 30;

/// Largest standard deviation of a blur, pixels.
const MOST: f64 = 10.0;

/// Covariance of a blur in pixels^2: xx, xy, yy. It is added to the blur that the mapped reference has of its own.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Blur(pub [f64; 3]);

impl Blur {
    /// Alike in all directions.
    pub fn round(variance: f64) -> Self {
        Self([variance, 0.0, variance])
    }

    /// Return the variance along a direction of norm 1.
    pub fn along(&self, [x, y]: [f64; 2]) -> f64 {
        self.0[0] * x * x + 2.0 * self.0[1] * x * y + self.0[2] * y * y
    }

    /// Return the smaller and the larger variance, and the direction of the larger one.
    fn axes(&self) -> (f64, f64, [f64; 2]) {
        let [xx, xy, yy] = self.0;
        let (mean, half) = (0.5 * (xx + yy), (0.5 * (xx - yy)).hypot(xy));
        let angle = 0.5 * (2.0 * xy).atan2(xx - yy);
        (mean - half, mean + half, [angle.cos(), angle.sin()])
    }

    /// Return the nearest covariance whose variances are neither negative nor larger than [`MOST`] squared.
    fn sound(&self) -> Self {
        let (low, high, [x, y]) = self.axes();
        let [low, high] = [low, high].map(|v| v.clamp(0.0, MOST * MOST));
        let more = high - low;
        Self([low + more * x * x, more * x * y, low + more * y * y])
    }
}

/// The mapped reference around its outline in the frame, sharp.
pub(super) struct Drawn {
    sharp: Raster,
    corner: [f64; 2],
}

/// The mapped reference under a blur: a Gaussian alike in all directions, and uniform motion along one.
struct Predicted {
    field: Raster,
    corner: [f64; 2],
    /// Places of the path of motion.
    path: Vec<[f64; 2]>,
}

impl Field for Predicted {
    fn sample(&self, x: f64, y: f64) -> Option<f64> {
        let mut sum = 0.0;
        for shift in &self.path {
            sum += self.field.sample(x - self.corner[0] + shift[0], y - self.corner[1] + shift[1]).unwrap_or(0.0);
        }
        Some(sum / self.path.len() as f64)
    }
}

impl Drawn {
    /// Draw the reference under a theta; `pixels` are the places of its outline in the frame.
    pub fn new(
        registrar: &Registrar,
        pattern: &Pattern,
        sight: &Sight,
        theta: &[f64],
        pixels: &[[f64; 2]],
    ) -> Option<Self> {
        const MARGIN: f64 = 24.0;
        let bounds = |d: usize, most: usize| {
            let of = pixels.iter().map(|p| p[d]).filter(|v| v.is_finite());
            let (least, largest) = of.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
            let inside = |v: f64| v.clamp(-MARGIN, most as f64 + MARGIN);
            (inside(least - MARGIN).floor(), inside(largest + MARGIN).ceil())
        };
        let (left, right) = bounds(0, sight.field.width());
        let (top, bottom) = bounds(1, sight.field.height());
        if !(right - left >= 4.0 && bottom - top >= 4.0) {
            return None;
        }
        let backward = Backward::new(&registrar.homography(theta), pattern, sight)?;
        let sharp = Raster::from_fn((right - left) as usize, (bottom - top) as usize, |x, y| {
            let place = backward.at([x as f64 + left, y as f64 + top]);
            place.and_then(|p| pattern.coverage.sample(p[0], p[1])).unwrap_or(0.0) as f32
        });
        Some(Self { sharp, corner: [left, top] })
    }

    fn under(&self, blur: Blur) -> Predicted {
        let (low, high, along) = blur.axes();
        let field = if low > 0.04 { self.sharp.gaussian(low.sqrt()) } else { self.sharp.clone() };
        // Uniform motion over a length has 1/12 of its square as variance.
        let length = (12.0 * (high - low)).sqrt();
        let half = (0.5 * length / STEP).ceil() as i32;
        let path = match length > STEP {
            true => (-half..half)
                .map(|k| (f64::from(k) + 0.5) * 0.5 * length / f64::from(half))
                .map(|t| along.map(|v| t * v))
                .collect(),
            false => vec![[0.0; 2]],
        };
        Predicted { field, corner: self.corner, path }
    }

    /// Return the blur under which the mapped reference has the profiles of the frame.
    pub fn blur_of(&self, view: &View, found: &Found, begin: Blur) -> Option<Blur> {
        const ROUNDS: usize = 3;
        let near: Vec<usize> = (0..found.distances.len()).filter(|i| found.distances[*i].abs() < 1.5).collect();
        let mut blur = begin;
        for _ in 0..ROUNDS {
            let predicted = self.under(blur);
            let mut rows = Vec::with_capacity(near.len());
            for i in near.iter().copied() {
                let (place, normal) = (found.pixels[i], found.across[i]);
                let variance = blur.along(normal) + OWN;
                let reach = (2.5 * variance.sqrt() + 1.5).min(LONGEST);
                let areas = (area(view.profiles(), place, normal, reach), area(&predicted, place, normal, reach));
                if let (Some(seen), Some(expected)) = areas {
                    // A step under a Gaussian s leaves an area of s sqrt(2 / pi).
                    let more = 0.5 * std::f64::consts::PI * (seen * seen - expected * expected);
                    rows.push((normal, more, variance));
                }
            }
            let change = change(&rows)?;
            blur = Blur([0, 1, 2].map(|k| blur.0[k] + change[k])).sound();
        }
        Some(blur)
    }

    /// Return how far edges have to be moved along the normals to be where they would be without a blur, pixels; 0 where the search finds
    /// none on the mapped reference.
    pub fn shifts(&self, outlined: &Outlined, found: &Found, blur: Blur) -> Vec<f64> {
        let predicted = self.under(blur);
        let shift = |i: usize| {
            let edge = edges::nearest(&predicted, found.pixels[i], found.across[i], 3.0, outlined.levels[i]);
            edge.map_or(0.0, |edge| -edge.distance)
        };
        (0..found.distances.len()).map(|i| if found.pixels[i][0].is_nan() { 0.0 } else { shift(i) }).collect()
    }
}

/// Return the area between the profile across the outline and a sharp step at a place, pixels; `None` where something hides it.
fn area(field: &impl Field, place: [f64; 2], normal: [f64; 2], reach: f64) -> Option<f64> {
    let count = (reach / STEP).round() as i32;
    let mut sum = 0.0;
    for k in -count..count {
        let t = (f64::from(k) + 0.5) * STEP;
        let value = field.sample(place[0] + t * normal[0], place[1] + t * normal[1]).filter(|v| !v.is_nan())?;
        sum += if t < 0.0 { 1.0 - value } else { value };
    }
    Some(sum * STEP)
}

/// Variance of the mapped reference's own blur, pixels^2, about.
const OWN: f64 = 0.6;

/// Solve for the change of a covariance from its components along normals, without those that stand out.
fn change(rows: &[([f64; 2], f64, f64)]) -> Option<[f64; 3]> {
    const STANDS_OUT: f64 = 3.0;
    if rows.len() < FEWEST {
        return None;
    }
    let design = |[x, y]: [f64; 2]| Vector3::new(x * x, 2.0 * x * y, y * y);
    let mut solved: Vector3<f64> = Vector3::zeros();
    let mut limit = f64::INFINITY;
    for _ in 0..3 {
        let (mut normal, mut right) = (Matrix3::identity() * 1e-9, Vector3::zeros());
        for (direction, value, variance) in rows {
            let row = design(*direction);
            if (value - row.dot(&solved)).abs() / variance > limit {
                continue;
            }
            // The error of a deviation hardly depends on it: that of a variance grows with the deviation.
            normal += row * row.transpose() / *variance;
            right += row * (value / variance);
        }
        solved = normal.cholesky()?.solve(&right);
        let off = rows
            .iter()
            .map(|(direction, value, variance)| ((value - design(*direction).dot(&solved)).abs() / variance) as f32);
        limit = STANDS_OUT * 1.4826 * f64::from(crate::segment::median(&mut off.collect::<Vec<_>>())?).max(0.02);
    }
    solved.iter().all(|v| v.is_finite()).then(|| solved.into())
}
