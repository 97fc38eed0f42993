//! The hot loop: weighted sums of the basis functions and of their derivatives over all points.
//!
//! F(theta) = sum_k w_k f(x_k) / sum_k w_k. Sums are additive, so shards and threads merge exactly; they are always added
//! chunk by chunk in index order, which gives the same bits for any number of threads.

use std::sync::Arc;

use rayon::prelude::*;

use crate::family::{BasisBlock, DynFamily};
use crate::isa::Isa;
use crate::map::{DynMap, LiftedPoints, MapBlock, PreparedMap, Transform};
use crate::points::BLOCK;

mod accumulate;
mod contraction;

use accumulate::{Accumulate, LaneSums};
pub use contraction::Closure;
use contraction::{Contraction, Products};

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
pub struct Side<'a> {
    /// Map into the feature space.
    pub map: &'a dyn DynMap,
    /// What of the map depends on theta alone.
    pub prepared: PreparedMap,
    /// Normalisation of the feature space.
    pub transform: &'a Transform,
    /// Points after `lift`.
    pub points: &'a LiftedPoints,
    /// Feature functions.
    pub family: &'a dyn DynFamily,
    /// Gradients of the family in terms of its values, where it is closed under differentiation.
    pub closure: Option<&'a Closure>,
}

impl Side<'_> {
    /// Sum over all points.
    pub fn sums(mut self, execution: &Execution) -> Sums {
        let tangent = self.prepared.tangent;
        let products = Products::choose(self.map, tangent, self.family, self.closure);
        // Where the points' own columns serve, the map needs no derivatives.
        let contraction = Contraction::new(products, &mut self.prepared, self.transform, self.map.dim());
        let padded = self.points.weights.len();
        let chunk =
            |index: usize| self.chunk(execution.isa, products, tangent, index * CHUNK, padded.min((index + 1) * CHUNK));
        let num_chunks = padded.div_ceil(CHUNK);
        let num_basis = self.family.num_basis(self.map.dim());
        let mut total = RawSums::zero(num_basis, tangent, products);
        match &execution.pool {
            Some(pool) if num_chunks > 1 && pool.current_num_threads() > 1 => {
                let parts: Vec<RawSums> = pool.install(|| (0..num_chunks).into_par_iter().map(chunk).collect());
                parts.iter().for_each(|part| total.merge(part));
            }
            _ => (0..num_chunks).for_each(|index| total.merge(&chunk(index))),
        }
        contraction.apply(total, self.family, self.closure)
    }

    /// Sum over the points from `start` to `end`, both multiples of the block.
    fn chunk(&self, isa: Isa, products: Products, tangent: usize, start: usize, end: usize) -> RawSums {
        let dim = self.map.dim();
        let mut points = MapBlock::new(dim, self.prepared.tangent);
        let mut basis = BasisBlock::new(self.family, dim, tangent > 0 && !products.is_closed());
        let mut sums = LaneSums::new(basis.value.len(), tangent, products);
        for at in (start..end).step_by(BLOCK) {
            self.map.block(isa, &self.prepared, self.transform, self.points, at, &mut points);
            self.family.block(isa, &points, basis.rows());
            isa.run(Accumulate {
                points: &points,
                lifted: &self.points.columns,
                start: at,
                basis: &basis,
                tangent,
                products,
                sums: &mut sums,
            });
        }
        sums.reduce()
    }
}

/// Sums of one chunk and the products that are contracted once, after all chunks.
struct RawSums {
    sums: Sums,
    /// Sums of rows times columns, rows x columns; see [`Products`].
    products: Vec<f64>,
    /// Sums of the gradient rows by themselves.
    ones: Vec<f64>,
}

impl RawSums {
    fn zero(num_basis: usize, tangent: usize, products: Products) -> Self {
        Self {
            sums: Sums::zero(num_basis, tangent),
            products: vec![0.0; products.len()],
            ones: vec![0.0; products.num_ones()],
        }
    }

    fn merge(&mut self, other: &Self) {
        self.sums.merge(&other.sums);
        self.products.iter_mut().zip(&other.products).for_each(|(a, b)| *a += b);
        self.ones.iter_mut().zip(&other.ones).for_each(|(a, b)| *a += b);
    }
}
