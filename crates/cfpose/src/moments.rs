//! Moments: with polynomial features of an affine model the points are needed only once.
//!
//! For x = A u + b every mean of a monomial of x is a polynomial in (A, b) whose coefficients are the moments of u. The moments are
//! summed in one pass (additive over shards, constant memory); then residual and Jacobian cost the same for any number of points.
//!
//! Numerics: u is centred and scaled to unit spread, and the recursion below never forms large powers of A.

use crate::block::{DynMap, FactoredFacts, LiftedPoints, PreparedMap, Transform};
use crate::families::polynomial::{Polynomial, Products};
use crate::family::General;
use crate::isa::Isa;
use crate::means::{Execution, Means, Side, Sums};
use crate::model::Identity;

/// Monomials of `dim` variables up to a degree, by degree, then lexicographically, with successors.
#[derive(Debug, Clone)]
struct Monomials {
    exponents: Vec<[usize; 3]>,
    /// `successor[k][a]` is the index of monomial a times variable k, for a below the top degree.
    successor: Vec<Vec<usize>>,
    /// `count[d]` monomials have degree <= d: prefixes of the list.
    count: Vec<usize>,
}

impl Monomials {
    fn new(exponents: &[[usize; 3]], dim: usize, degree: usize) -> Self {
        let total = |e: &[usize; 3]| e.iter().sum::<usize>();
        let count: Vec<usize> = (0..=degree).map(|d| exponents.iter().filter(|e| total(e) <= d).count()).collect();
        let below = degree.checked_sub(1).map_or(0, |d| count[d]);
        let successor = (0..dim)
            .map(|k| {
                let next = |e: &[usize; 3]| {
                    let mut next = *e;
                    next[k] += 1;
                    exponents.iter().position(|other| *other == next).unwrap_or(0)
                };
                exponents[..below].iter().map(next).collect()
            })
            .collect();
        Self { exponents: exponents.to_vec(), successor, count }
    }
}

/// Return the family of all monomials up to a degree.
fn monomial_family(degree: usize) -> Polynomial {
    let rows = (0..=degree).map(|n| (0..=n).map(|k| f64::from(u8::from(k == n))).collect()).collect();
    Polynomial::new(rows, Products::Total)
}

/// Moments sum w u^a / sum w of centred, scaled lifted points u = (lifted - centre) / scale.
///
/// ```
/// use cfpose::{Execution, Points, moments::Moments};
/// let cloud = Points::from_rows(&[[1.0, 0.0], [3.0, 2.0], [5.0, 1.0]]).unwrap();
/// let moments = Moments::of_points(&cloud, 4, &Execution::default());
/// let (first, second) = (cloud.select(&[0]).unwrap(), cloud.select(&[1, 2]).unwrap());
/// let mut merged = Moments::like(&moments, &first, &Execution::default());
/// merged.merge(&Moments::like(&moments, &second, &Execution::default()));
/// for (a, b) in merged.values().iter().zip(moments.values()) {
///     assert!((a - b).abs() < 1e-14);
/// }
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Moments {
    dim: usize,
    degree: usize,
    centre: [f64; 3],
    scale: f64,
    weight: f64,
    sums: Vec<f64>,
}

impl Moments {
    /// Sum the moments of a point set up to a degree, centred at its mean and scaled by its spread.
    pub fn of_points(points: &crate::Points, degree: usize, execution: &Execution) -> Self {
        let columns = (0..points.dim()).map(|d| points.padded_column(d).to_vec()).collect();
        let lifted = LiftedPoints { len: points.len(), columns, weights: points.padded_weights().to_vec() };
        Self::of_lifted(&lifted, degree, execution)
    }

    /// Sum the moments of other points about the same centre and scale, so that both can be merged: one pass per shard.
    pub fn like(other: &Self, points: &crate::Points, execution: &Execution) -> Self {
        let columns = (0..points.dim()).map(|d| points.padded_column(d).to_vec()).collect();
        let lifted = LiftedPoints { len: points.len(), columns, weights: points.padded_weights().to_vec() };
        Self::about(&lifted, other.degree, other.centre, other.scale, execution)
    }

    pub(crate) fn of_lifted(points: &LiftedPoints, degree: usize, execution: &Execution) -> Self {
        let dim = points.columns.len();
        let first = Self::about(points, 2.min(degree), [0.0; 3], 1.0, execution);
        // Centre and scale need a few digits only; the moments about them are exact whatever they are.
        let values = first.values();
        let table = Monomials::new(monomial_family(first.degree).exponents(dim), dim, first.degree);
        let at = |e: [usize; 3]| table.exponents.iter().position(|other| *other == e).map_or(0.0, |i| values[i]);
        let unit = |k: usize, n: usize| std::array::from_fn(|q| if q == k { n } else { 0 });
        let mut centre = [0.0; 3];
        let mut spread = 0.0_f64;
        for (k, entry) in centre.iter_mut().enumerate().take(dim) {
            *entry = at(unit(k, 1));
            spread += (at(unit(k, 2)) - *entry * *entry).max(0.0);
        }
        let scale = (spread / dim as f64).sqrt();
        Self::about(points, degree, centre, if scale > 0.0 && scale.is_finite() { scale } else { 1.0 }, execution)
    }

    fn about(points: &LiftedPoints, degree: usize, centre: [f64; 3], scale: f64, execution: &Execution) -> Self {
        let dim = points.columns.len();
        let inverse = 1.0 / scale;
        let matrix = std::array::from_fn(|i| std::array::from_fn(|j| if i == j { inverse } else { 0.0 }));
        let family = General(monomial_family(degree));
        let map: Box<dyn DynMap> = match dim {
            1 => Box::new(crate::block::Factored::<_, 1, 1, 1>::new(Identity)),
            2 => Box::new(crate::block::Factored::<_, 2, 2, 2>::new(Identity)),
            _ => Box::new(crate::block::Factored::<_, 3, 3, 3>::new(Identity)),
        };
        let prepared = map.prepare(&[0.0], &[], 0);
        let transform = Transform::new(centre, matrix);
        let Sums { weight, value, .. } =
            Side { map: map.as_ref(), prepared, transform: &transform, points, family: &family }.sums(execution);
        Self { dim, degree, centre, scale, weight, sums: value }
    }

    /// Add the moments of other points.
    ///
    /// # Panics
    /// When centre, scale, degree or dimension differ: make both with [`Moments::like`].
    pub fn merge(&mut self, other: &Self) {
        assert!(
            (self.dim, self.degree, self.centre, self.scale) == (other.dim, other.degree, other.centre, other.scale),
            "moments about different centres cannot be added; make them with Moments::like"
        );
        self.weight += other.weight;
        self.sums.iter_mut().zip(&other.sums).for_each(|(a, b)| *a += b);
    }

    /// Return the moments (means), ordered by degree, then lexicographically.
    pub fn values(&self) -> Vec<f64> {
        self.sums.iter().map(|sum| sum / self.weight).collect()
    }
}

/// One term of the derivative of a monomial: e_q x^(e - 1_q).
#[derive(Debug, Clone, Copy)]
struct Term {
    lower: usize,
    q: usize,
    factor: f64,
}

/// The moment path of one side: family basis monomials as polynomials in (A, b).
#[derive(Debug, Clone)]
pub(crate) struct MomentPath {
    moments: Vec<f64>,
    centre: [f64; 3],
    scale: f64,
    table: Monomials,
    /// Basis monomials of the family: parent, coordinate, degree, and where their array of products with u starts.
    parents: Vec<(usize, usize)>,
    length: Vec<usize>,
    start: Vec<usize>,
    terms: Vec<Vec<Term>>,
    /// Index of the monomial u_k.
    unit: [usize; 3],
    facts: FactoredFacts,
    dim: usize,
}

impl MomentPath {
    /// Sum the moments if model side and family allow it: identity projection, at most three lifted coordinates, constant
    /// density, polynomial basis.
    pub fn new(
        map: &dyn DynMap,
        family_monomials: Option<&[[usize; 3]]>,
        points: &LiftedPoints,
        execution: &Execution,
    ) -> Option<Self> {
        let facts = map.factored()?;
        let exponents = family_monomials?;
        if !facts.identity_projection || facts.lift_len > 3 || facts.rows != map.dim() || facts.has_density {
            return None;
        }
        let degree = exponents.iter().map(|e| e.iter().sum::<usize>()).max()?;
        let moments = Moments::of_lifted(points, degree, execution);
        let table = Monomials::new(monomial_family(degree).exponents(facts.lift_len), facts.lift_len, degree);
        let place = |e: &[usize; 3]| exponents.iter().position(|other| other == e);
        let (mut parents, mut length, mut start, mut terms) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        let mut next = 0;
        for e in exponents {
            let mut lower_terms = Vec::new();
            for q in 0..3 {
                if e[q] > 0 {
                    let mut lower = *e;
                    lower[q] -= 1;
                    lower_terms.push(Term { lower: place(&lower)?, q, factor: e[q] as f64 });
                }
            }
            parents.push(lower_terms.last().map_or((0, 0), |term| (term.lower, term.q)));
            terms.push(lower_terms);
            length.push(table.count[degree - e.iter().sum::<usize>()]);
            start.push(next);
            next += length[length.len() - 1];
        }
        let unit_exponent = |k: usize| std::array::from_fn(|q| usize::from(q == k));
        let unit = [0, 1, 2].map(|k| table.exponents.iter().position(|e| *e == unit_exponent(k)).unwrap_or(0));
        Some(Self {
            moments: moments.values(),
            centre: moments.centre,
            scale: moments.scale,
            table,
            parents,
            length,
            start,
            terms,
            unit,
            facts,
            dim: map.dim(),
        })
    }

    /// Return the means of the basis and their derivatives at a prepared theta.
    pub fn means(&self, prepared: &PreparedMap, transform: &Transform, isa: Isa) -> Means {
        let (k_len, m) = (self.facts.lift_len, prepared.tangent);
        let (matrix, mean) = (transform.matrix(), transform.mean());
        // x = T (A (c + s u) + b - mu) = (s T A) u + T (b + A c - mu); columns k_len + 1 of each row q.
        let fold = |a: &[f64], b: &[f64], shift: &[f64; 3], out: &mut [f64]| {
            for r in 0..self.dim {
                let row = &a[r * k_len..(r + 1) * k_len];
                let mut offset = b[r] - shift[r];
                for k in 0..k_len {
                    offset += row[k] * self.centre[k];
                }
                for q in 0..self.dim {
                    let t = matrix[q][r];
                    for k in 0..k_len {
                        out[q * 4 + k] += t * row[k] * self.scale;
                    }
                    out[q * 4 + 3] += t * offset;
                }
            }
        };
        let mut affine = [0.0; 12];
        fold(&prepared.a, &prepared.b, &mean, &mut affine);
        // Derivatives transposed: slopes[(q * 4 + column) * m + j].
        let mut slopes = vec![0.0; 12 * m];
        let size = self.facts.rows * k_len;
        for j in 0..m {
            let mut direction = [0.0; 12];
            let a = &prepared.da[j * size..(j + 1) * size];
            let b = &prepared.db[j * self.facts.rows..(j + 1) * self.facts.rows];
            fold(a, b, &[0.0; 3], &mut direction);
            for (entry, value) in direction.iter().enumerate() {
                slopes[entry * m + j] = *value;
            }
        }
        isa.run(Recursion { path: self, affine: &affine, slopes: &slopes, tangent: m })
    }
}

/// The recursion G_(f + 1_q)[a] = sum_k A_qk G_f[a + 1_k] + b_q G_f[a], where G_f[a] = mean of x^f u^a and G_0 are the moments.
struct Recursion<'a> {
    path: &'a MomentPath,
    affine: &'a [f64; 12],
    slopes: &'a [f64],
    tangent: usize,
}

impl pulp::WithSimd for Recursion<'_> {
    type Output = Means;

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _simd: S) -> Means {
        let Self { path, affine, slopes, tangent } = self;
        let num = path.parents.len();
        let k_len = path.facts.lift_len;
        let mut g = Vec::with_capacity(path.start[num - 1] + path.length[num - 1]);
        g.extend_from_slice(&path.moments[..path.length[0]]);
        for e in 1..num {
            let (parent, q) = path.parents[e];
            let row = &affine[q * 4..q * 4 + 4];
            let from = path.start[parent];
            for a in 0..path.length[e] {
                let mut sum = row[3] * g[from + a];
                for k in 0..k_len {
                    sum += row[k] * g[from + path.table.successor[k][a]];
                }
                g.push(sum);
            }
        }
        let values = path.start.iter().map(|start| g[*start]).collect();
        let mut jacobian = vec![0.0; num * tangent];
        if tangent > 0 {
            for (e, out) in jacobian.chunks_exact_mut(tangent).enumerate() {
                // d mean(x^e) = sum_q e_q (sum_k dA_qk mean(x^(e - 1_q) u_k) + db_q mean(x^(e - 1_q))).
                for term in &path.terms[e] {
                    let from = path.start[term.lower];
                    let slope = &slopes[term.q * 4 * tangent..(term.q * 4 + 4) * tangent];
                    for k in 0..k_len {
                        let factor = term.factor * g[from + path.unit[k]];
                        for j in 0..tangent {
                            out[j] += factor * slope[k * tangent + j];
                        }
                    }
                    let factor = term.factor * g[from];
                    for j in 0..tangent {
                        out[j] += factor * slope[3 * tangent + j];
                    }
                }
            }
        }
        Means { values, jacobian, tangent }
    }
}
