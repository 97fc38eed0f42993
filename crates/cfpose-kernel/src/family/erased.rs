//! The adapters that erase families.

use num_dual::HyperDual64;
use pulp::{Simd, WithSimd};

use super::{BasisRows, DynFamily, Family, GradientTerm, SeparableFamily};
use crate::isa::Isa;
use crate::jet::Jet;
use crate::lane::Lane;
use crate::map::MapBlock;
use crate::points::BLOCK;
use crate::scalar::Scalar;

/// Basis sizes up to this one use a buffer on the stack.
const SMALL: usize = 16;

/// Vectors on a cache-line boundary: pulp's own types are aligned to 8 bytes only.
#[repr(align(64))]
struct Aligned<T>(T);

/// Return a buffer of `len` numbers, on the stack where it is small.
///
/// No closure takes it: a closure is a function of its own, compiled without the instruction set of its caller.
#[inline(always)]
fn pick<'b, N: Copy>(small: &'b mut Aligned<[N; SMALL]>, large: &'b mut Vec<N>, len: usize) -> &'b mut [N] {
    if len <= SMALL {
        return &mut small.0[..len];
    }
    large.resize(len, small.0[0]);
    large
}

/// Erase a [`SeparableFamily`].
pub struct Separable<F>(pub F);

impl<F: SeparableFamily> DynFamily for Separable<F> {
    fn supports(&self, _dim: usize) -> bool {
        true
    }

    fn num_basis(&self, dim: usize) -> usize {
        dim * self.0.num_basis()
    }

    fn per_coordinate(&self) -> Option<usize> {
        Some(self.0.num_basis())
    }

    fn coefficients(&self, dim: usize) -> Option<Vec<f64>> {
        // Rows are blocks per coordinate, features have the coordinate fastest: C places one into the other.
        let num = self.0.num_basis();
        let single = self
            .0
            .coefficients()
            .unwrap_or_else(|| (0..num * num).map(|index| f64::from(u8::from(index / num == index % num))).collect());
        assert!(
            num > 0 && single.len().is_multiple_of(num),
            "{} coefficients are no whole rows of {num}",
            single.len()
        );
        let functions = single.len() / num;
        let width = dim * num;
        let mut full = vec![0.0; functions * dim * width];
        for i in 0..functions {
            for q in 0..dim {
                let row = (i * dim + q) * width;
                full[row + q * num..row + (q + 1) * num].copy_from_slice(&single[i * num..(i + 1) * num]);
            }
        }
        Some(full)
    }

    fn block(&self, isa: Isa, points: &MapBlock, out: BasisRows<'_>) {
        isa.run(SeparableBlock { family: &self.0, points, out });
    }

    fn values(&self, x: &[f64], out: &mut [f64]) {
        let num = self.0.num_basis();
        for (value, part) in x.iter().zip(out.chunks_exact_mut(num)) {
            self.0.basis(*value, part);
        }
    }

    fn hyper(&self, x: &[HyperDual64], out: &mut [HyperDual64]) {
        let num = self.0.num_basis();
        for (value, part) in x.iter().zip(out.chunks_exact_mut(num)) {
            self.0.basis(*value, part);
        }
    }

    fn blur_hyper(&self, dim: usize, covariance: &[HyperDual64], means: &mut [HyperDual64]) -> bool {
        let num = self.0.num_basis();
        let mut diagonal = 0;
        for (q, part) in means.chunks_exact_mut(num).enumerate() {
            if !self.0.blur(covariance[diagonal], part) {
                return false;
            }
            diagonal += dim - q;
        }
        true
    }
}

/// The work of a separable family on one block, compiled for each instruction set.
struct SeparableBlock<'a, F> {
    family: &'a F,
    points: &'a MapBlock,
    out: BasisRows<'a>,
}

impl<F: SeparableFamily> WithSimd for SeparableBlock<'_, F> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let num = self.family.num_basis();
        let zero = Lane::splat(simd, 0.0);
        if self.out.gradient.is_empty() {
            let (mut small, mut large) = (Aligned([zero; SMALL]), Vec::new());
            let buffer = pick(&mut small, &mut large, num);
            for (q, x) in self.points.x.iter().enumerate() {
                for lane in (0..BLOCK).step_by(S::F64_LANES) {
                    self.family.basis(Lane::load(simd, &x.0[lane..]), buffer);
                    for i in 0..num {
                        buffer[i].store(&mut self.out.value[q * num + i].0[lane..]);
                    }
                }
            }
            return;
        }
        let (mut small, mut large) = (Aligned([Jet::<S, 1>::fixed(zero); SMALL]), Vec::new());
        let buffer = pick(&mut small, &mut large, num);
        for (q, x) in self.points.x.iter().enumerate() {
            for lane in (0..BLOCK).step_by(S::F64_LANES) {
                self.family.basis(Jet::<S, 1>::variable(Lane::load(simd, &x.0[lane..]), 0), buffer);
                for i in 0..num {
                    buffer[i].re.store(&mut self.out.value[q * num + i].0[lane..]);
                    buffer[i].eps[0].store(&mut self.out.gradient[q * num + i].0[lane..]);
                }
            }
        }
    }
}

/// Erase a [`Family`].
pub struct General<F>(pub F);

/// Call a family's basis with an array of the length of a slice.
#[inline(always)]
fn basis_of_slice<F: Family, S: Scalar>(family: &F, x: &[S], out: &mut [S]) {
    match *x {
        [a] => family.basis([a], out),
        [a, b] => family.basis([a, b], out),
        [a, b, c] => family.basis([a, b, c], out),
        _ => unreachable!("feature spaces have 1 to 3 dimensions"),
    }
}

impl<F: Family> DynFamily for General<F> {
    fn supports(&self, dim: usize) -> bool {
        (1..=3).contains(&dim) && self.0.supports(dim)
    }

    fn num_basis(&self, dim: usize) -> usize {
        self.0.num_basis(dim)
    }

    fn per_coordinate(&self) -> Option<usize> {
        None
    }

    fn coefficients(&self, dim: usize) -> Option<Vec<f64>> {
        self.0.coefficients(dim)
    }

    fn monomials(&self, dim: usize) -> Option<&[[usize; 3]]> {
        self.0.monomials(dim)
    }

    fn gradient_terms(&self, dim: usize) -> Option<Vec<GradientTerm>> {
        self.0.gradient_terms(dim)
    }

    fn block(&self, isa: Isa, points: &MapBlock, out: BasisRows<'_>) {
        match points.x.len() {
            1 => isa.run(GeneralBlock::<F, 1> { family: &self.0, points, out }),
            2 => isa.run(GeneralBlock::<F, 2> { family: &self.0, points, out }),
            _ => isa.run(GeneralBlock::<F, 3> { family: &self.0, points, out }),
        }
    }

    fn values(&self, x: &[f64], out: &mut [f64]) {
        basis_of_slice(&self.0, x, out);
    }

    fn hyper(&self, x: &[HyperDual64], out: &mut [HyperDual64]) {
        basis_of_slice(&self.0, x, out);
    }

    fn blur_hyper(&self, dim: usize, covariance: &[HyperDual64], means: &mut [HyperDual64]) -> bool {
        self.0.blur(dim, covariance, means)
    }
}

/// The work of a general family on one block, compiled for each instruction set and dimension.
struct GeneralBlock<'a, F, const D: usize> {
    family: &'a F,
    points: &'a MapBlock,
    out: BasisRows<'a>,
}

impl<F: Family, const D: usize> WithSimd for GeneralBlock<'_, F, D> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let num = self.family.num_basis(D);
        let zero = Lane::splat(simd, 0.0);
        if self.out.gradient.is_empty() {
            let (mut small, mut large) = (Aligned([zero; SMALL]), Vec::new());
            let buffer = pick(&mut small, &mut large, num);
            for lane in (0..BLOCK).step_by(S::F64_LANES) {
                let mut x = [zero; D];
                for q in 0..D {
                    x[q] = Lane::load(simd, &self.points.x[q].0[lane..]);
                }
                self.family.basis(x, buffer);
                for i in 0..num {
                    buffer[i].store(&mut self.out.value[i].0[lane..]);
                }
            }
            return;
        }
        let (mut small, mut large) = (Aligned([Jet::<S, D>::fixed(zero); SMALL]), Vec::new());
        let buffer = pick(&mut small, &mut large, num);
        for lane in (0..BLOCK).step_by(S::F64_LANES) {
            let mut x = [Jet::<S, D>::fixed(zero); D];
            for q in 0..D {
                x[q] = Jet::variable(Lane::load(simd, &self.points.x[q].0[lane..]), q);
            }
            self.family.basis(x, buffer);
            for i in 0..num {
                buffer[i].re.store(&mut self.out.value[i].0[lane..]);
                for q in 0..D {
                    buffer[i].eps[q].store(&mut self.out.gradient[i * D + q].0[lane..]);
                }
            }
        }
    }
}
