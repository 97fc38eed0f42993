//! The points under a model at one theta: motions, and what each point adds to the change of feature means.

use std::sync::Arc;

use cfpose_kernel::family::{BasisBlock, DynFamily};
use cfpose_kernel::isa::Isa;
use cfpose_kernel::map::{DynMap, LiftedPoints, MapBlock, Row, Transform};
use cfpose_kernel::means::Execution;
use cfpose_kernel::points::{BLOCK, Points};
use cfpose_optim::manifold::Manifold;
use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, Par, Scale};

use super::significance;
use crate::entry::BuildContext;
use crate::error::{Error, Side};
use crate::model::Model;
use crate::problem::{adapt, map_points, transformed};
use crate::registry::Registry;
use crate::statistics::gram::{coefficient_matrix, gradient_rows};

/// The points under the model at one theta: everything but the family.
pub(super) struct Scene {
    pub model: Arc<Model>,
    theta: Vec<f64>,
    /// Tangent basis, ambient x tangent.
    basis: Vec<f64>,
    transform: Transform,
    source: LiftedPoints,
    target: LiftedPoints,
    /// Points in the feature space, raw and normalised.
    pub mapped: Points,
    pub normalised: Points,
}

impl Scene {
    pub fn new(registry: &Registry, name: &str, points: &Points) -> Result<Self, Error> {
        let model = Arc::new(registry.model(name, &BuildContext::default())?);
        let points = Arc::new(points.clone());
        let source = model.source.lift(adapt(Side::Source, name, model.source_points, &points)?.as_ref());
        let theta = model.typical.clone();
        let error = |problem| Error::Points { side: Side::Source, problem };
        let mapped = map_points(model.source.as_ref(), &source, &theta, &Execution::default()).map_err(error)?;
        let normaliser = registry.normaliser(model.normaliser.unwrap_or("paper"))?;
        let transform = normaliser.fit(&mapped)?;
        let normalised = transformed(&mapped, &transform).map_err(error)?;
        // Only a target that moves with theta has a share in J; it is the same points then.
        let target = match model.target.is_moving() {
            true => model.target.map().lift(adapt(Side::Target, name, model.target_points, &points)?.as_ref()),
            false => LiftedPoints { len: 0, columns: Vec::new(), weights: Vec::new() },
        };
        let manifold = model.layout.manifold();
        let mut basis = vec![0.0; manifold.ambient() * manifold.tangent()];
        manifold.basis(&theta, &mut basis);
        Ok(Self { model, theta, basis, transform, source, target, mapped, normalised })
    }

    pub fn tangent(&self) -> usize {
        self.model.layout.manifold().tangent()
    }

    /// The sides that move, each with its sign in the residual.
    fn sides(&self) -> Vec<(f64, &dyn DynMap, &LiftedPoints)> {
        let mut sides = vec![(1.0, self.model.source.as_ref(), &self.source)];
        if self.model.target.is_moving() {
            sides.push((-1.0, self.model.target.map(), &self.target));
        }
        sides
    }

    /// Call `work` with each block of one side and the number of real points in it.
    fn each_block(
        &self,
        map: &dyn DynMap,
        points: &LiftedPoints,
        transform: &Transform,
        mut work: impl FnMut(&MapBlock, usize),
    ) {
        let prepared = map.prepare(&self.theta, &self.basis, self.tangent());
        let mut block = MapBlock::new(map.dim(), self.tangent());
        for start in (0..points.weights.len()).step_by(BLOCK) {
            map.block(Isa::detect(), &prepared, transform, points, start, &mut block);
            work(&block, BLOCK.min(points.len.saturating_sub(start)));
        }
    }

    /// Return the mean square motion of the normalised points, tangent x tangent.
    pub fn motion_metric(&self) -> Mat<f64> {
        let m = self.tangent();
        let mut metric = Mat::zeros(m, m);
        for (_, map, points) in self.sides() {
            self.each_block(map, points, &self.transform, |block, count| {
                for k in 0..count {
                    for q in 0..block.x.len() {
                        for a in 0..m {
                            for b in 0..m {
                                let (da, db) = (slope(block, q, a, k), slope(block, q, b, k));
                                metric[(a, b)] += da * db / points.len as f64;
                            }
                        }
                    }
                }
            });
        }
        metric
    }

    /// Return positions and velocities of the source points in the feature space, not normalised, along a direction.
    pub fn velocities(&self, direction: &[f64]) -> (Vec<[f64; 3]>, Vec<[f64; 3]>) {
        let (mut x, mut v) = (Vec::new(), Vec::new());
        self.each_block(self.model.source.as_ref(), &self.source, &Transform::identity(), |block, count| {
            for k in 0..count {
                let (mut place, mut velocity) = ([0.0; 3], [0.0; 3]);
                for q in 0..block.x.len() {
                    place[q] = block.x[q].0[k];
                    velocity[q] = direction.iter().enumerate().map(|(j, u)| u * slope(block, q, j, k)).sum();
                }
                x.push(place);
                v.push(velocity);
            }
        });
        (x, v)
    }

    /// Return the change of the feature means along directions, features x directions.
    pub fn changes(&self, family: &dyn DynFamily, directions: &Mat<f64>) -> Mat<f64> {
        let num = family.num_features(self.mapped.dim());
        let mut change = Mat::zeros(num, directions.ncols());
        self.each_contribution(family, directions, |d, sign, share| {
            for i in 0..num {
                for k in 0..share.ncols() {
                    change[(i, d)] += sign * share[(i, k)];
                }
            }
        });
        change
    }

    /// Return the significance of the change along each direction (column).
    pub fn significances(&self, family: &dyn DynFamily, directions: &Mat<f64>, changes: &Mat<f64>) -> Vec<f64> {
        let (num, columns) = (changes.nrows(), directions.ncols());
        let mut covariance: Vec<Mat<f64>> = vec![Mat::zeros(num, num); columns];
        let mut sums: Vec<Vec<Mat<f64>>> = vec![Vec::new(); columns];
        let mut last_sign = vec![0.0; columns];
        self.each_contribution(family, directions, |d, sign, share| {
            matmul(covariance[d].as_mut(), Accum::Add, share.as_ref(), share.transpose(), 1.0, Par::Seq);
            if last_sign[d] != sign {
                last_sign[d] = sign;
                sums[d].push(Mat::zeros(num, 1));
            }
            if let Some(sum) = sums[d].last_mut() {
                for i in 0..num {
                    for k in 0..share.ncols() {
                        sum[(i, 0)] += share[(i, k)];
                    }
                }
            }
        });
        let counts: Vec<usize> = self.sides().iter().map(|(_, _, points)| points.len).collect();
        (0..columns)
            .map(|d| {
                for (sum, count) in sums[d].iter().zip(&counts) {
                    covariance[d] -= sum * sum.transpose() * Scale(1.0 / *count as f64);
                }
                significance(&changes.col(d).to_owned(), &covariance[d], counts[0])
            })
            .collect()
    }

    /// Return total weight and basis means of one side.
    fn means(&self, family: &dyn DynFamily, map: &dyn DynMap, points: &LiftedPoints) -> (f64, Vec<f64>) {
        let mut basis = BasisBlock::new(family, map.dim(), false);
        let (mut total, mut sums) = (0.0, vec![0.0; basis.value.len()]);
        self.each_block(map, points, &self.transform, |block, count| {
            family.block(Isa::detect(), block, basis.rows());
            for k in 0..count {
                total += block.weight.0[k];
                for (sum, row) in sums.iter_mut().zip(&basis.value) {
                    *sum += block.weight.0[k] * row.0[k];
                }
            }
        });
        sums.iter_mut().for_each(|sum| *sum /= total);
        (total, sums)
    }

    /// Call `work` with each direction, the sign of the side, and the shares of a block's points in the change of the feature
    /// means of that side (features x points).
    fn each_contribution(
        &self,
        family: &dyn DynFamily,
        directions: &Mat<f64>,
        mut work: impl FnMut(usize, f64, &Mat<f64>),
    ) {
        let coefficients = coefficient_matrix(family, self.mapped.dim());
        for (sign, map, points) in self.sides() {
            let (total, means) = self.means(family, map, points);
            let mut basis = BasisBlock::new(family, map.dim(), true);
            self.each_block(map, points, &self.transform, |block, count| {
                family.block(Isa::detect(), block, basis.rows());
                for d in 0..directions.ncols() {
                    let direction: Vec<f64> = (0..self.tangent()).map(|j| directions[(j, d)] / total).collect();
                    let share = basis_shares(block, &basis, &means, &direction);
                    let share = share.subcols(0, count);
                    match &coefficients {
                        None => work(d, sign, &share.to_owned()),
                        Some(c) => work(d, sign, &(c * share)),
                    }
                }
            });
        }
    }
}

/// Return what each point of a block adds to the change of sum(w phi) / sum(w) along a direction (divided by sum w).
fn basis_shares(block: &MapBlock, basis: &BasisBlock, means: &[f64], direction: &[f64]) -> Mat<f64> {
    let (dim, tangent) = (block.x.len(), direction.len());
    let along = |rows: &[Row], k: usize| direction.iter().zip(rows).map(|(u, row)| u * row.0[k]).sum::<f64>();
    let mut share = Mat::<f64>::zeros(basis.value.len(), BLOCK);
    for q in 0..dim {
        // dx of the block carries the weight.
        let motion: Vec<f64> = (0..BLOCK).map(|k| along(&block.dx[q * tangent..(q + 1) * tangent], k)).collect();
        share += gradient_rows(basis, dim, q, &motion);
    }
    if block.moving_weight {
        // d (sum w phi / sum w) = sum (w dphi + dw (phi - mean)) / sum w.
        for k in 0..BLOCK {
            let dw = along(&block.dweight, k);
            for (i, mean) in means.iter().enumerate() {
                share[(i, k)] += dw * (basis.value[i].0[k] - mean);
            }
        }
    }
    share
}

/// Return d x_q / d theta_j of point k without its weight; a point of weight 0 does not move.
fn slope(block: &MapBlock, q: usize, j: usize, k: usize) -> f64 {
    let tangent = block.dx.len() / block.x.len();
    let (slope, weight) = (block.dx[q * tangent + j].0[k], block.weight.0[k]);
    match block.unit_weight {
        true => slope,
        false if weight > 0.0 => slope / weight,
        false => 0.0,
    }
}
