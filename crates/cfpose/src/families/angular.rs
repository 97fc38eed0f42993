//! Harmonics of the angle on the circle, for the epipolar model.

use cfpose_kernel::family::{Family, General};
use cfpose_kernel::scalar::Scalar;

use crate::entry::FamilyEntry;
use crate::entry::ParameterSpec;

/// Real and imaginary parts of z^n / n^decay, n = 1..=harmonics, z = x + i y.
struct Angular {
    /// n^-decay at [n - 1].
    factors: Vec<f64>,
}

/// Return the product of two complex numbers.
#[inline(always)]
fn times<S: Scalar>(a: (S, S), b: (S, S)) -> (S, S) {
    (a.0 * b.0 - a.1 * b.1, a.0 * b.1 + a.1 * b.0)
}

impl Family for Angular {
    fn num_basis(&self, _dim: usize) -> usize {
        2 * self.factors.len()
    }

    #[inline(always)]
    fn basis<S: Scalar, const D: usize>(&self, x: [S; D], out: &mut [S]) {
        let (cosines, sines) = out.split_at_mut(self.factors.len());
        let z = (x[0], if D > 1 { x[1] } else { x[0].constant(0.0) });
        let mut power = z;
        for n in 0..cosines.len() {
            cosines[n] = power.0 * self.factors[n];
            sines[n] = power.1 * self.factors[n];
            power = times(power, z);
        }
    }

    /// E (z + e)^n = sum_k n! / (k! (n - 2k)!) (kappa / 2)^k z^(n - 2k), kappa = E e^2 = cov_xx - cov_yy + 2 i cov_xy.
    fn blur<S: Scalar>(&self, dim: usize, covariance: &[S], means: &mut [S]) -> bool {
        if dim != 2 {
            return false;
        }
        let half_kappa = ((covariance[0] - covariance[2]) * 0.5, covariance[1]);
        let zero = means[0].constant(0.0);
        let mut powers = vec![(means[0].constant(1.0), zero)];
        let harmonics = self.factors.len();
        powers.extend((0..harmonics).map(|n| {
            let scale = self.factors[n].recip();
            (means[n] * scale, means[harmonics + n] * scale)
        }));
        for n in 1..=harmonics {
            let mut sum = (zero, zero);
            let mut factor = (zero + 1.0, zero);
            for k in 0..=n / 2 {
                if k > 0 {
                    // n! / (k! (n - 2k)!) from its predecessor.
                    let ratio = ((n - 2 * k + 2) * (n - 2 * k + 1)) as f64 / k as f64;
                    factor = times(factor, half_kappa);
                    factor = (factor.0 * ratio, factor.1 * ratio);
                }
                let term = times(factor, powers[n - 2 * k]);
                sum = (sum.0 + term.0, sum.1 + term.1);
            }
            means[n - 1] = sum.0 * self.factors[n - 1];
            means[harmonics + n - 1] = sum.1 * self.factors[n - 1];
        }
        true
    }

    fn supports(&self, dim: usize) -> bool {
        dim == 2
    }
}

pub(super) const ENTRY: FamilyEntry = FamilyEntry {
    name: "angular",
    summary: "harmonics cos(n phi), sin(n phi) of the angle of a point on the unit circle (2-D only)",
    parameters: &[
        ParameterSpec { name: "harmonics", default: "8", meaning: "number of harmonics, 1 to 64" },
        ParameterSpec { name: "decay", default: "1", meaning: "power of n by which harmonic n is divided, 0 to 4" },
    ],
    source: "Fourier series on the circle on which eq. 2dto2d lives; not in the paper",
    details: "All cosines, then all sines, of n phi for n = 1..harmonics, each divided by n^decay: real and imaginary part of (x + i y)^n, so off the unit circle each is multiplied by r^n. With decay 1 the unweighted cost is the squared distance of the cumulative distributions of the angles, which has a wide basin and still sees fine detail; with decay 0 many harmonics narrow the basin. Made for `epipolar` (normaliser `none`), whose points lie on the circle. From b = 0.1 and a random scene, 32 harmonics reach the truth (below 1e-5) from 95 of 100 starts with decay 1, 82 with decay 0, 75 with 8 harmonics of decay 0. Has a closed-form blur.",
    build: |parameters, _| {
        let harmonics = parameters.count("harmonics", 1, 64)?;
        let decay = parameters.number("decay", "a number from 0 to 4", |decay| (0.0..=4.0).contains(&decay))?;
        Ok(Box::new(General(Angular { factors: (1..=harmonics).map(|n| (n as f64).powf(-decay)).collect() })))
    },
};
