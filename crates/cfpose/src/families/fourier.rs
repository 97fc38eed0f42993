//! The empirical characteristic function: cos(w.x) and sin(w.x) on a lattice of frequencies.

use cfpose_kernel::family::{Family, General, GradientTerm};
use cfpose_kernel::scalar::Scalar;

use super::shared::waves::{blur_waves, wave_gradients};
use crate::entry::FamilyEntry;
use crate::entry::ParameterSpec;

/// Largest |k| of the lattice.
const MAX_K: usize = 8;

/// The modes k and k' = k with its last nonzero entry negated, as products of a parent and a power of one axis.
#[derive(Debug, Clone, Copy)]
struct Pair {
    /// Mode without that last entry.
    parent: usize,
    /// Mode n e_q of that last entry.
    axis: usize,
    /// Mode k.
    plus: usize,
    /// Mode k'.
    minus: usize,
}

/// Lattice of one dimension of the feature space.
#[derive(Debug, Clone)]
struct Lattice {
    /// Modes k of the half lattice (first nonzero entry positive), 0 < |k| <= K, by |k|^2, then lexicographically.
    modes: Vec<[i32; 3]>,
    /// Index of mode n e_q at [q][n - 1].
    axes: [[usize; MAX_K]; 3],
    /// All other modes, parents first.
    pairs: Vec<Pair>,
}

impl Lattice {
    fn new(dim: usize, k_max: usize) -> Self {
        let k = k_max as i32;
        let range = |q: usize| if q < dim { -k..=k } else { 0..=0 };
        let square = |m: &[i32; 3]| m.iter().map(|e| e * e).sum::<i32>();
        let mut modes: Vec<[i32; 3]> = Vec::new();
        for a in range(0) {
            for b in range(1) {
                for c in range(2) {
                    let mode = [a, b, c];
                    let first = mode.iter().find(|e| **e != 0);
                    if first.is_some_and(|e| *e > 0) && square(&mode) <= k * k {
                        modes.push(mode);
                    }
                }
            }
        }
        modes.sort_by_key(|mode| (square(mode), *mode));
        let place = |mode: [i32; 3]| modes.iter().position(|other| *other == mode).unwrap_or(0);
        let single = |q: usize, n: i32| {
            let mut mode = [0; 3];
            mode[q] = n;
            place(mode)
        };
        let mut axes = [[0; MAX_K]; 3];
        for (q, axis) in axes.iter_mut().enumerate().take(dim) {
            for (n, index) in axis.iter_mut().enumerate().take(k_max) {
                *index = single(q, n as i32 + 1);
            }
        }
        let mut pairs = Vec::new();
        for (plus, mode) in modes.iter().enumerate() {
            let Some(q) = (0..3).rev().find(|q| mode[*q] != 0) else { continue };
            let (mut parent, mut minus) = (*mode, *mode);
            parent[q] = 0;
            minus[q] = -mode[q];
            if mode[q] > 0 && parent != [0; 3] {
                pairs.push(Pair { parent: place(parent), axis: single(q, mode[q]), plus, minus: place(minus) });
            }
        }
        Self { modes, axes, pairs }
    }
}

/// Waves on the lattice w = w0 k, damped by exp(-h^2 |w|^2 / 2).
struct Fourier {
    lattices: [Lattice; 3],
    k_max: usize,
    w0: f64,
    /// exp(-h^2 (w0 n)^2 / 2) at [n - 1]: the damping of a mode is the product over its axes.
    damping: [f64; MAX_K],
}

impl Fourier {
    fn new(k_max: usize, w0: f64, width: f64) -> Self {
        let mut damping = [1.0; MAX_K];
        for (n, factor) in damping.iter_mut().enumerate() {
            let w = w0 * (n + 1) as f64;
            *factor = (-0.5 * width * width * w * w).exp();
        }
        Self { lattices: [1, 2, 3].map(|dim| Lattice::new(dim, k_max)), k_max, w0, damping }
    }

    /// Return w of each mode.
    fn frequencies(&self, dim: usize) -> Vec<[f64; 3]> {
        self.lattices[dim - 1].modes.iter().map(|mode| mode.map(|e| self.w0 * f64::from(e))).collect()
    }
}

impl Family for Fourier {
    fn num_basis(&self, dim: usize) -> usize {
        2 * self.lattices[dim - 1].modes.len()
    }

    /// One sine and cosine per axis; every other wave by angle addition, two modes from four products.
    #[inline(always)]
    fn basis<S: Scalar, const D: usize>(&self, x: [S; D], out: &mut [S]) {
        let lattice = &self.lattices[D - 1];
        let (cosines, sines) = out.split_at_mut(lattice.modes.len());
        for q in 0..D {
            let (sine, cosine) = (x[q] * self.w0).sin_cos();
            let (mut s, mut c) = (sine, cosine);
            for n in 0..self.k_max {
                if n > 0 {
                    // cos((n+1) a) and sin((n+1) a) from n a.
                    let next = c * cosine - s * sine;
                    s = s * cosine + c * sine;
                    c = next;
                }
                let index = lattice.axes[q][n];
                cosines[index] = c * self.damping[n];
                sines[index] = s * self.damping[n];
            }
        }
        for pair in &lattice.pairs {
            let (cp, sp) = (cosines[pair.parent], sines[pair.parent]);
            let (ca, sa) = (cosines[pair.axis], sines[pair.axis]);
            let (cc, ss, sc, cs) = (cp * ca, sp * sa, sp * ca, cp * sa);
            cosines[pair.plus] = cc - ss;
            sines[pair.plus] = sc + cs;
            cosines[pair.minus] = cc + ss;
            sines[pair.minus] = sc - cs;
        }
    }

    fn blur<S: Scalar>(&self, dim: usize, covariance: &[S], means: &mut [S]) -> bool {
        blur_waves(&self.frequencies(dim), dim, covariance, means);
        true
    }

    fn gradient_terms(&self, dim: usize) -> Option<Vec<GradientTerm>> {
        Some(wave_gradients(&self.frequencies(dim), dim))
    }
}

pub(super) const ENTRY: FamilyEntry = FamilyEntry {
    name: "fourier",
    summary: "cos(w.x) and sin(w.x) on a lattice of frequencies: the empirical characteristic function",
    parameters: &[
        ParameterSpec { name: "k", default: "3", meaning: "largest norm of the integer lattice vectors, 1 to 8" },
        ParameterSpec { name: "w0", default: "1.2", meaning: "lattice spacing, rad per unit of the feature space" },
        ParameterSpec {
            name: "damping",
            default: "0",
            meaning: "width h of the damping exp(-h^2 |w|^2 / 2), units of the feature space; 0: none",
        },
    ],
    source: "empirical characteristic function (Feuerverger and Mureika 1977); not in the paper",
    details: "All cosines, then all sines, of w.x for w = w0 k with integer vectors k, 0 < |k| <= K, first nonzero entry positive, ordered by |k|^2, then lexicographically; each times exp(-h^2 |w|^2 / 2). Anneal: small K first, then larger K with less damping. 4, 12 and 28 functions at K = 1, 2, 3 in two dimensions, 6, 32 and 122 in three (K = 4: 256). Has a closed-form blur.",
    build: |parameters, _| {
        let k_max = parameters.count("k", 1, MAX_K)?;
        let w0 = parameters.number("w0", "a positive number", |w| w > 0.0 && w.is_finite())?;
        let width = parameters.number("damping", "a number of at least 0", |h| h >= 0.0 && h.is_finite())?;
        Ok(Box::new(General(Fourier::new(k_max, w0, width))))
    },
};
