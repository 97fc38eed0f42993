//! The 35 problems of More, Garbow and Hillstrom with their published optima, and bounded variants.
//!
//! Source: More, Garbow and Hillstrom, Testing unconstrained optimization software, ACM TOMS 7 (1981); bounds and bounded
//! optima: Gay, A trust-region approach to linearly constrained optimization, LNM 1066 (1984).
//! *Differs from source*: number 11 has the sign that the printed formula lacks, `|y_i - x_2|`; its bounded variant is left
//! out, since the published bounded optimum belongs to neither reading of the formula.

use std::sync::Arc;

use num_dual::DualNum;

use super::Reference;
use crate::auto::{AutoFunction, AutoProblem};
use crate::manifold::Euclidean;

mod data;
mod fixed;
mod scalable;

/// One problem: its number in the collection, n parameters and m residuals.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MoreGarbowHillstrom {
    /// Number, 1 to 35.
    pub number: usize,
    /// Number of parameters n.
    pub num_parameters: usize,
    /// Number of residuals m.
    pub num_residuals: usize,
}

impl AutoFunction for MoreGarbowHillstrom {
    fn num_values(&self) -> usize {
        self.num_residuals
    }

    fn values<T: DualNum<Primitive = f64> + Copy>(&self, x: &[T], r: &mut [T]) {
        if self.number < 20 { fixed::values(self.number, x, r) } else { scalable::values(self.number, x, r) }
    }
}

fn reference(number: usize, name: &str, num_residuals: usize, start: Vec<f64>, optima: &[f64]) -> Reference {
    let function = MoreGarbowHillstrom { number, num_parameters: start.len(), num_residuals };
    let problem = AutoProblem::new(function, Arc::new(Euclidean(start.len())));
    Reference { name: format!("{number} {name}"), problem: Box::new(problem), start, optima: optima.to_vec() }
}

/// Return problems 1 to 19 and 20 to 35 at their usual sizes and starts.
///
/// ```
/// use cfpose_optim::testproblems::more_garbow_hillstrom;
/// let all = more_garbow_hillstrom::all();
/// assert!(all.len() >= 35);
/// let mut residual = vec![0.0; 2];
/// all[0].problem.residual(&[1.0, 1.0], &mut residual);
/// assert_eq!(residual, [0.0, 0.0]);
/// ```
pub fn all() -> Vec<Reference> {
    let mut list: Vec<Reference> =
        data::FIXED.iter().map(|p| reference(p.number, p.name, p.num_residuals, p.start.to_vec(), p.optima)).collect();
    list.extend(scalable::all());
    list
}

/// Return the bounded variants of problems 3, 4, 5, 7, 9, 12, 14, 16 and 18.
pub fn bounded() -> Vec<Reference> {
    let build = |b: &data::Boxed| {
        let base = data::FIXED.iter().find(|p| p.number == b.number)?;
        let n = base.start.len();
        let function = MoreGarbowHillstrom { number: b.number, num_parameters: n, num_residuals: b.num_residuals };
        let problem = AutoProblem::new(function, Arc::new(Euclidean(n))).with_bounds(b.lower, b.upper);
        Some(Reference {
            name: format!("{} {}, bounded", b.number, base.name),
            problem: Box::new(problem),
            start: base.start.to_vec(),
            optima: vec![b.optimum],
        })
    };
    data::BOXED.iter().filter_map(build).collect()
}
