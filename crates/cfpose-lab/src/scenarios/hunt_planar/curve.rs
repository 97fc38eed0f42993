//! Closed and open curves without a name.

use std::f64::consts::TAU;

use rand::RngExt;
use rand_chacha::ChaCha12Rng;
use rand_distr::StandardNormal;

/// Steps of a curve's outline.
const STEPS: usize = 400;

/// A curve of size 1: its bounding box is centred, and the larger side is 1. z(t) = e^(i 2 pi s) + sum_(n = 2..=N) a n^-1.5 (g e^(in..) +
/// g' e^(-in..)) with complex normal g, where s runs over all of a closed curve and over 40 to 80 % of an open one (a third of
/// the draws); N is 3 to 7, a .15 to .5.
#[derive(Debug, Clone)]
pub(super) struct Curve {
    /// Frequency, real part, imaginary part.
    terms: Vec<(f64, f64, f64)>,
    span: f64,
    centre: [f64; 2],
    scale: f64,
    /// Length up to each step, of 1 in all.
    lengths: Vec<f64>,
}

impl Curve {
    /// Draw a curve.
    pub fn draw(rng: &mut ChaCha12Rng) -> Self {
        let (harmonics, amplitude) = (rng.random_range(3..=7), rng.random_range(0.15..0.5));
        let span = if rng.random::<f64>() < 1.0 / 3.0 { rng.random_range(0.4..0.8) } else { 1.0 };
        let mut terms = vec![(1.0, 1.0, 0.0)];
        for n in 2..=harmonics {
            let size = amplitude * f64::from(n).powf(-1.5);
            for frequency in [f64::from(n), -f64::from(n)] {
                let (re, im): (f64, f64) = (rng.sample(StandardNormal), rng.sample(StandardNormal));
                terms.push((frequency, size * re, size * im));
            }
        }
        let mut curve = Self { terms, span, centre: [0.0; 2], scale: 1.0, lengths: Vec::new() };
        let outline: Vec<[f64; 2]> = curve.outline().collect();
        let (low, high) = super::bounds(&outline);
        let size = (high[0] - low[0]).max(high[1] - low[1]);
        (curve.centre, curve.scale) = (std::array::from_fn(|d| 0.5 * (low[d] + high[d])), size.recip());
        let mut length = 0.0;
        let mut lengths = vec![0.0];
        for pair in outline.windows(2) {
            length += (pair[1][0] - pair[0][0]).hypot(pair[1][1] - pair[0][1]);
            lengths.push(length);
        }
        curve.lengths = lengths.iter().map(|l| l / length).collect();
        curve
    }

    /// Return the point at a parameter from 0 to 1.
    pub fn point(&self, t: f64) -> [f64; 2] {
        let mut z = [0.0; 2];
        for (frequency, re, im) in &self.terms {
            let (sin, cos) = (TAU * self.span * frequency * t).sin_cos();
            z[0] += re * cos - im * sin;
            z[1] += re * sin + im * cos;
        }
        std::array::from_fn(|d| self.scale * (z[d] - self.centre[d]))
    }

    /// Return the parameter at a share of the length.
    pub fn at_length(&self, share: f64) -> f64 {
        let k = self.lengths.partition_point(|length| *length <= share).clamp(1, STEPS);
        let (before, after) = (self.lengths[k - 1], self.lengths[k]);
        (k as f64 - 1.0 + (share - before) / (after - before)) / STEPS as f64
    }

    /// Return points along the curve.
    pub fn outline(&self) -> impl Iterator<Item = [f64; 2]> + '_ {
        (0..=STEPS).map(|k| self.point(k as f64 / STEPS as f64))
    }
}
