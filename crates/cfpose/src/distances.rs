//! Distances between points, which means cannot see: the likelihood of the points, nearest-neighbour support of a fit, correspondence.
//!
//! Everything here works on points mapped into the feature space and their derivatives along theta, so that every model
//! takes part without further code.

pub(crate) mod consistent;
pub(crate) mod correspondence;
mod density;
pub(crate) mod likelihood;
pub(crate) mod neighbours;
mod normals;
pub(crate) mod sampling;
pub(crate) mod spin;
pub(crate) mod support;

pub use correspondence::{Correspondence, MAX_ASSIGNED, assign, correspond, nearest_neighbours};
pub use density::{density_weights, even_rows, one_per_cell};
pub use sampling::Sampling;
pub use support::Support;

use std::sync::Arc;

use cfpose_kernel::Isa;
use cfpose_kernel::map::{LiftedPoints, MapBlock, Transform};
use cfpose_kernel::points::{BLOCK, Points};
use cfpose_optim::manifold::Manifold;
use cfpose_optim::problem::LeastSquares;

use crate::problem::MomentProblem;

/// Source points mapped into the feature space at one theta, not normalised, with derivatives.
pub(crate) struct Mapped {
    /// Dimension of the feature space.
    pub dim: usize,
    /// Number of derivatives.
    pub tangent: usize,
    /// Coordinates, 0 from `dim` on.
    pub x: Vec<[f64; 3]>,
    /// d x_q / d theta_j at (k * dim + q) * tangent + j.
    pub dx: Vec<f64>,
}

impl Mapped {
    /// Return d x_q / d theta of point k.
    pub fn slope(&self, k: usize, q: usize) -> &[f64] {
        let at = (k * self.dim + q) * self.tangent;
        &self.dx[at..at + self.tangent]
    }

    /// Return the squared displacement of point k by a step of theta, to first order.
    pub fn displacement(&self, k: usize, step: &[f64]) -> f64 {
        let along = |q: usize| self.slope(k, q).iter().zip(step).map(|(g, s)| g * s).sum::<f64>();
        (0..self.dim).map(|q| along(q).powi(2)).sum()
    }
}

/// A source set that can be moved by theta: the model of a problem, a choice of its points, its manifold.
pub(crate) struct Mover<'a> {
    problem: &'a MomentProblem,
    lifted: Arc<LiftedPoints>,
}

impl<'a> Mover<'a> {
    /// Take points as the problem's model takes them.
    pub fn new(problem: &'a MomentProblem, source: &Points) -> Self {
        Self::over(problem, Arc::new(problem.model().source.lift(source)))
    }

    /// Take points that the problem's model has lifted already.
    pub fn over(problem: &'a MomentProblem, lifted: Arc<LiftedPoints>) -> Self {
        Self { problem, lifted }
    }

    /// Return the number of points.
    pub fn len(&self) -> usize {
        self.lifted.len
    }

    /// Return the dimension of the feature space.
    pub fn dim(&self) -> usize {
        self.problem.model().dim()
    }

    /// Return the instruction set of the problem.
    pub fn isa(&self) -> Isa {
        self.problem.isa()
    }

    /// Return the number of tangent coordinates of the model (nuisance parameters not counted).
    pub fn tangent(&self) -> usize {
        self.problem.manifold().tangent() - self.problem.noise().num_parameters(self.dim())
    }

    /// Map all points at ambient theta, which may carry nuisance parameters, with derivatives where wanted.
    pub fn map(&self, theta: &[f64], derivatives: bool) -> Mapped {
        let (dim, full) = (self.dim(), self.problem.manifold().tangent());
        let own = self.problem.model().layout.manifold().ambient();
        let tangent = if derivatives { self.tangent() } else { 0 };
        let mut basis = vec![0.0; theta.len() * full];
        let mut own_basis = Vec::with_capacity(own * tangent);
        if derivatives {
            self.problem.manifold().basis(theta, &mut basis);
            for row in basis.chunks_exact(full).take(own) {
                own_basis.extend_from_slice(&row[..tangent]);
            }
        }
        let map = self.problem.model().source.as_ref();
        let prepared = map.prepare(&theta[..own], &own_basis, tangent);
        let mut block = MapBlock::new(dim, tangent);
        let mut mapped =
            Mapped { dim, tangent, x: Vec::with_capacity(self.len()), dx: vec![0.0; self.len() * dim * tangent] };
        for start in (0..self.lifted.weights.len()).step_by(BLOCK) {
            map.block(self.problem.isa(), &prepared, &Transform::identity(), &self.lifted, start, &mut block);
            for k in 0..BLOCK.min(self.lifted.len.saturating_sub(start)) {
                mapped.x.push(std::array::from_fn(|q| if q < dim { block.x[q].0[k] } else { 0.0 }));
                // The block's derivatives carry the weight.
                let scale = if block.weight.0[k] > 0.0 { block.weight.0[k].recip() } else { 0.0 };
                for q in 0..dim {
                    for j in 0..tangent {
                        mapped.dx[((start + k) * dim + q) * tangent + j] = scale * block.dx[q * tangent + j].0[k];
                    }
                }
            }
        }
        mapped
    }

    /// Return the root mean square distance of the points at one theta from those at another.
    pub fn apart(&self, a: &[f64], b: &[f64]) -> f64 {
        let (a, b) = (self.map(a, false), self.map(b, false));
        let squared = |(a, b): (&[f64; 3], &[f64; 3])| (0..3).map(|d| (a[d] - b[d]).powi(2)).sum::<f64>();
        (a.x.iter().zip(&b.x).map(squared).sum::<f64>() / a.x.len() as f64).sqrt()
    }

    /// Move theta by a step of the model's tangent coordinates.
    pub fn retract(&self, theta: &[f64], step: &[f64]) -> Vec<f64> {
        let mut full = step.to_vec();
        full.resize(self.problem.manifold().tangent(), 0.0);
        let mut moved = vec![0.0; theta.len()];
        self.problem.manifold().retract(theta, &full, &mut moved);
        moved
    }
}

/// Split by medians along the widest coordinate, `depth` times, and visit the groups.
pub(crate) fn regions<T>(group: &mut [T], depth: u32, place: &dyn Fn(&T) -> [f64; 3], visit: &mut dyn FnMut(&[T])) {
    if depth == 0 || group.len() < 2 {
        visit(group);
        return;
    }
    let width = |d: usize| {
        let (low, high) = group
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), r| (low.min(place(r)[d]), high.max(place(r)[d])));
        high - low
    };
    let axis = (0..3).max_by(|a, b| width(*a).total_cmp(&width(*b))).unwrap_or(0);
    let middle = group.len() / 2;
    group.select_nth_unstable_by(middle, |a, b| place(a)[axis].total_cmp(&place(b)[axis]));
    let (low, high) = group.split_at_mut(middle);
    regions(low, depth - 1, place, visit);
    regions(high, depth - 1, place, visit);
}
