//! The variance of theta that the sampling error of the means causes.

use cfpose::entry::ParameterSpec;
use nalgebra::DVector;
use num_dual::DualNumCopy;

use crate::normal::Normal;
use crate::objective::{Objective, ObjectiveEntry, Perturbations};

/// Smallest variance that counts: a variance of 0 has no logarithm.
const FLOOR: f64 = 1e-12;

/// 1/2 log of the mean over halves u of |(A'A)^-1 A'u|^2: the trace of the asymptotic covariance of theta with weight identity, up to
/// the number of points.
struct Covariance {
    halves: usize,
}

impl Objective for Covariance {
    fn value<D: DualNumCopy<Primitive = f64>>(&self, state: &Normal<'_, D>) -> D {
        let pushes: Vec<_> =
            (0..self.halves).map(|k| DVector::from_fn(state.unknowns(), |i, _| state.push(i, k))).collect();
        let Some(moves) = state.solve(0.0, &pushes) else { return D::from(0.0) };
        let sum = moves
            .iter()
            .flat_map(|v| v.iter())
            .fold(D::from(FLOOR), |sum, v| sum + *v * *v * (1.0 / self.halves as f64));
        sum.ln() * 0.5
    }

    fn perturbations(&self) -> Perturbations {
        Perturbations { halves: self.halves, ..Perturbations::default() }
    }
}

pub(super) const ENTRY: ObjectiveEntry = ObjectiveEntry {
    name: "covariance",
    summary: "logarithm of the standard deviation of theta that the sampling of the target causes",
    parameters: &[ParameterSpec {
        name: "halves",
        default: "8",
        meaning: "random halves of the target per state, 1 to 32",
    }],
    source: "asymptotic covariance of the generalised method of moments with weight identity (Hansen 1982); project",
    build: |parameters| Ok(Box::new(Covariance { halves: parameters.count("halves", 1, 32)? })),
};
