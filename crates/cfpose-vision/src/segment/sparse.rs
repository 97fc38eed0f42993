//! The light of background and pattern from a lattice of pixels: all that the next frame of a sequence needs.

use super::background::{self, Surface};
use super::{CLIPPED, median};
use crate::raster::Raster;

/// Pixels of the lattice, and of the part of it that the robust rounds use.
const PIXELS: usize = 4800;
const PART: usize = 16;

/// Share of over-exposed pixels from which the whole frame has to be looked at; fewer are left out.
const MOST_CLIPPED: f64 = 0.3;

/// Fewest pixels of the pattern and of the background.
const FEWEST: usize = 60;

/// Background, pattern and noise of an image whose pattern is known to be dark and of about a level.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sparse {
    /// Light of the background.
    pub surface: Surface,
    /// Level of the pattern as a share of the background.
    pub inside: f32,
    /// Standard deviation of the coverage by noise.
    pub noise: f32,
    /// From columns and rows to places of the surface, and from reflectance to coverage.
    scale: [f64; 2],
    gain: f64,
}

/// Look at a lattice of pixels; `None` where they do not show a pattern of about `level` on a background.
pub fn look(light: &Raster, level: f32) -> Option<Sparse> {
    let (w, h) = (light.width(), light.height());
    let step = ((w * h) as f64 / PIXELS as f64).sqrt().round().max(1.0) as usize;
    let mut samples = Vec::with_capacity(PIXELS + PIXELS / 8);
    let mut clipped = 0usize;
    for y in (step / 2..h).step_by(step) {
        let row = light.row(y);
        let v = background::place(y as f64, h);
        for x in (step / 2..w).step_by(step) {
            // Noise cuts off pixels whose mean is a little below the top.
            if row[x] > 0.94 * CLIPPED {
                clipped += 1;
                continue;
            }
            samples.push((background::place(x as f64, w), v, f64::from(row[x])));
        }
    }
    if clipped as f64 > MOST_CLIPPED * (samples.len() + clipped) as f64 {
        return None;
    }
    // Steps of a prime's size spread over rows and columns.
    let part: Vec<_> = samples.iter().copied().step_by(PART + 1).collect();
    let mut values: Vec<f32> = part.iter().map(|sample| sample.2 as f32).collect();
    let top = values.len() * 4 / 5;
    let bright = *values.select_nth_unstable_by(top, f32::total_cmp).1;
    let surface = background::through(&part, bright)?;
    let share = |(u, v, value): &(f64, f64, f64), surface: &Surface| value / surface.at(*u, *v).max(1e-6);
    let surface = {
        let near = samples.iter().filter(|sample| (0.85..1.2).contains(&share(sample, &surface)));
        let near: Vec<_> = near.copied().collect();
        if near.len() < 3 * FEWEST {
            return None;
        }
        background::fit(&near, &vec![1.0; near.len()])?
    };
    let even = surface.on_grid();
    let darkest = even.iter().fold(f32::INFINITY, |a, b| a.min(*b));
    let width = 0.12 * (1.0 - level);
    let (mut inside, mut off) = (Vec::new(), Vec::new());
    for sample in &samples {
        let value = share(sample, &surface) as f32;
        if (value - level).abs() < width {
            inside.push(value);
        } else if (0.85..1.2).contains(&value) {
            off.push((value - 1.0).abs());
        }
    }
    if inside.len() < FEWEST || off.len() < FEWEST || darkest < 0.02 {
        return None;
    }
    let inside = median(&mut inside)?;
    let noise = 1.4826 * median(&mut off)? / (1.0 - inside).max(0.02);
    // No noise at all is a mask: its places within a pixel are not known.
    (noise > 1e-4 && 1.0 - inside > super::LEAST_CONTRAST).then(|| Sparse {
        surface,
        inside,
        noise,
        scale: [2.0 / w as f64, 2.0 / h as f64],
        gain: 1.0 / (1.0 - f64::from(inside)),
    })
}

impl Sparse {
    /// Return the share of a pixel's place that the pattern covers, not cut off at 0 and 1; `None` outside the image.
    #[inline]
    pub fn coverage(&self, light: &Raster, x: f64, y: f64) -> Option<f64> {
        let value = light.sample(x, y)?;
        let (u, v) = ((x + 0.5) * self.scale[0] - 1.0, (y + 0.5) * self.scale[1] - 1.0);
        Some((1.0 - value / self.surface.at(u, v)) * self.gain)
    }
}
