//! How far outliers and thinning in one place move theta.

use cfpose::entry::ParameterSpec;
use nalgebra::DVector;
use num_dual::DualNumCopy;

use crate::normal::Normal;
use crate::objective::{Objective, ObjectiveEntry, Perturbations};

/// Mean over outliers and cuts u of log(1 + |(A'A)^-1 A'u|^2 / scale^2) / 2: the influence function of theta, large values damped.
struct Influence {
    outliers: usize,
    cuts: usize,
    scale: f64,
}

impl Objective for Influence {
    fn value<D: DualNumCopy<Primitive = f64>>(&self, state: &Normal<'_, D>) -> D {
        let count = self.outliers + self.cuts;
        // Halves, which another objective may want, come first.
        let first = state.perturbations() - count;
        let pushes: Vec<_> =
            (first..first + count).map(|k| DVector::from_fn(state.unknowns(), |i, _| state.push(i, k))).collect();
        let Some(moves) = state.solve(0.0, &pushes) else { return D::from(0.0) };
        let mut sum = D::from(0.0);
        for column in &moves {
            let square = column.iter().fold(D::from(0.0), |sum, v| sum + *v * *v);
            sum += (square * self.scale.powi(-2) + 1.0).ln() * 0.5;
        }
        sum * (1.0 / count as f64)
    }

    fn perturbations(&self) -> Perturbations {
        Perturbations { halves: 0, outliers: self.outliers, cuts: self.cuts }
    }
}

pub(super) const ENTRY: ObjectiveEntry = ObjectiveEntry {
    name: "influence",
    summary: "how far an outlier, or thinning in one place, moves theta",
    parameters: &[
        ParameterSpec { name: "outliers", default: "4", meaning: "outliers per state, 1 to 16" },
        ParameterSpec { name: "cuts", default: "4", meaning: "sides of random planes per state, 0 to 16" },
        ParameterSpec { name: "scale", default: "0.1", meaning: "size of a move that counts, tangent norm" },
    ],
    source: "influence function (Hampel 1974) of the moment estimator with weight identity; project",
    build: |parameters| {
        let scale = parameters.number("scale", "a number above 0", |v| v > 0.0 && v.is_finite())?;
        let (outliers, cuts) = (parameters.count("outliers", 1, 16)?, parameters.count("cuts", 0, 16)?);
        Ok(Box::new(Influence { outliers, cuts, scale }))
    },
};
