//! The moment path: means of polynomial features of an affine map from the moments of its points.

use pulp::{Simd, WithSimd};

use super::{Moments, monomial_family};
use crate::isa::Isa;
use crate::lane::Lane;
use crate::map::{DynMap, LiftedPoints, PreparedMap, Transform};
use crate::means::{Execution, Means};

/// Largest degree of the path: the polynomial families end there.
const MAX_DEGREE: usize = 8;
/// Tangent directions of one pass of the Jacobian.
const COLUMNS: usize = 8;

/// One row of moments: all exponents of the last coordinate for fixed exponents of the first two.
#[derive(Debug, Clone, Copy)]
struct MomentRow {
    /// Row with the first exponent one higher.
    first: usize,
    /// Row with the second exponent one higher.
    second: usize,
}

/// One step of the recursion: basis monomial `index` from its parent by a factor x_q.
#[derive(Debug, Clone, Copy)]
struct Step {
    index: usize,
    depth: usize,
    q: usize,
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
pub struct MomentPath {
    /// Moments of u, row by row, each padded.
    moments: Vec<f64>,
    centre: [f64; 3],
    scale: f64,
    degree: usize,
    rows: Vec<MomentRow>,
    /// `count[n]` rows hold the moments up to degree n: prefixes of the list.
    count: Vec<usize>,
    /// Basis monomials but the constant, each after its parent, depth first.
    steps: Vec<Step>,
    /// Derivative terms of monomial i: `terms[starts[i]..starts[i + 1]]`.
    terms: Vec<Term>,
    starts: Vec<usize>,
    lift_len: usize,
    dim: usize,
}

/// List rows by the sum of their two exponents, then by the second.
fn moment_rows(lift_len: usize, degree: usize) -> (Vec<[usize; 2]>, Vec<usize>) {
    let (mut rows, mut count) = (Vec::new(), Vec::new());
    for sum in 0..=degree {
        for second in 0..=sum {
            let first = sum - second;
            if (lift_len == 3 || first == 0) && (lift_len >= 2 || second == 0) {
                rows.push([first, second]);
            }
        }
        count.push(rows.len());
    }
    (rows, count)
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
        let (lift_len, degree) = Self::applies(map, family_monomials?)?;
        if points.columns.len() != lift_len {
            return None;
        }
        Self::of_moments(map, family_monomials?, &Moments::of_lifted(points, degree, execution))
    }

    /// Take the lifted length and the degree of a path that model side and family allow.
    fn applies(map: &dyn DynMap, exponents: &[[usize; 3]]) -> Option<(usize, usize)> {
        let facts = map.factored()?;
        if !facts.identity_projection || facts.lift_len > 3 || facts.rows != map.dim() || facts.has_density {
            return None;
        }
        let degree = exponents.iter().map(|e| e.iter().sum::<usize>()).max()?;
        (degree <= MAX_DEGREE && exponents[0] == [0; 3]).then_some((facts.lift_len, degree))
    }

    /// Make the path of moments that are there already, of the lifted points; `None` as in [`MomentPath::new`] and where the family
    /// has a higher degree than the moments.
    pub fn of_moments(map: &dyn DynMap, exponents: &[[usize; 3]], moments: &Moments) -> Option<Self> {
        let (lift_len, degree) = Self::applies(map, exponents)?;
        if moments.dim != lift_len || moments.degree < degree {
            return None;
        }
        let moments = moments.up_to(degree);
        let place = |e: &[usize; 3]| exponents.iter().position(|other| other == e);
        let (mut terms, mut starts) = (Vec::new(), vec![0]);
        for e in exponents {
            for q in (0..3).filter(|q| e[*q] > 0) {
                let mut lower = *e;
                lower[q] -= 1;
                terms.push(Term { lower: place(&lower)?, q, factor: e[q] as f64 });
            }
            starts.push(terms.len());
        }
        let (exponent_rows, count) = moment_rows(lift_len, degree);
        let width = if degree < 8 { 8 } else { 16 };
        let find = |row: [usize; 2]| exponent_rows.iter().position(|other| *other == row).unwrap_or(0);
        let rows = exponent_rows.iter().map(|[a, b]| MomentRow { first: find([a + 1, *b]), second: find([*a, b + 1]) });
        Some(Self {
            moments: arranged(&moments, &exponent_rows, width),
            centre: moments.centre,
            scale: moments.scale,
            degree,
            rows: rows.collect(),
            count,
            steps: depth_first(exponents),
            terms,
            starts,
            lift_len,
            dim: map.dim(),
        })
    }

    /// Return the means of the basis and their derivatives at a prepared theta.
    pub fn means(&self, prepared: &PreparedMap, transform: &Transform, isa: Isa) -> Means {
        let mut affine = [0.0; 12];
        self.fold(&prepared.a, &prepared.b, &transform.mean(), transform, &mut affine);
        let num = self.starts.len() - 1;
        let mut means =
            Means { values: vec![0.0; num], jacobian: vec![0.0; num * prepared.tangent], tangent: prepared.tangent };
        let (path, affine) = (self, &affine);
        // Rows of all levels together: (degree + 3 choose 3), one more a level and two at the end.
        match self.degree {
            0..=4 => isa.run(Recursion::<8, 42> { path, affine, prepared, transform, means: &mut means }),
            5..=7 => isa.run(Recursion::<8, 130> { path, affine, prepared, transform, means: &mut means }),
            _ => isa.run(Recursion::<16, 176> { path, affine, prepared, transform, means: &mut means }),
        }
        means
    }

    /// Write x = T (A (c + s u) + b - shift) = (s T A) u + T (b + A c - shift) as four numbers a coordinate: the coefficients of
    /// u in its last places, then the offset.
    #[inline(always)]
    fn fold(&self, a: &[f64], b: &[f64], shift: &[f64; 3], transform: &Transform, out: &mut [f64; 12]) {
        let first = 3 - self.lift_len;
        let matrix = transform.matrix();
        let mut plain = [[0.0; 4]; 3];
        for r in 0..self.dim {
            let row = &a[r * self.lift_len..(r + 1) * self.lift_len];
            plain[r][3] = b[r] - shift[r];
            for (k, value) in row.iter().enumerate() {
                plain[r][3] += value * self.centre[k];
                plain[r][first + k] = value * self.scale;
            }
        }
        for q in 0..self.dim {
            for k in 0..4 {
                out[q * 4 + k] = matrix[q][0] * plain[0][k] + matrix[q][1] * plain[1][k] + matrix[q][2] * plain[2][k];
            }
        }
    }
}

/// Put moments into padded rows; one more row keeps the shifted read of the last one inside.
fn arranged(moments: &Moments, exponent_rows: &[[usize; 2]], width: usize) -> Vec<f64> {
    let (dim, degree) = (moments.dim, moments.degree);
    let family = monomial_family(degree);
    let mut out = vec![0.0; (exponent_rows.len() + 1) * width];
    for (e, value) in family.exponents(dim).iter().zip(moments.values()) {
        // Coordinates fill the last places of (first, second, position in the row).
        let mut place = [0; 3];
        place[3 - dim..].copy_from_slice(&e[..dim]);
        if let Some(row) = exponent_rows.iter().position(|row| row[..] == place[..2]) {
            out[row * width + place[2]] = value;
        }
    }
    out
}

/// List all monomials but the constant so that each follows its parent (without the last nonzero coordinate's last power), the
/// descendants of one before the next.
fn depth_first(exponents: &[[usize; 3]]) -> Vec<Step> {
    let mut order: Vec<(Vec<usize>, usize)> = exponents
        .iter()
        .enumerate()
        .map(|(index, e)| ((0..3).flat_map(|q| std::iter::repeat_n(q, e[q])).collect(), index))
        .collect();
    // Words of factors in dictionary order: a word comes right before its continuations.
    order.sort();
    let step = |(word, index): &(Vec<usize>, usize)| Some(Step { index: *index, depth: word.len(), q: *word.last()? });
    order.iter().filter_map(step).collect()
}

/// The recursion G_(f + 1_q)[a] = sum_k A_qk G_f[a + 1_k] + b_q G_f[a], where G_f[a] = mean of x^f u^a and G_0 are the moments.
///
/// Depth first, so that one level of each degree is kept; a row of moments is one or two vectors, and a + 1_k is another row or
/// the same row read one place further.
struct Recursion<'a, const WIDTH: usize, const ROWS: usize> {
    path: &'a MomentPath,
    affine: &'a [f64; 12],
    prepared: &'a PreparedMap,
    transform: &'a Transform,
    means: &'a mut Means,
}

/// Levels of the recursion, on a cache-line boundary.
#[repr(align(64))]
struct Levels<const WIDTH: usize, const ROWS: usize>([[f64; WIDTH]; ROWS]);

impl<const WIDTH: usize, const ROWS: usize> WithSimd for Recursion<'_, WIDTH, ROWS> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let path = self.path;
        // (mean of x^f u_1, x^f u_2, x^f u_3, x^f) of each basis monomial f.
        let mut heads = [[0.0; 4]; ROWS];
        let mut levels = Levels::<WIDTH, ROWS>([[0.0; WIDTH]; ROWS]);
        let levels = levels.0.as_flattened_mut();
        levels[..path.moments.len()].copy_from_slice(&path.moments);
        // One row more than a level has, for the shifted read of its last row.
        let mut starts = [0; MAX_DEGREE + 2];
        for depth in 0..=path.degree {
            starts[depth + 1] = starts[depth] + (path.count[path.degree - depth] + 1) * WIDTH;
        }
        self.take_heads(levels, &mut heads[0]);
        for step in &path.steps {
            let count = path.count[path.degree - step.depth];
            let (before, after) = levels.split_at_mut(starts[step.depth]);
            let from = &before[starts[step.depth - 1]..];
            self.step(simd, step.q, &path.rows[..count], from, &mut after[..count * WIDTH]);
            self.take_heads(after, &mut heads[step.index]);
        }
        for (value, head) in self.means.values.iter_mut().zip(&heads) {
            *value = head[3];
        }
        let slopes = Slopes { path, prepared: self.prepared, transform: self.transform, heads: &heads };
        // Passes of fixed width: with a width known at run time only, copying a row costs more than summing it.
        let (mut first, jacobian) = (0, &mut self.means.jacobian);
        while first < self.prepared.tangent {
            first += match self.prepared.tangent - first {
                8.. => slopes.pass::<S, 8>(simd, first, jacobian),
                6.. => slopes.pass::<S, 6>(simd, first, jacobian),
                3.. => slopes.pass::<S, 3>(simd, first, jacobian),
                _ => slopes.pass::<S, 1>(simd, first, jacobian),
            };
        }
    }
}

impl<const WIDTH: usize, const ROWS: usize> Recursion<'_, WIDTH, ROWS> {
    /// Read the means of x^f u and of x^f; entries beyond the level's degree are never used.
    #[inline(always)]
    fn take_heads(&self, level: &[f64], head: &mut [f64; 4]) {
        let row = self.path.rows[0];
        *head = [level[row.first * WIDTH], level[row.second * WIDTH], level[1], level[0]];
    }

    /// Write one level from the one before it.
    #[inline(always)]
    fn step<S: Simd>(&self, simd: S, q: usize, rows: &[MomentRow], from: &[f64], out: &mut [f64]) {
        let mut factors = [Lane::splat(simd, 0.0); 4];
        for k in 0..4 {
            factors[k] = Lane::splat(simd, self.affine[q * 4 + k]);
        }
        // Arrays, not slices: their length is known, and the vectors inside need no check.
        let level = from.as_chunks::<WIDTH>().0;
        for (i, (row, out)) in rows.iter().zip(out.as_chunks_mut::<WIDTH>().0).enumerate() {
            let (own, first, second) = (&level[i], &level[row.first], &level[row.second]);
            // One place further; the last entry is the next row's, and no valid entry depends on it.
            let Some(further) = from[i * WIDTH + 1..].first_chunk::<WIDTH>() else { return };
            let mut lane = 0;
            while lane < WIDTH {
                let mut sum = factors[3] * Lane::load(simd, &own[lane..]);
                sum = factors[0].mul_add(Lane::load(simd, &first[lane..]), sum);
                sum = factors[1].mul_add(Lane::load(simd, &second[lane..]), sum);
                sum = factors[2].mul_add(Lane::load(simd, &further[lane..]), sum);
                sum.store(&mut out[lane..]);
                lane += S::F64_LANES;
            }
        }
    }
}

/// The derivatives, d mean(x^e) = sum_q e_q (sum_k dA_qk mean(x^(e - 1_q) u_k) + db_q mean(x^(e - 1_q))).
struct Slopes<'a> {
    path: &'a MomentPath,
    prepared: &'a PreparedMap,
    transform: &'a Transform,
    heads: &'a [[f64; 4]],
}

impl Slopes<'_> {
    /// Write the directions `first..first + N`, N at most [`COLUMNS`]; returns N.
    #[inline(always)]
    fn pass<S: Simd, const N: usize>(&self, simd: S, first: usize, jacobian: &mut [f64]) -> usize {
        let (path, prepared) = (self.path, self.prepared);
        // Direction c of coordinate q and column k at [q][k][c].
        let mut directions = [[[0.0; COLUMNS]; 4]; 3];
        let (size, num_rows) = (path.dim * path.lift_len, path.dim);
        for c in 0..N {
            let j = first + c;
            let mut direction = [0.0; 12];
            let (a, b) = (&prepared.da[j * size..(j + 1) * size], &prepared.db[j * num_rows..(j + 1) * num_rows]);
            path.fold(a, b, &[0.0; 3], self.transform, &mut direction);
            for entry in 0..12 {
                directions[entry / 4][entry % 4][c] = direction[entry];
            }
        }
        for (range, out) in path.starts.windows(2).zip(jacobian.chunks_exact_mut(prepared.tangent)) {
            let mut row = [0.0; COLUMNS];
            let mut lane = 0;
            while lane < COLUMNS {
                let mut sum = Lane::splat(simd, 0.0);
                for term in &path.terms[range[0]..range[1]] {
                    let (head, columns) = (&self.heads[term.lower], &directions[term.q]);
                    for k in 0..4 {
                        let direction = Lane::load(simd, &columns[k][lane..]);
                        sum = Lane::splat(simd, term.factor * head[k]).mul_add(direction, sum);
                    }
                }
                sum.store(&mut row[lane..]);
                lane += S::F64_LANES;
            }
            out[first..first + N].copy_from_slice(&row[..N]);
        }
        N
    }
}
