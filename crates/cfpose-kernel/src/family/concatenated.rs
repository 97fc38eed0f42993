//! Several families, one after the other, each with a weight.

use num_dual::HyperDual64;

use super::{BasisRows, DynFamily, GradientTerm, Segment};
use crate::isa::Isa;
use crate::map::MapBlock;

/// A weighted concatenation of families: the features of the first, times its weight, then those of the second, ...
///
/// A weight multiplies the features, so it multiplies their share of the cost by its square. Each part keeps its own fast path.
///
/// ```
/// use cfpose_kernel::family::polynomial::{Polynomial, Products};
/// use cfpose_kernel::family::{Concatenated, DynFamily, General};
/// // The monomials x, and x and x^2.
/// let rows = vec![vec![1.0], vec![0.0, 1.0], vec![0.0, 0.0, 1.0]];
/// let part = |degree: usize| Box::new(General(Polynomial::new(rows[..=degree].to_vec(), Products::Total)));
/// let both = Concatenated::new(vec![(1.0, part(1)), (2.0, part(2))]);
/// assert_eq!(both.features(&[3.0]), vec![3.0, 6.0, 18.0]);
/// ```
pub struct Concatenated {
    parts: Vec<(f64, Box<dyn DynFamily>)>,
}

impl Concatenated {
    /// Concatenate families with their weights.
    pub fn new(parts: Vec<(f64, Box<dyn DynFamily>)>) -> Self {
        Self { parts }
    }

    /// Call `work` with each part and its range of basis functions.
    fn each(&self, dim: usize, mut work: impl FnMut(&dyn DynFamily, std::ops::Range<usize>)) {
        let mut start = 0;
        for (_, family) in &self.parts {
            let end = start + family.num_basis(dim);
            work(family.as_ref(), start..end);
            start = end;
        }
    }
}

impl DynFamily for Concatenated {
    fn supports(&self, dim: usize) -> bool {
        self.parts.iter().all(|(_, family)| family.supports(dim))
    }

    fn num_basis(&self, dim: usize) -> usize {
        self.parts.iter().map(|(_, family)| family.num_basis(dim)).sum()
    }

    fn per_coordinate(&self) -> Option<usize> {
        None
    }

    fn segments(&self, dim: usize) -> Vec<Segment> {
        self.parts.iter().flat_map(|(_, family)| family.segments(dim)).collect()
    }

    fn coefficients(&self, dim: usize) -> Option<Vec<f64>> {
        let matrices: Vec<Option<Vec<f64>>> = self.parts.iter().map(|(_, family)| family.coefficients(dim)).collect();
        if matrices.iter().all(Option::is_none) && self.parts.iter().all(|(weight, _)| *weight == 1.0) {
            return None;
        }
        // One block a part on the diagonal.
        let width = self.num_basis(dim);
        let mut full = Vec::new();
        let mut start = 0;
        for ((weight, family), matrix) in self.parts.iter().zip(matrices) {
            let num = family.num_basis(dim);
            let rows = matrix.as_ref().map_or(num, |c| c.len() / num);
            for i in 0..rows {
                let mut row = vec![0.0; width];
                match &matrix {
                    None => row[start + i] = *weight,
                    Some(c) => {
                        for (entry, value) in row[start..start + num].iter_mut().zip(&c[i * num..(i + 1) * num]) {
                            *entry = weight * value;
                        }
                    }
                }
                full.extend(row);
            }
            start += num;
        }
        Some(full)
    }

    /// Closed under differentiation where every part is.
    fn gradient_terms(&self, dim: usize) -> Option<Vec<GradientTerm>> {
        let (mut all, mut start) = (Vec::new(), 0);
        for (_, family) in &self.parts {
            let moved =
                |term: GradientTerm| GradientTerm { function: start + term.function, of: start + term.of, ..term };
            all.extend(family.gradient_terms(dim)?.into_iter().map(moved));
            start += family.num_basis(dim);
        }
        Some(all)
    }

    fn block(&self, isa: Isa, points: &MapBlock, out: BasisRows<'_>) {
        let mut rest = out;
        for (_, family) in &self.parts {
            let (own, others) = rest.split(family.as_ref(), points.x.len());
            family.block(isa, points, own);
            rest = others;
        }
    }

    fn values(&self, x: &[f64], out: &mut [f64]) {
        self.each(x.len(), |family, range| family.values(x, &mut out[range]));
    }

    fn hyper(&self, x: &[HyperDual64], out: &mut [HyperDual64]) {
        self.each(x.len(), |family, range| family.hyper(x, &mut out[range]));
    }

    fn blur_hyper(&self, dim: usize, covariance: &[HyperDual64], means: &mut [HyperDual64]) -> bool {
        let mut blurred = means.to_vec();
        let mut all = true;
        self.each(dim, |family, range| all = all && family.blur_hyper(dim, covariance, &mut blurred[range]));
        if all {
            means.copy_from_slice(&blurred);
        }
        all
    }
}
