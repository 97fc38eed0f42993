//! What families of waves cos(w.x), sin(w.x) share: waves of any frequencies, gradients and blur.

use cfpose_kernel::family::{Family, GradientTerm};
use cfpose_kernel::scalar::Scalar;

/// All cosines, then all sines, of w.x for a list of frequencies w.
pub struct Waves {
    frequencies: Vec<[f64; 3]>,
    /// Factor of both waves of a frequency; none: 1.
    amplitudes: Option<Vec<f64>>,
    /// The only dimension, where there is one.
    dim: Option<usize>,
}

impl Waves {
    /// Make waves of frequencies, rad per unit; coordinates beyond the dimension of the feature space are not used.
    pub fn new(frequencies: Vec<[f64; 3]>) -> Self {
        Self { frequencies, amplitudes: None, dim: None }
    }

    /// Multiply both waves of each frequency by a factor.
    pub fn with_amplitudes(mut self, amplitudes: Vec<f64>) -> Self {
        self.amplitudes = Some(amplitudes);
        self
    }

    /// Exist in one dimension only.
    pub fn only_in(mut self, dim: usize) -> Self {
        self.dim = Some(dim);
        self
    }
}

impl Family for Waves {
    fn num_basis(&self, _dim: usize) -> usize {
        2 * self.frequencies.len()
    }

    #[inline(always)]
    fn basis<S: Scalar, const D: usize>(&self, x: [S; D], out: &mut [S]) {
        let (cosines, sines) = out.split_at_mut(self.frequencies.len());
        for i in 0..cosines.len() {
            let mut phase = x[0] * self.frequencies[i][0];
            for q in 1..D {
                phase = phase + x[q] * self.frequencies[i][q];
            }
            let (sine, cosine) = phase.sin_cos();
            cosines[i] = cosine;
            sines[i] = sine;
        }
    }

    /// The amplitudes on the diagonal.
    fn coefficients(&self, _dim: usize) -> Option<Vec<f64>> {
        let amplitudes = self.amplitudes.as_ref()?;
        let (count, num) = (amplitudes.len(), 2 * amplitudes.len());
        let mut matrix = vec![0.0; num * num];
        for i in 0..num {
            matrix[i * num + i] = amplitudes[i % count];
        }
        Some(matrix)
    }

    fn supports(&self, dim: usize) -> bool {
        self.dim.is_none_or(|only| only == dim)
    }

    fn blur<S: Scalar>(&self, dim: usize, covariance: &[S], means: &mut [S]) -> bool {
        blur_waves(&self.frequencies, dim, covariance, means);
        true
    }

    fn gradient_terms(&self, dim: usize) -> Option<Vec<GradientTerm>> {
        Some(wave_gradients(&self.frequencies, dim))
    }
}

/// grad cos(w.x) = -w sin(w.x) and grad sin(w.x) = w cos(w.x): all cosines first, then all sines.
pub fn wave_gradients(frequencies: &[[f64; 3]], dim: usize) -> Vec<GradientTerm> {
    let count = frequencies.len();
    let mut terms = Vec::with_capacity(2 * dim * count);
    for (i, w) in frequencies.iter().enumerate() {
        for q in 0..dim {
            terms.push(GradientTerm { function: i, q, of: count + i, factor: -w[q] });
            terms.push(GradientTerm { function: count + i, q, of: i, factor: w[q] });
        }
    }
    terms
}

/// E cos(w.(x + e)) = exp(-w' cov w / 2) cos(w.x), and the same for the sine: all cosines first, then all sines.
pub fn blur_waves<S: Scalar>(frequencies: &[[f64; 3]], dim: usize, covariance: &[S], means: &mut [S]) {
    for (i, w) in frequencies.iter().enumerate() {
        let mut quadratic = covariance[0] * 0.0;
        let mut entry = 0;
        for a in 0..dim {
            for b in a..dim {
                let twice = if a == b { 1.0 } else { 2.0 };
                quadratic = quadratic + covariance[entry] * (twice * w[a] * w[b]);
                entry += 1;
            }
        }
        let factor = (quadratic * -0.5).exp();
        means[i] = means[i] * factor;
        means[frequencies.len() + i] = means[frequencies.len() + i] * factor;
    }
}
