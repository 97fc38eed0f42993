//! Even grids of rotations and directions.

use std::f64::consts::{PI, TAU};

use cfpose_optim::manifold::rotation_of_quaternion;

use super::{Moments, Proposal, StartContext, StartEntry, StartStrategy, rotations, screened};
use crate::entry::ParameterSpec;
use crate::error::Error;
use crate::geometry::theta::BlockKind;
use crate::model::{LinearGroup, LinearKind};

struct Grid {
    count: usize,
    directions: usize,
    keep: usize,
}

/// Return `count` rotations that cover SO(3) evenly (super-Fibonacci spirals, Alexa 2022), row by row.
///
/// ```
/// let grid = cfpose::start::rotation_grid(576);
/// assert_eq!(grid.len(), 576);
/// ```
pub fn rotation_grid(count: usize) -> Vec<[f64; 9]> {
    // phi^2 = 2 and psi^4 = psi + 4, the irrational pair of the construction.
    let (phi, psi) = (std::f64::consts::SQRT_2, 1.533_751_168_755_204_3);
    let n = count as f64;
    (0..count)
        .map(|i| {
            let s = i as f64 + 0.5;
            let (r, big) = ((s / n).sqrt(), (1.0 - s / n).sqrt());
            let (alpha, beta) = (TAU * s / phi, TAU * s / psi);
            rotation_of_quaternion(&[r * alpha.sin(), r * alpha.cos(), big * beta.sin(), big * beta.cos()])
        })
        .collect()
}

/// Return `count` unit vectors that cover the sphere S^2 evenly (Fibonacci spiral).
///
/// ```
/// let grid = cfpose::start::direction_grid(100);
/// let sum: f64 = grid.iter().map(|v| v[2]).sum();
/// assert!(grid.len() == 100 && sum.abs() < 1e-12);
/// ```
pub fn direction_grid(count: usize) -> Vec<[f64; 3]> {
    let golden = PI * (3.0 - 5.0_f64.sqrt());
    (0..count)
        .map(|i| {
            let z = 1.0 - (2.0 * i as f64 + 1.0) / count as f64;
            let ((sin, cos), radius) = ((golden * i as f64).sin_cos(), (1.0 - z * z).sqrt());
            [radius * cos, radius * sin, z]
        })
        .collect()
}

impl Grid {
    /// Rotations and similarities: means matched, and spreads where there is a scale.
    fn of_group(&self, context: &StartContext<'_>, group: &LinearGroup) -> Result<Vec<Proposal>, Error> {
        let moments = Moments::new(context, group.dim)?;
        let scale = if group.kind == LinearKind::Similarity { moments.scale() } else { 1.0 };
        let propose = |rotation: Vec<f64>| {
            let a: Vec<f64> = rotation.iter().map(|value| scale * value).collect();
            Proposal { theta: (group.theta)(&a, &moments.offset(&a)), rotation }
        };
        Ok(rotations(group.dim, self.count, context.freedom).into_iter().map(propose).collect())
    }

    /// Projective models: the rotation block runs over the grid, a unit vector over the sphere, and a translation of 3
    /// numbers puts the source's mean on the target's mean ray at the depth that matches the spreads.
    fn of_blocks(&self, context: &StartContext<'_>, range: std::ops::Range<usize>) -> Vec<Proposal> {
        let model = context.model;
        let direction = model.layout.blocks().iter().find(|block| matches!(block.kind, BlockKind::Direction(3)));
        let direction = direction.and_then(|block| model.layout.range(block.name));
        let sight = line_of_sight(context);
        let mut proposals = Vec::new();
        for rotation in rotations(3, self.count, context.freedom) {
            let mut theta = model.identity.clone();
            theta[range.clone()].copy_from_slice(&rotation);
            if let (Some(sight), Some(place)) = (sight, model.layout.range("translation")) {
                let mean = context.source.mean();
                for (i, at) in place.enumerate() {
                    theta[at] = sight[i] - (0..3).map(|k| rotation[3 * i + k] * mean[k]).sum::<f64>();
                }
            }
            match &direction {
                Some(place) if self.directions > 0 => {
                    for unit in direction_grid(self.directions) {
                        theta[place.clone()].copy_from_slice(&unit);
                        proposals.push(Proposal { rotation: rotation.clone(), theta: theta.clone() });
                    }
                }
                _ => proposals.push(Proposal { rotation, theta }),
            }
        }
        proposals
    }
}

/// Return where the mean of the source is seen: the mean ray at the depth at which the source's spread has the target's size.
///
/// Known for models of a pose (rotation and a translation of 3 numbers, nothing else) whose target does not move.
fn line_of_sight(context: &StartContext<'_>) -> Option<[f64; 3]> {
    let model = context.model;
    let posed = model.layout.blocks().len() == 2
        && model.layout.blocks().iter().any(|b| b.name == "translation" && matches!(b.kind, BlockKind::Vector(3)));
    if !posed || model.target.is_moving() || model.source.factored().is_none() {
        return None;
    }
    let mean = context.target.mean();
    let ray = if context.target.dim() == 3 { mean } else { [mean[0], mean[1], 1.0] };
    let size = cfpose_optim::manifold::norm3(&ray);
    let trace = |c: [[f64; 3]; 3]| c[0][0] + c[1][1] + c[2][2];
    // Of a solid cloud two of three directions are seen.
    let seen = if context.source.covariance()[2][2] > 0.0 { 2.0 / 3.0 } else { 1.0 };
    let depth = (seen * trace(context.source.covariance()) / trace(context.target.covariance())).sqrt();
    let sight = ray.map(|value| depth * value / size);
    sight.iter().all(|value| value.is_finite()).then_some(sight)
}

impl StartStrategy for Grid {
    fn name(&self) -> &'static str {
        "grid"
    }

    fn starts(&self, context: &StartContext<'_>) -> Result<Vec<Vec<f64>>, Error> {
        let model = context.model;
        let proposals = match (&model.linear, model.layout.range("rotation")) {
            (Some(group), _) if group.kind != LinearKind::General => self.of_group(context, group)?,
            (_, Some(range)) if range.len() == 9 => self.of_blocks(context, range),
            (Some(_), _) => {
                return Err(Error::Unsupported("start `grid` needs rotations; use whitened-affine here".into()));
            }
            _ => return Err(Error::Unsupported("start `grid` needs a model with a rotation".into())),
        };
        // Where directions vary too, starts of one rotation are different starts.
        let separation = if self.directions > 0 { -1.0 } else { PI / 9.0 };
        Ok(screened(context, proposals, self.keep, separation))
    }
}

pub(super) const ENTRY: StartEntry = StartEntry {
    name: "grid",
    summary: "an even grid of rotations in 2-D or 3-D (and of unit vectors); means are matched where the model can",
    parameters: &[
        ParameterSpec { name: "count", default: "72", meaning: "number of rotations, 1 to 100000" },
        ParameterSpec {
            name: "directions",
            default: "0",
            meaning: "number of directions of a unit vector in theta (T of epipolar, normal of plane-homography), up to 10000; 0: as in identity",
        },
        ParameterSpec {
            name: "keep",
            default: "0",
            meaning: "number of starts to solve from, those of least cost; 0: all",
        },
    ],
    source: "Alexa 2022, super-Fibonacci spirals; Fibonacci sphere",
    build: |parameters| {
        Ok(Box::new(Grid {
            count: parameters.count("count", 1, 100_000)?,
            directions: parameters.count("directions", 0, 10_000)?,
            keep: parameters.count("keep", 0, 100_000)?,
        }))
    },
};
