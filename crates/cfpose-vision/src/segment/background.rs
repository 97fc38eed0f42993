//! The light of the background as a quadratic surface.

use nalgebra::{Matrix6, Vector6};

use super::labels::{Mask, counts};
use crate::raster::Raster;

/// Side of the blocks that are averaged for the fit, pixels.
const BLOCK: usize = 16;

/// Rounds of reweighting.
const ROUNDS: usize = 25;

/// Distance from a surface, as a share of the light, at which a pixel counts half.
const CLOSE: f64 = 0.008;

/// A quadratic function of the place: coefficients of 1, x, y, x^2, x y, y^2 with x and y from -1 to 1 over the image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Surface([f64; 6]);

impl Surface {
    /// Make a flat surface.
    pub fn constant(value: f32) -> Self {
        Self([f64::from(value), 0.0, 0.0, 0.0, 0.0, 0.0])
    }

    /// Return the light at a place from -1 to 1.
    #[inline]
    pub fn at(&self, x: f64, y: f64) -> f64 {
        let c = &self.0;
        c[0] + c[1] * x + c[2] * y + c[3] * x * x + c[4] * x * y + c[5] * y * y
    }

    /// Return values on a coarse grid over the image, corners included.
    pub fn on_grid(&self) -> Vec<f32> {
        let ticks = (0..=8).map(|k| f64::from(k) / 4.0 - 1.0);
        ticks.clone().flat_map(|y| ticks.clone().map(move |x| self.at(x, y) as f32)).collect()
    }

    /// Divide a raster by the surface.
    pub fn divide(&self, raster: &Raster) -> Raster {
        let (w, h) = (raster.width(), raster.height());
        let xs: Vec<f32> = (0..w).map(|x| place(x as f64, w) as f32).collect();
        let mut out = Raster::filled(w, h, 0.0);
        for y in 0..h {
            let v = place(y as f64, h);
            let c = self.0.map(|c| c as f32);
            let (constant, linear) = (self.at(0.0, v) as f32, c[1] + c[4] * v as f32);
            for ((value, source), x) in out.row_mut(y).iter_mut().zip(raster.row(y)).zip(&xs) {
                *value = source / (constant + x * (linear + x * c[3])).max(1e-6);
            }
        }
        out
    }
}

/// Return a pixel's place from -1 to 1.
pub fn place(at: f64, count: usize) -> f64 {
    (at + 0.5) / (count as f64 / 2.0) - 1.0
}

/// Fit the background of a dark pattern: pixels below the surface hardly count, those above little, over-exposed ones not at all.
///
/// The rounds begin twice, from a fit of all pixels (a gradient of the light) and from a flat surface at `level` (a large region of
/// another grey); the result on which more pixels lie closely is taken: a surface that bends down to a region of another grey passes the
/// background at a distance.
pub fn surface(light: &Raster, level: f32, clipped: f32) -> Option<Surface> {
    through(&blocks(light, clipped), level)
}

/// Fit the background through places and their light, as [`surface`] does.
pub fn through(samples: &[(f64, f64, f64)], level: f32) -> Option<Surface> {
    if samples.len() < 12 {
        return None;
    }
    let begins = [fit(samples, &vec![1.0; samples.len()]), Some(Surface::constant(level))];
    let found = begins.into_iter().flatten().filter_map(|begin| rounds(samples, begin));
    let on = |surface: &Surface| -> f64 {
        let off = |(u, v, value): &(f64, f64, f64)| (value / surface.at(*u, *v).max(1e-6) - 1.0) / CLOSE;
        samples.iter().map(|sample| 1.0 / (1.0 + off(sample).powi(2))).sum()
    };
    found.reduce(|a, b| if on(&b) > on(&a) { b } else { a })
}

/// Return places and mean light of blocks without over-exposed pixels.
fn blocks(light: &Raster, clipped: f32) -> Vec<(f64, f64, f64)> {
    let block = BLOCK.min(light.width() / 8).min(light.height() / 8).max(1);
    let mut samples = Vec::new();
    for y in (0..light.height() + 1 - block).step_by(block) {
        for x in (0..light.width() + 1 - block).step_by(block) {
            let (mut sum, mut cut) = (0.0, 0usize);
            for row in y..y + block {
                let part = &light.row(row)[x..x + block];
                sum += part.iter().sum::<f32>();
                cut += part.iter().filter(|value| **value >= clipped).count();
            }
            let centre = (block as f64 - 1.0) / 2.0;
            let (u, v) = (place(x as f64 + centre, light.width()), place(y as f64 + centre, light.height()));
            if cut * 50 <= block * block {
                samples.push((u, v, f64::from(sum) / (block * block) as f64));
            }
        }
    }
    samples
}

/// Reweight from a surface until it rests.
fn rounds(samples: &[(f64, f64, f64)], begin: Surface) -> Option<Surface> {
    let mut weights = vec![0.0; samples.len()];
    let mut found = begin;
    for _ in 0..ROUNDS {
        let mut moved = 0.0_f64;
        for ((u, v, value), weight) in samples.iter().zip(&mut weights) {
            let at = found.at(*u, *v).max(1e-6);
            let distance = value / at - 1.0;
            let kept = if distance < -0.08 {
                0.02
            } else if distance > 0.25 {
                0.3
            } else {
                1.0
            };
            // Weighted by the inverse light: relative distances.
            let new = kept / at;
            moved = moved.max((new - *weight).abs() / new);
            *weight = new;
        }
        if moved < 1e-3 {
            break;
        }
        found = fit(samples, &weights)?;
    }
    Some(found)
}

/// Distance from the pattern within which blur may darken the background, pixels.
const DARKENED: usize = 10;

/// Rounds in which what stands out is left out, and by how many standard deviations.
const TRIMS: usize = 3;
const STANDS_OUT: f64 = 3.5;

/// Fit the background's pixels that are away from the pattern, and not cut off at the top, as a correction of a reflectance that is smoothed: a choice of
/// pixels by their own noise would shift the mean of those that are chosen.
pub fn refit(reflectance: &Raster, bright: &[bool], mask: &Mask) -> Option<Surface> {
    let counts = counts(mask, DARKENED);
    let mut samples = Vec::new();
    let (w, h) = (reflectance.width(), reflectance.height());
    let step = ((w * h) as f64 / 6000.0).sqrt().ceil().max(1.0) as usize;
    for y in (0..h).step_by(step) {
        for x in (0..w).step_by(step) {
            let value = f64::from(reflectance.at(x, y));
            let dim = !bright[y * w + x];
            if dim && counts[y * w + x].0 == 0 && (0.85..1.2).contains(&value) {
                samples.push((place(x as f64, w), place(y as f64, h), value));
            }
        }
    }
    if samples.len() < 50 {
        return None;
    }
    let mut fitted = fit(&samples, &vec![1.0; samples.len()])?;
    // A light part of the pattern, or of what hides it, stands out from the background by more than its noise.
    for _ in 0..TRIMS {
        let off = |(x, y, value): &(f64, f64, f64)| (value - fitted.at(*x, *y)).abs();
        let mut sizes: Vec<f32> = samples.iter().map(|sample| off(sample) as f32).collect();
        let limit = (STANDS_OUT * 1.4826 * f64::from(super::median(&mut sizes)?)).max(0.01);
        let kept: Vec<_> = samples.iter().copied().filter(|sample| off(sample) < limit).collect();
        if kept.len() < 50 {
            break;
        }
        fitted = fit(&kept, &vec![1.0; kept.len()])?;
    }
    let even = fitted.on_grid().iter().all(|value| (0.7..1.4).contains(value));
    even.then_some(fitted)
}

/// Solve weighted linear least squares by the normal equations of 6 unknowns: their condition is below 100 here.
pub fn fit(samples: &[(f64, f64, f64)], weights: &[f64]) -> Option<Surface> {
    let (mut normal, mut right) = (Matrix6::zeros(), Vector6::zeros());
    for ((x, y, value), weight) in samples.iter().zip(weights) {
        let basis = Vector6::new(1.0, *x, *y, x * x, x * y, y * y) * *weight;
        normal += basis * basis.transpose();
        right += basis * (weight * value);
    }
    let solved = normal.cholesky()?.solve(&right);
    solved.iter().all(|c| c.is_finite()).then(|| Surface(solved.into()))
}
