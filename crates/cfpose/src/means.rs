//! The hot loop: weighted sums of the basis functions and of their derivatives over all points.
//!
//! F(theta) = sum_k w_k f(x_k) / sum_k w_k. Sums are additive, so shards and threads merge exactly; they are always added
//! chunk by chunk in index order, which gives the same bits for any number of threads.

use std::sync::Arc;

use pulp::{Simd, WithSimd};
use rayon::prelude::*;

use crate::block::{DynMap, LiftedPoints, MapBlock, PreparedMap, Row, Transform};
use crate::family::{BasisBlock, DynFamily};
use crate::isa::Isa;
use crate::lane::{Lane, MAX_LANES};
use crate::points::BLOCK;

/// Points per chunk: the unit of work of a thread.
pub const CHUNK: usize = 4096;

/// Where and how sums are computed. The library uses only the threads it is given.
#[derive(Debug, Clone, Default)]
pub struct Execution {
    /// Instruction set.
    pub isa: Isa,
    /// Thread pool; `None` computes on the calling thread. The result does not depend on it.
    pub pool: Option<Arc<rayon::ThreadPool>>,
}

/// Additive sums over points.
#[derive(Debug, Clone, PartialEq)]
pub struct Sums {
    /// sum w.
    pub weight: f64,
    /// sum dw/dtheta_j.
    pub dweight: Vec<f64>,
    /// sum w phi_i.
    pub value: Vec<f64>,
    /// sum d(w phi_i)/dtheta_j, basis x tangent.
    pub jacobian: Vec<f64>,
}

impl Sums {
    /// Make sums of nothing.
    pub fn zero(num_basis: usize, tangent: usize) -> Self {
        Self {
            weight: 0.0,
            dweight: vec![0.0; tangent],
            value: vec![0.0; num_basis],
            jacobian: vec![0.0; num_basis * tangent],
        }
    }

    /// Add the sums of other points.
    pub fn merge(&mut self, other: &Sums) {
        self.weight += other.weight;
        for (mine, theirs) in [
            (&mut self.dweight, &other.dweight),
            (&mut self.value, &other.value),
            (&mut self.jacobian, &other.jacobian),
        ] {
            for (a, b) in mine.iter_mut().zip(theirs) {
                *a += b;
            }
        }
    }

    /// Divide: F = sum(w phi) / sum(w), J = (d sum(w phi) - F d sum(w)) / sum(w).
    pub fn means(&self) -> Means {
        let tangent = self.dweight.len();
        let values: Vec<f64> = self.value.iter().map(|s| s / self.weight).collect();
        let mut jacobian = self.jacobian.clone();
        for (i, mean) in values.iter().enumerate() {
            for j in 0..tangent {
                let entry = &mut jacobian[i * tangent + j];
                *entry = (*entry - mean * self.dweight[j]) / self.weight;
            }
        }
        Means { values, jacobian, tangent }
    }
}

/// Means of the basis functions and their derivatives.
#[derive(Debug, Clone, PartialEq)]
pub struct Means {
    /// Means, one per basis function.
    pub values: Vec<f64>,
    /// d mean_i / d theta_j, basis x tangent.
    pub jacobian: Vec<f64>,
    /// Number of derivatives.
    pub tangent: usize,
}

/// One side of the equation, ready to be summed at one theta.
pub(crate) struct Side<'a> {
    pub map: &'a dyn DynMap,
    pub prepared: PreparedMap,
    pub transform: &'a Transform,
    pub points: &'a LiftedPoints,
    pub family: &'a dyn DynFamily,
}

impl Side<'_> {
    /// Sum over all points.
    pub fn sums(&self, execution: &Execution) -> Sums {
        let padded = self.points.weights.len();
        let chunk = |index: usize| self.chunk(execution.isa, index * CHUNK, padded.min((index + 1) * CHUNK));
        let num_chunks = padded.div_ceil(CHUNK);
        let mut total = Sums::zero(self.family.num_basis(self.map.dim()), self.prepared.tangent);
        match &execution.pool {
            Some(pool) if num_chunks > 1 && pool.current_num_threads() > 1 => {
                let parts: Vec<Sums> = pool.install(|| (0..num_chunks).into_par_iter().map(chunk).collect());
                parts.iter().for_each(|part| total.merge(part));
            }
            _ => (0..num_chunks).for_each(|index| total.merge(&chunk(index))),
        }
        total
    }

    /// Sum over the points from `start` to `end`, both multiples of the block.
    fn chunk(&self, isa: Isa, start: usize, end: usize) -> Sums {
        let (dim, tangent) = (self.map.dim(), self.prepared.tangent);
        let mut points = MapBlock::new(dim, tangent);
        let mut basis = BasisBlock::new(self.family, dim, tangent > 0);
        let mut sums = LaneSums::new(basis.value.len(), tangent);
        for at in (start..end).step_by(BLOCK) {
            self.map.block(isa, &self.prepared, self.transform, self.points, at, &mut points);
            self.family.block(isa, &points, basis.rows());
            isa.run(Accumulate { points: &points, basis: &basis, tangent, sums: &mut sums });
        }
        sums.reduce(tangent)
    }
}

/// One partial sum per lane.
#[repr(align(64))]
#[derive(Clone, Copy)]
struct Partial([f64; MAX_LANES]);

/// Partial sums per lane over the blocks of one chunk.
struct LaneSums {
    weight: Partial,
    dweight: Vec<Partial>,
    value: Vec<Partial>,
    jacobian: Vec<Partial>,
}

impl LaneSums {
    fn new(num_basis: usize, tangent: usize) -> Self {
        let zero = Partial([0.0; MAX_LANES]);
        Self {
            weight: zero,
            dweight: vec![zero; tangent],
            value: vec![zero; num_basis],
            jacobian: vec![zero; num_basis * tangent],
        }
    }

    /// Add the lanes by halving; unused lanes hold 0.
    fn reduce(&self, tangent: usize) -> Sums {
        let sum = |partial: &Partial| {
            let mut v = partial.0;
            let mut width = MAX_LANES;
            while width > 1 {
                width /= 2;
                for i in 0..width {
                    v[i] += v[i + width];
                }
            }
            v[0]
        };
        debug_assert_eq!(self.dweight.len(), tangent);
        Sums {
            weight: sum(&self.weight),
            dweight: self.dweight.iter().map(sum).collect(),
            value: self.value.iter().map(sum).collect(),
            jacobian: self.jacobian.iter().map(sum).collect(),
        }
    }
}

/// Add one block to the sums, compiled for each instruction set (and not for each model or family).
struct Accumulate<'a> {
    points: &'a MapBlock,
    basis: &'a BasisBlock,
    tangent: usize,
    sums: &'a mut LaneSums,
}

impl WithSimd for Accumulate<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { points, basis, tangent, sums } = self;
        add_rows(simd, std::slice::from_ref(&points.weight), None, std::slice::from_mut(&mut sums.weight));
        let weight = (!points.unit_weight).then_some(&points.weight);
        add_rows(simd, &basis.value, weight, &mut sums.value);
        if tangent == 0 {
            return;
        }
        let (mut value, mut slope) = (0, 0);
        for segment in &basis.segments {
            let out = &mut sums.jacobian[value * tangent..(value + segment.num_basis) * tangent];
            let rows = &basis.gradient[slope..slope + segment.num_gradient_rows(points.x.len())];
            match segment.per_coordinate {
                // Row (q, i) of a separable family depends on coordinate q only.
                Some(num) => {
                    for q in 0..points.x.len() {
                        let columns = &points.dx[q * tangent..(q + 1) * tangent];
                        let part = &mut out[q * num * tangent..(q + 1) * num * tangent];
                        add_products(simd, &rows[q * num..(q + 1) * num], 1, columns, tangent, part);
                    }
                }
                None => add_products(simd, rows, points.x.len(), &points.dx, tangent, out),
            }
            value += segment.num_basis;
            slope += rows.len();
        }
        if points.moving_weight {
            add_rows(simd, &points.dweight, None, &mut sums.dweight);
            add_products(simd, &basis.value, 1, &points.dweight, tangent, &mut sums.jacobian);
        }
    }
}

/// sums_i += sum_k weight_k row_i,k, lane by lane.
#[inline(always)]
fn add_rows<S: Simd>(simd: S, rows: &[Row], weight: Option<&Row>, sums: &mut [Partial]) {
    for (row, partial) in rows.iter().zip(sums) {
        let mut sum = Lane::load(simd, &partial.0);
        match weight {
            None => {
                for lane in (0..BLOCK).step_by(S::F64_LANES) {
                    sum = sum + Lane::load(simd, &row.0[lane..]);
                }
            }
            Some(weight) => {
                for lane in (0..BLOCK).step_by(S::F64_LANES) {
                    sum = Lane::load(simd, &row.0[lane..]).mul_add(Lane::load(simd, &weight.0[lane..]), sum);
                }
            }
        }
        sum.store(&mut partial.0);
    }
}

/// sums_(i, j) += sum_q sum_k rows_(i * terms + q),k * columns_(q * width + j),k, lane by lane, in register tiles.
#[inline(always)]
fn add_products<S: Simd>(simd: S, rows: &[Row], terms: usize, columns: &[Row], width: usize, sums: &mut [Partial]) {
    let num_rows = rows.len() / terms;
    let mut i = 0;
    while i < num_rows {
        let height = (num_rows - i).min(4);
        let mut j = 0;
        while j < width {
            let breadth = (width - j).min(3);
            let task = Tile { rows, terms, columns, width, i, j };
            match (height, breadth) {
                (4, 3) => task.add::<S, 4, 3>(simd, sums),
                (4, 2) => task.add::<S, 4, 2>(simd, sums),
                (4, _) => task.add::<S, 4, 1>(simd, sums),
                (3, 3) => task.add::<S, 3, 3>(simd, sums),
                (3, 2) => task.add::<S, 3, 2>(simd, sums),
                (3, _) => task.add::<S, 3, 1>(simd, sums),
                (2, 3) => task.add::<S, 2, 3>(simd, sums),
                (2, 2) => task.add::<S, 2, 2>(simd, sums),
                (2, _) => task.add::<S, 2, 1>(simd, sums),
                (_, 3) => task.add::<S, 1, 3>(simd, sums),
                (_, 2) => task.add::<S, 1, 2>(simd, sums),
                (_, _) => task.add::<S, 1, 1>(simd, sums),
            }
            j += breadth;
        }
        i += height;
    }
}

/// One tile of the product sums, its accumulators in registers.
struct Tile<'a> {
    rows: &'a [Row],
    terms: usize,
    columns: &'a [Row],
    width: usize,
    i: usize,
    j: usize,
}

impl Tile<'_> {
    #[inline(always)]
    fn add<S: Simd, const R: usize, const C: usize>(self, simd: S, sums: &mut [Partial]) {
        let mut tile = [[Lane::splat(simd, 0.0); C]; R];
        for r in 0..R {
            for c in 0..C {
                tile[r][c] = Lane::load(simd, &sums[(self.i + r) * self.width + self.j + c].0);
            }
        }
        for q in 0..self.terms {
            let mut rows = [&Row::ZERO; R];
            for r in 0..R {
                rows[r] = &self.rows[(self.i + r) * self.terms + q];
            }
            let mut columns = [&Row::ZERO; C];
            for c in 0..C {
                columns[c] = &self.columns[q * self.width + self.j + c];
            }
            for lane in (0..BLOCK).step_by(S::F64_LANES) {
                let mut column = [tile[0][0]; C];
                for c in 0..C {
                    column[c] = Lane::load(simd, &columns[c].0[lane..]);
                }
                for r in 0..R {
                    let row = Lane::load(simd, &rows[r].0[lane..]);
                    for c in 0..C {
                        tile[r][c] = row.mul_add(column[c], tile[r][c]);
                    }
                }
            }
        }
        for r in 0..R {
            for c in 0..C {
                tile[r][c].store(&mut sums[(self.i + r) * self.width + self.j + c].0);
            }
        }
    }
}
