//! A theta by the moments of several regions that share it, each weighted by how well it fits.

use std::sync::Arc;

use cfpose::problem::MomentProblem;
use cfpose::{Execution, Points};
use cfpose_optim::solvers::LevenbergMarquardt;
use cfpose_optim::{Control, LeastSquares, Manifold, Solver, Stopping};

use super::greys::{Greys, MOST, OCCLUDERS, SEED, region};
use super::mapper::as_model_takes;
use super::moments::spread_of;
use super::registrar::Registrar;
use crate::camera::Camera;
use crate::raster::Raster;
use crate::segment::clusters::clusters;

/// Largest difference of the greys of a pair.
const ALIKE: f32 = 0.09;

/// Rounds of reweighting at each stage, and steps of each.
const ROUNDS: usize = 4;
const STEPS: usize = 6;

/// Smallest scale of the squared misfits of pairs.
const LEAST: f64 = 1e-8;

/// Regions of the reference and of a frame with the same grey.
pub(super) type Pairs = Vec<[Points; 2]>;

/// Pair the clusters of a reference with those of a frame's darkness, by their mean grey.
pub(super) fn pairs(greys: &Greys, darkness: &Raster, noise: f32, camera: Camera) -> Pairs {
    let smooth = darkness.smoothed();
    let means = clusters(&smooth, noise, MOST.min(greys.clusters.len()) + OCCLUDERS, SEED);
    let mut found = Pairs::new();
    for (grey, source) in &greys.regions {
        let nearest = means.iter().copied().min_by(|a, b| (a - grey).abs().total_cmp(&(b - grey).abs()));
        let Some(mean) = nearest.filter(|mean| (mean - grey).abs() < ALIKE) else { continue };
        if let Ok(Some(target)) = region(&smooth, &means, mean, camera, |_, _| true) {
            found.push([source.clone(), target]);
        }
    }
    found
}

/// Moment problems that share theta, each with a factor of its residuals.
struct Joint {
    groups: Vec<MomentProblem>,
    factors: Vec<f64>,
}

impl Joint {
    /// Return the squared norm of each group's residual.
    fn misfits(&self, theta: &[f64]) -> Vec<f64> {
        let misfit = |group: &MomentProblem| {
            let mut residual = vec![0.0; group.num_residuals()];
            group.residual(theta, &mut residual);
            residual.iter().map(|r| r * r).sum()
        };
        self.groups.iter().map(misfit).collect()
    }
}

impl LeastSquares for Joint {
    fn manifold(&self) -> &dyn Manifold {
        self.groups[0].manifold()
    }

    fn num_residuals(&self) -> usize {
        self.groups.iter().map(LeastSquares::num_residuals).sum()
    }

    fn residual(&self, theta: &[f64], residual: &mut [f64]) {
        let mut at = 0;
        for (group, factor) in self.groups.iter().zip(&self.factors) {
            let rows = &mut residual[at..at + group.num_residuals()];
            group.residual(theta, rows);
            rows.iter_mut().for_each(|r| *r *= factor);
            at += rows.len();
        }
    }

    fn jacobian(&self, theta: &[f64], residual: &mut [f64], jacobian: &mut [f64]) {
        let m = self.manifold().tangent();
        let mut at = 0;
        for (group, factor) in self.groups.iter().zip(&self.factors) {
            let end = at + group.num_residuals();
            let (rows, slopes) = (&mut residual[at..end], &mut jacobian[at * m..end * m]);
            group.jacobian(theta, rows, slopes);
            rows.iter_mut().chain(slopes).for_each(|r| *r *= factor);
            at = end;
        }
    }
}

impl Registrar {
    /// Match the means of waves over all pairs from a start, coarse ones first. A pair counts by the square of 1 / (1 + n / (2 s)), n the
    /// squared norm of its residual and s the median of all pairs: regions of which much is hidden fit worst.
    pub(super) fn by_pairs(&self, pairs: &Pairs, start: &[f64]) -> Option<Vec<f64>> {
        let model = self.region_model(None)?;
        let takes = |points: &Points| as_model_takes(&self.model, points).ok();
        let sides: Option<Vec<_>> = pairs.iter().map(|[p, q]| Some((takes(p)?, takes(q)?))).collect();
        let transform = spread_of(&joined(pairs)?);
        let mut theta = start.to_vec();
        for family in &self.families {
            let problem = |(source, target): &(Points, Points)| {
                let (model, family) = (Arc::clone(&model), Arc::clone(family));
                MomentProblem::new(model, family, transform, source, target, Execution::default())
                    .with_model_manifold(self.manifold_at(&theta))
            };
            let groups: Vec<MomentProblem> = sides.as_ref()?.iter().map(problem).collect();
            let mut joint = Joint { factors: vec![1.0; groups.len()], groups };
            for _ in 0..ROUNDS {
                let stopping = Stopping {
                    max_iterations: STEPS,
                    cost_tolerance: Some(1e-9),
                    step_tolerance: Some(1e-8),
                    ..Stopping::default()
                };
                let mut control = Control { stopping, ..Control::default() };
                let outcome = LevenbergMarquardt::default().solve(&joint, &theta, &mut control).ok()?;
                theta = outcome.theta;
                let misfits = joint.misfits(&theta);
                let mut sorted: Vec<f32> = misfits.iter().map(|n| *n as f32).collect();
                let scale = f64::from(crate::segment::median(&mut sorted)?).max(LEAST);
                joint.factors = misfits.iter().map(|n| 1.0 / (1.0 + n / (2.0 * scale))).collect();
            }
        }
        theta.iter().all(|v| v.is_finite()).then_some(theta)
    }
}

/// Return the targets of all pairs as one set.
fn joined(pairs: &Pairs) -> Option<Points> {
    let column = |d: usize| pairs.iter().flat_map(|[_, q]| q.column(d)).copied().collect::<Vec<f64>>();
    let weights = pairs.iter().flat_map(|[_, q]| q.weights()).copied().collect();
    Points::weighted(vec![column(0), column(1)], weights).ok()
}
