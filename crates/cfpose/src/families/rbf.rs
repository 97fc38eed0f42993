//! Gaussian radial basis functions around centres chosen from the target.

use cfpose_kernel::family::{Family, General};
use cfpose_kernel::points::Points;
use cfpose_kernel::scalar::Scalar;

use crate::entry::FamilyEntry;
use crate::entry::{BuildContext, BuildError, ParameterSpec};

struct Rbf {
    dim: usize,
    centres: Vec<[f64; 3]>,
    /// -1 / (2 width^2).
    exponent: f64,
}

impl Family for Rbf {
    fn num_basis(&self, _dim: usize) -> usize {
        self.centres.len()
    }

    #[inline(always)]
    fn basis<S: Scalar, const D: usize>(&self, x: [S; D], out: &mut [S]) {
        let centres = &self.centres[..out.len()];
        for i in 0..out.len() {
            let mut square = x[0].constant(0.0);
            for q in 0..D {
                let difference = x[q] - centres[i][q];
                square = square + difference * difference;
            }
            out[i] = (square * self.exponent).exp();
        }
    }

    fn supports(&self, dim: usize) -> bool {
        dim == self.dim
    }
}

/// Where the centres come from.
#[derive(Clone, Copy)]
enum Choice {
    Farthest,
    Grid,
}

/// Choose centres one after the other, each the point farthest from those before; the first is the point nearest the mean.
///
/// Ties go to the lexicographically smaller point, so the result does not depend on the order of the points.
fn farthest_points(points: &Points, count: usize) -> Vec<[f64; 3]> {
    let square = |a: [f64; 3], b: [f64; 3]| (0..3).map(|q| (a[q] - b[q]) * (a[q] - b[q])).sum::<f64>();
    let mean = points.mean();
    // Negative distance to the mean first, then the distance to the nearest centre: always take the largest.
    let mut score: Vec<f64> = (0..points.len()).map(|k| -square(points.point(k), mean)).collect();
    let mut centres = Vec::new();
    while centres.len() < count {
        let mut best = 0;
        for k in 1..score.len() {
            let earlier = || points.point(k).partial_cmp(&points.point(best)) == Some(std::cmp::Ordering::Less);
            if score[k] > score[best] || score[k] == score[best] && earlier() {
                best = k;
            }
        }
        if !centres.is_empty() && score[best] <= 0.0 {
            break; // fewer distinct points than centres
        }
        let centre = points.point(best);
        let first = centres.is_empty();
        for (k, value) in score.iter_mut().enumerate() {
            let distance = square(points.point(k), centre);
            *value = if first { distance } else { value.min(distance) };
        }
        centres.push(centre);
    }
    centres
}

/// Spread at most `count` centres evenly over the bounding box of the points: as many per axis, at cell centres.
fn grid(points: &Points, count: usize) -> Vec<[f64; 3]> {
    let dim = points.dim();
    let per_axis = (1..=count).take_while(|n| n.pow(dim as u32) <= count).last().unwrap_or(1);
    let bounds: Vec<(f64, f64)> = (0..dim)
        .map(|q| points.column(q).iter().fold((f64::MAX, f64::MIN), |(low, high), x| (low.min(*x), high.max(*x))))
        .collect();
    (0..per_axis.pow(dim as u32))
        .map(|index| {
            let mut centre = [0.0; 3];
            for (q, (low, high)) in bounds.iter().enumerate() {
                let cell = (index / per_axis.pow(q as u32)) % per_axis;
                centre[q] = low + (high - low) * (cell as f64 + 0.5) / per_axis as f64;
            }
            centre
        })
        .collect()
}

pub(super) const ENTRY: FamilyEntry = FamilyEntry {
    name: "rbf",
    summary: "Gaussians exp(-|x - c|^2 / (2 width^2)) around centres chosen from the target points",
    parameters: &[
        ParameterSpec { name: "count", default: "32", meaning: "number of centres, 1 to 4096" },
        ParameterSpec { name: "width", default: "0.5", meaning: "width, units of the feature space" },
        ParameterSpec {
            name: "centres",
            default: "farthest",
            meaning: "farthest: target points far from each other; grid: even in the target's bounding box",
        },
    ],
    source: "radial basis functions; not in the paper",
    details: "exp(-|x - c_i|^2 / (2 width^2)), centres in the order in which they were chosen: `farthest` starts at the target point nearest the mean and goes on with the point farthest from all centres so far (fewer where the points are fewer), `grid` takes the largest power of a whole number up to `count`. Needs the target points. A blurred Gaussian is a wider Gaussian, which is no combination of the means of the narrow ones: no closed-form blur, noise is modelled by `quadrature-blur`.",
    build: |parameters, context: &BuildContext<'_>| {
        let count = parameters.count("count", 1, 4096)?;
        let width = parameters.number("width", "a positive number", |w| w > 0.0 && w.is_finite())?;
        let choice = parameters.choice("centres", &[("farthest", Choice::Farthest), ("grid", Choice::Grid)])?;
        let Some(points) = context.target else {
            let problem = "the centres come from the target points, and none are given".to_string();
            return Err(BuildError::Data { name: "rbf".into(), problem });
        };
        let centres = match choice {
            Choice::Farthest => farthest_points(points, count),
            Choice::Grid => grid(points, count),
        };
        Ok(Box::new(General(Rbf { dim: points.dim(), centres, exponent: -0.5 / (width * width) })))
    },
};
