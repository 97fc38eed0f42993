//! Partial sums per lane over the blocks of one chunk.

use pulp::{Simd, WithSimd};

use super::contraction::Products;
use super::{RawSums, Sums};
use crate::family::BasisBlock;
use crate::lane::{Lane, MAX_LANES};
use crate::map::{MapBlock, Row};
use crate::points::BLOCK;

/// One partial sum per lane.
#[repr(align(64))]
#[derive(Clone, Copy)]
struct Partial([f64; MAX_LANES]);

/// Partial sums per lane over the blocks of one chunk.
pub(super) struct LaneSums {
    weight: Partial,
    dweight: Vec<Partial>,
    value: Vec<Partial>,
    jacobian: Vec<Partial>,
    products: Vec<Partial>,
    ones: Vec<Partial>,
    /// The points' own columns times the weight, where they serve as columns.
    columns: Vec<Row>,
}

impl LaneSums {
    pub fn new(num_basis: usize, tangent: usize, products: Products) -> Self {
        let zero = Partial([0.0; MAX_LANES]);
        Self {
            weight: zero,
            dweight: vec![zero; tangent],
            value: vec![zero; num_basis],
            jacobian: vec![zero; num_basis * tangent],
            products: vec![zero; products.len()],
            ones: vec![zero; products.num_ones()],
            columns: vec![Row::ZERO; if products.use_lifted() { products.columns() } else { 0 }],
        }
    }

    /// Add the lanes by halving; unused lanes hold 0.
    pub fn reduce(&self) -> RawSums {
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
        RawSums {
            sums: Sums {
                weight: sum(&self.weight),
                dweight: self.dweight.iter().map(sum).collect(),
                value: self.value.iter().map(sum).collect(),
                jacobian: self.jacobian.iter().map(sum).collect(),
            },
            products: self.products.iter().map(sum).collect(),
            ones: self.ones.iter().map(sum).collect(),
        }
    }
}

/// Add one block to the sums, compiled for each instruction set (and not for each model or family).
pub(super) struct Accumulate<'a> {
    pub points: &'a MapBlock,
    /// Lifted columns of all points, and where the block starts.
    pub lifted: &'a [Vec<f64>],
    pub start: usize,
    pub basis: &'a BasisBlock,
    pub tangent: usize,
    pub products: Products,
    pub sums: &'a mut LaneSums,
}

impl WithSimd for Accumulate<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { points, lifted, start, basis, tangent, products, sums } = self;
        add_rows(simd, std::slice::from_ref(&points.weight), None, std::slice::from_mut(&mut sums.weight));
        let weight = (!points.unit_weight).then_some(&points.weight);
        add_rows(simd, &basis.value, weight, &mut sums.value);
        if tangent == 0 {
            return;
        }
        match products {
            Products::Direct => add_direct(simd, points, basis, tangent, &mut sums.jacobian),
            Products::Closed { rows, columns } => {
                add_products(simd, &basis.value[..rows], 1, &points.dx, columns, &mut sums.products);
            }
            Products::Lifted { rows, columns, closed } => {
                for (row, column) in sums.columns.iter_mut().zip(lifted) {
                    weighted(simd, &column[start..start + BLOCK], weight, row);
                }
                let factors = if closed { &basis.value[..rows] } else { &basis.gradient[..] };
                add_products(simd, factors, 1, &sums.columns, columns, &mut sums.products);
                if !closed {
                    add_rows(simd, factors, weight, &mut sums.ones);
                }
            }
        }
        if points.moving_weight {
            add_rows(simd, &points.dweight, None, &mut sums.dweight);
            add_products(simd, &basis.value, 1, &points.dweight, tangent, &mut sums.jacobian);
        }
    }
}

/// Add the gradients of one block times the derivatives of the map.
#[inline(always)]
fn add_direct<S: Simd>(simd: S, points: &MapBlock, basis: &BasisBlock, tangent: usize, jacobian: &mut [Partial]) {
    let (mut value, mut slope) = (0, 0);
    for segment in &basis.segments {
        let out = &mut jacobian[value * tangent..(value + segment.num_basis) * tangent];
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
}

/// Write a column times the weight.
#[inline(always)]
fn weighted<S: Simd>(simd: S, column: &[f64], weight: Option<&Row>, out: &mut Row) {
    for lane in (0..BLOCK).step_by(S::F64_LANES) {
        let mut value = Lane::load(simd, &column[lane..]);
        if let Some(weight) = weight {
            value = value * Lane::load(simd, &weight.0[lane..]);
        }
        value.store(&mut out.0[lane..]);
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
        // Six rows are two tiles of three: a tile of two loads as much as it multiplies.
        let height = match num_rows - i {
            5 | 6 => 3,
            left => left.min(4),
        };
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
