//! From the light of a scene to code values.

use rand::RngExt;
use rand_chacha::ChaCha12Rng;
use rand_distr::StandardNormal;

use super::Exposure;
use crate::picture::Picture;
use crate::raster::Raster;

/// Apply gradient, motion, defocus, noise and transfer function, in this order.
pub(super) fn expose(mut light: Raster, exposure: &Exposure, rng: &mut ChaCha12Rng) -> Picture {
    let (w, h) = (light.width(), light.height());
    if exposure.gradient != 0.0 {
        let (sine, cosine) = rng.random_range(0.0..std::f64::consts::TAU).sin_cos();
        for y in 0..h {
            for (x, value) in light.row_mut(y).iter_mut().enumerate() {
                let along = (x as f64 + 0.5) / w as f64 * 2.0 - 1.0;
                let down = (y as f64 + 0.5) / h as f64 * 2.0 - 1.0;
                *value *= (1.0 + exposure.gradient * (along * cosine + down * sine)).max(0.0) as f32;
            }
        }
    }
    if exposure.motion > 0.0 {
        light = moved(&light, exposure.motion, rng.random_range(0.0..std::f64::consts::PI));
    }
    if exposure.blur > 0.0 {
        light = light.gaussian(exposure.blur);
    }
    let codes: Vec<u8> = light
        .values()
        .iter()
        .map(|value| {
            let noise: f64 = rng.sample(StandardNormal);
            let lit = f64::from(*value) * exposure.gain + exposure.noise * noise;
            (exposure.transfer.code((lit / 255.0).clamp(0.0, 1.0) as f32) * 255.0).round() as u8
        })
        .collect();
    Picture::from_grey(w, h, &codes).unwrap_or_else(|| unreachable!("one code a pixel"))
}

/// Average along a straight line of a length at an angle; values are repeated beyond the border.
fn moved(light: &Raster, length: f64, angle: f64) -> Raster {
    let count = (4.0 * length).ceil() as i32 + 1;
    let (sine, cosine) = angle.sin_cos();
    let mut taps = std::collections::BTreeMap::<(i32, i32), f64>::new();
    for k in 0..count {
        let s = (f64::from(k) / f64::from(count - 1) - 0.5) * length;
        let (x, y) = (s * cosine, s * sine);
        let (u, v) = (x - x.floor(), y - y.floor());
        for (dx, dy, weight) in
            [(0, 0, (1.0 - u) * (1.0 - v)), (1, 0, u * (1.0 - v)), (0, 1, (1.0 - u) * v), (1, 1, u * v)]
        {
            *taps.entry((x.floor() as i32 + dx, y.floor() as i32 + dy)).or_default() += weight / f64::from(count);
        }
    }
    let (w, h) = (light.width() as i32, light.height() as i32);
    let mut out = Raster::filled(light.width(), light.height(), 0.0);
    for y in 0..h {
        for ((dx, dy), weight) in &taps {
            let source = light.row((y + dy).clamp(0, h - 1) as usize);
            let weight = *weight as f32;
            for (x, value) in out.row_mut(y as usize).iter_mut().enumerate() {
                *value += weight * source[(x as i32 + dx).clamp(0, w - 1) as usize];
            }
        }
    }
    out
}
