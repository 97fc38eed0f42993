//! What families of waves cos(w.x), sin(w.x) share: gradients and blur.

use cfpose_kernel::family::GradientTerm;
use cfpose_kernel::scalar::Scalar;

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
