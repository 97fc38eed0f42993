//! Whether the gradient points away from the truth.

use cfpose::entry::ParameterSpec;
use num_dual::DualNumCopy;

use crate::normal::Normal;
use crate::objective::{Objective, ObjectiveEntry};

/// max(0, least - s) / (1 + |s|), s = delta'A'r / r'r: 1 for a quadratic cost; above 0 everywhere, a path downhill always approaches
/// the truth.
struct StarConvexity {
    least: f64,
}

impl Objective for StarConvexity {
    fn value<D: DualNumCopy<Primitive = f64>>(&self, state: &Normal<'_, D>) -> D {
        let along = state.delta().iter().enumerate().fold(D::from(0.0), |sum, (i, d)| sum + state.gradient(i) * *d);
        let s = along / (state.cost() + f64::MIN_POSITIVE);
        if s.re() >= self.least {
            return D::from(0.0);
        }
        (-s + self.least) / (s.abs() + 1.0)
    }
}

pub(super) const ENTRY: ObjectiveEntry = ObjectiveEntry {
    name: "star-convexity",
    summary: "hinge on delta'A'r / r'r: downhill has to approach the truth",
    parameters: &[ParameterSpec {
        name: "least",
        default: "0.3",
        meaning: "ratio from which nothing is lost; 1: a quadratic",
    }],
    source: "star-convexity (Nesterov and Polyak 2006, section 4); project",
    build: |parameters| {
        let least = parameters.number("least", "a number above 0, at most 1", |v| v > 0.0 && v <= 1.0)?;
        Ok(Box::new(StarConvexity { least }))
    },
};
