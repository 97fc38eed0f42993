//! Means of all monomials of mapped points from the moments of the points, over any number type.
//!
//! The plain form of the moment path: for derivatives of second order, and for degrees that the path does not reach.

use super::{Moments, monomial_family};
use crate::scalar::Scalar;

/// Return the means of the monomials of x = A p + b, by degree, then lexicographically, up to the degree of the moments; A is
/// `b.len()` x dim, row by row.
///
/// ```
/// use cfpose_kernel::{Execution, Points, moments::{Moments, mapped_means}};
/// let points = Points::from_rows(&[[1.0], [3.0]]).unwrap();
/// let moments = Moments::of_points(&points, 2, &Execution::default());
/// // x = 2 p - 1 is 1 and 5.
/// let means = mapped_means(&moments, &[2.0], &[-1.0]);
/// assert!(means.iter().zip([1.0_f64, 3.0, 13.0]).all(|(mean, value)| (mean - value).abs() < 1e-13));
/// ```
pub fn mapped_means<S: Scalar>(moments: &Moments, a: &[S], b: &[S]) -> Vec<S> {
    let (dim, degree) = (moments.dim, moments.degree);
    let family = monomial_family(degree);
    let exponents = family.exponents(dim);
    let zero = b[0].constant(0.0);
    // x = (s A) u + (b + A c) for p = c + s u.
    let mut offset = b.to_vec();
    let mut scaled = a.to_vec();
    for (row, entry) in a.chunks_exact(dim).zip(&mut offset) {
        for (value, centre) in row.iter().zip(&moments.centre) {
            *entry = *entry + *value * *centre;
        }
    }
    scaled.iter_mut().for_each(|value| *value = *value * moments.scale);
    let count = (0..=degree).map(|n| exponents.iter().filter(|e| e.iter().sum::<usize>() <= n).count()).collect();
    let above = |i: usize, k: usize| {
        let mut upper = exponents[i];
        upper[k] += 1;
        exponents.iter().position(|other| *other == upper).unwrap_or(0)
    };
    let upper = (0..exponents.len()).map(|i| (0..dim).map(|k| above(i, k)).collect()).collect();
    let out = monomial_family(degree).exponents(b.len()).to_vec();
    let level: Vec<S> = moments.values().iter().map(|value| zero + *value).collect();
    let mut walk = Walk { a: &scaled, b: &offset, dim, degree, count, upper, means: vec![zero; out.len()], out };
    walk.means[0] = level[0];
    walk.descend(&level, [0; 3], 0);
    walk.means
}

/// The recursion G_(f + 1_q)[a] = sum_k A_qk G_f[a + 1_k] + b_q G_f[a], where G_f[a] = mean of x^f u^a and G_0 are the moments.
struct Walk<'a, S> {
    a: &'a [S],
    b: &'a [S],
    dim: usize,
    degree: usize,
    /// How many exponents have at most this degree: a prefix of the list.
    count: Vec<usize>,
    /// Where exponent i with its k-th entry one higher stands.
    upper: Vec<Vec<usize>>,
    out: Vec<[usize; 3]>,
    means: Vec<S>,
}

impl<S: Scalar> Walk<'_, S> {
    /// Visit every monomial below x^f whose further factors are x_q, q >= `from`; `level` is G_f.
    fn descend(&mut self, level: &[S], f: [usize; 3], from: usize) {
        let depth: usize = f.iter().sum();
        if depth == self.degree {
            return;
        }
        for q in from..self.b.len() {
            let mut product = f;
            product[q] += 1;
            let next: Vec<S> = (0..self.count[self.degree - depth - 1])
                .map(|i| {
                    let row = &self.a[q * self.dim..(q + 1) * self.dim];
                    let terms = row.iter().zip(&self.upper[i]);
                    terms.fold(self.b[q] * level[i], |sum, (factor, at)| sum + *factor * level[*at])
                })
                .collect();
            if let Some(at) = self.out.iter().position(|other| *other == product) {
                self.means[at] = next[0];
            }
            self.descend(&next, product, q);
        }
    }
}
