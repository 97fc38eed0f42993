//! Equality-constrained least-squares problems of Hock and Schittkowski: 6, 26, 27, 28, 42, 46, 48 to 52, 77, 79.
//!
//! Source: Hock and Schittkowski, Test Examples for Nonlinear Programming Codes, LNEMS 187 (1981).

use std::sync::Arc;

use num_dual::DualNum;

use super::Reference;
use crate::auto::{AutoFunction, AutoProblem};
use crate::manifold::Euclidean;

/// The objective of a problem as residuals: the published objective is r'r.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Objective {
    /// Number in the collection.
    pub number: usize,
    num_values: usize,
}

/// The equalities of a problem.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Equalities {
    /// Number in the collection.
    pub number: usize,
    num_values: usize,
}

/// Number, start, number of residuals, number of equalities, published least value.
type Line = (usize, &'static [f64], usize, usize, f64);

const TABLE: &[Line] = &[
    (6, &[-1.2, 1.0], 1, 1, 0.0),
    (26, &[-2.6, 2.0, 2.0], 2, 1, 0.0),
    (27, &[2.0, 2.0, 2.0], 2, 1, 0.04),
    (28, &[-4.0, 1.0, 1.0], 2, 1, 0.0),
    (42, &[1.0, 1.0, 1.0, 1.0], 4, 2, 13.857864376269049),
    (46, &[std::f64::consts::FRAC_1_SQRT_2, 1.75, 0.5, 2.0, 2.0], 4, 2, 0.0),
    (48, &[3.0, 5.0, -3.0, 2.0, -2.0], 3, 2, 0.0),
    (49, &[10.0, 7.0, 2.0, -3.0, 0.8], 4, 2, 0.0),
    (50, &[35.0, -31.0, 11.0, 5.0, -5.0], 4, 3, 0.0),
    (51, &[2.5, 0.5, 2.0, -1.0, 0.5], 4, 3, 0.0),
    (52, &[2.0, 2.0, 2.0, 2.0, 2.0], 4, 3, 1859.0 / 349.0),
    (77, &[2.0, 2.0, 2.0, 2.0, 2.0], 5, 2, 0.24150513),
    (79, &[2.0, 2.0, 2.0, 2.0, 2.0], 5, 3, 0.0787768209),
];

/// Return the 13 problems.
///
/// ```
/// use cfpose_optim::testproblems::hock_schittkowski;
/// let all = hock_schittkowski::all();
/// assert_eq!(all.len(), 13);
/// let constraints = all[0].problem.constraints().unwrap();
/// let mut value = [0.0];
/// constraints.values(&[1.0, 1.0], &mut value);
/// assert_eq!(value, [0.0]);
/// ```
pub fn all() -> Vec<Reference> {
    let build = |&(number, start, num_values, num_equalities, optimum): &Line| {
        let objective = Objective { number, num_values };
        let equalities = Equalities { number, num_values: num_equalities };
        let problem =
            AutoProblem::new(objective, Arc::new(Euclidean(start.len()))).with_constraints(equalities, num_equalities);
        Reference {
            name: format!("HS{number}"),
            problem: Box::new(problem),
            start: start.to_vec(),
            optima: vec![optimum],
        }
    };
    TABLE.iter().map(build).collect()
}

impl AutoFunction for Objective {
    fn num_values(&self) -> usize {
        self.num_values
    }

    fn values<T: DualNum<Primitive = f64> + Copy>(&self, x: &[T], r: &mut [T]) {
        let list: &[T] = match self.number {
            6 => &[-x[0] + 1.0],
            26 => &[x[0] - x[1], (x[1] - x[2]).powi(2)],
            27 => &[(x[0] - 1.0) * 0.1, x[1] - x[0] * x[0]],
            28 => &[x[0] + x[1], x[1] + x[2]],
            42 => &[x[0] - 1.0, x[1] - 2.0, x[2] - 3.0, x[3] - 4.0],
            48 => &[x[0] - 1.0, x[1] - x[2], x[3] - x[4]],
            46 | 49 => &[x[0] - x[1], x[2] - 1.0, (x[3] - 1.0).powi(2), (x[4] - 1.0).powi(3)],
            50 => &[x[0] - x[1], x[1] - x[2], (x[2] - x[3]).powi(2), x[3] - x[4]],
            51 => &[x[0] - x[1], x[1] + x[2] - 2.0, x[3] - 1.0, x[4] - 1.0],
            52 => &[x[0] * 4.0 - x[1], x[1] + x[2] - 2.0, x[3] - 1.0, x[4] - 1.0],
            77 => &[x[0] - 1.0, x[0] - x[1], x[2] - 1.0, (x[3] - 1.0).powi(2), (x[4] - 1.0).powi(3)],
            _ => &[x[0] - 1.0, x[0] - x[1], x[1] - x[2], (x[2] - x[3]).powi(2), (x[3] - x[4]).powi(2)],
        };
        r.copy_from_slice(list);
    }
}

impl AutoFunction for Equalities {
    fn num_values(&self) -> usize {
        self.num_values
    }

    fn values<T: DualNum<Primitive = f64> + Copy>(&self, x: &[T], c: &mut [T]) {
        let root = std::f64::consts::SQRT_2;
        let list: &[T] = match self.number {
            6 => &[(x[1] - x[0] * x[0]) * 10.0],
            26 => &[(x[1] * x[1] + 1.0) * x[0] + x[2].powi(4) - 3.0],
            27 => &[x[0] + x[2] * x[2] + 1.0],
            28 => &[x[0] + x[1] * 2.0 + x[2] * 3.0 - 1.0],
            42 => &[x[0] - 2.0, x[2] * x[2] + x[3] * x[3] - 2.0],
            46 => &[x[0] * x[0] * x[3] + (x[3] - x[4]).sin() - 1.0, x[1] + x[2].powi(4) * x[3] * x[3] - 2.0],
            48 => &[x[0] + x[1] + x[2] + x[3] + x[4] - 5.0, x[2] - (x[3] + x[4]) * 2.0 + 3.0],
            49 => &[x[0] + x[1] + x[2] + x[3] * 4.0 - 7.0, x[2] + x[4] * 5.0 - 6.0],
            50 => &[
                x[0] + x[1] * 2.0 + x[2] * 3.0 - 6.0,
                x[1] + x[2] * 2.0 + x[3] * 3.0 - 6.0,
                x[2] + x[3] * 2.0 + x[4] * 3.0 - 6.0,
            ],
            51 => &[x[0] + x[1] * 3.0 - 4.0, x[2] + x[3] - x[4] * 2.0, x[1] - x[4]],
            52 => &[x[0] + x[1] * 3.0, x[2] + x[3] - x[4] * 2.0, x[1] - x[4]],
            77 => &[
                x[0] * x[0] * x[3] + (x[3] - x[4]).sin() - 2.0 * root,
                x[1] + x[2].powi(4) * x[3] * x[3] - (8.0 + root),
            ],
            _ => &[
                x[0] + x[1] * x[1] + x[2].powi(3) - (2.0 + 3.0 * root),
                x[1] - x[2] * x[2] + x[3] + (2.0 - 2.0 * root),
                x[0] * x[4] - 2.0,
            ],
        };
        c.copy_from_slice(list);
    }
}
