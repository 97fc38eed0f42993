//! How much of the error is left after one damped Gauss-Newton step.

use cfpose::entry::ParameterSpec;
use nalgebra::DVector;
use num_dual::DualNumCopy;

use crate::normal::Normal;
use crate::objective::{Objective, ObjectiveEntry};

/// Square of an error (tangent norm) below which less error counts as none.
const FLOOR: f64 = 1e-8;

/// Bounds of the logarithm: what is gained far below, and lost far above, says nothing more.
const BOUNDS: [f64; 2] = [-6.0, 2.0];

/// Mean over the dampings of clip(log rho, -6, 2) + rise max(0, log rho^2), rho = |delta + p| / |delta| with the step
/// p = -(A'A + damping diag A'A)^-1 A'r.
struct Contraction {
    dampings: [f64; 2],
    rise: f64,
}

impl Objective for Contraction {
    fn value<D: DualNumCopy<Primitive = f64>>(&self, state: &Normal<'_, D>) -> D {
        let delta = state.delta();
        let before = delta.iter().map(|d| d * d).sum::<f64>() + FLOOR;
        let gradient = DVector::from_fn(state.unknowns(), |i, _| state.gradient(i));
        let mut sum = D::from(0.0);
        for damping in self.dampings {
            let Some(steps) = state.solve(damping, std::slice::from_ref(&gradient)) else {
                sum += BOUNDS[1];
                continue;
            };
            let square = steps[0].iter().zip(delta).fold(D::from(FLOOR), |sum, (p, d)| sum + (*p - *d) * (*p - *d));
            let ratio = (square / before).ln();
            let half = ratio * 0.5;
            sum += if half.re() < BOUNDS[0] {
                D::from(BOUNDS[0])
            } else if half.re() > BOUNDS[1] {
                D::from(BOUNDS[1])
            } else {
                half
            };
            if ratio.re() > 0.0 {
                sum += ratio * self.rise;
            }
        }
        sum * (1.0 / self.dampings.len() as f64)
    }
}

pub(super) const ENTRY: ObjectiveEntry = ObjectiveEntry {
    name: "contraction",
    summary: "logarithm of the share of the error that one damped Gauss-Newton step leaves, mean of two dampings",
    parameters: &[
        ParameterSpec { name: "small", default: "0.001", meaning: "smaller damping, relative to the diagonal" },
        ParameterSpec { name: "large", default: "0.1", meaning: "larger damping" },
        ParameterSpec {
            name: "rise",
            default: "0.1",
            meaning: "extra cost of the logarithm of a squared share above 1",
        },
    ],
    source: "project: the recipe that widened the basin (docs/learned.md); not in the paper",
    build: |parameters| {
        let number = |key| parameters.number(key, "a number of at least 0", |v| v >= 0.0 && v.is_finite());
        Ok(Box::new(Contraction { dampings: [number("small")?, number("large")?], rise: number("rise")? }))
    },
};
