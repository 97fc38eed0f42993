//! Bounds and general constraints at a point, linear in the step.

use crate::descent::Model;
use crate::linear::minimum_norm;
use crate::problem::LeastSquares;

/// Violation that restored points must not exceed.
const RESTORED: f64 = 1e-9;

/// An inequality counts as active below this value.
const ACTIVE: f64 = 1e-8;

/// Equalities `c + A d = 0` and inequalities `h + G d >= 0`; bounds are inequalities on ambient coordinates.
#[derive(Debug, Clone, Default)]
pub(crate) struct Linearised {
    pub(crate) num_equalities: usize,
    /// Values, equalities first.
    pub(crate) values: Vec<f64>,
    /// Rows of A, then of G, with m columns each.
    pub(crate) jacobian: Vec<f64>,
    /// Bounded ambient coordinates: index, side (1 for a lower bound, -1 for an upper one), bound.
    bounds: Vec<(usize, f64, f64)>,
    num_general: usize,
}

impl Linearised {
    pub(crate) fn new(problem: &dyn LeastSquares) -> Self {
        let m = problem.manifold().tangent();
        let (num_equalities, num_inequalities) =
            problem.constraints().map_or((0, 0), |c| (c.num_equalities(), c.num_inequalities()));
        let mut bounds = Vec::new();
        if let Some(b) = problem.bounds() {
            for i in 0..b.lower.len().min(b.upper.len()) {
                bounds.extend(b.lower[i].is_finite().then_some((i, 1.0, b.lower[i])));
                bounds.extend(b.upper[i].is_finite().then_some((i, -1.0, b.upper[i])));
            }
        }
        let num_general = num_equalities + num_inequalities;
        let rows = num_general + bounds.len();
        Self { num_equalities, values: vec![0.0; rows], jacobian: vec![0.0; rows * m], bounds, num_general }
    }

    /// Return the number of rows.
    pub(crate) fn len(&self) -> usize {
        self.values.len()
    }

    /// Evaluate values and Jacobian at a point.
    pub(crate) fn linearise(&mut self, problem: &dyn LeastSquares, theta: &[f64]) {
        if self.len() == 0 {
            return;
        }
        let (n, m) = (problem.manifold().ambient(), problem.manifold().tangent());
        let general = self.num_general;
        if let Some(constraints) = problem.constraints() {
            constraints.jacobian(theta, &mut self.values[..general], &mut self.jacobian[..general * m]);
        }
        if !self.bounds.is_empty() {
            let mut basis = vec![0.0; n * m];
            problem.manifold().basis(theta, &mut basis);
            for (k, (i, side, bound)) in self.bounds.iter().enumerate() {
                self.values[general + k] = side * (theta[*i] - bound);
                let row = &mut self.jacobian[(general + k) * m..(general + k + 1) * m];
                row.iter_mut().zip(&basis[i * m..(i + 1) * m]).for_each(|(r, b)| *r = side * b);
            }
        }
    }

    fn violation(&self) -> f64 {
        let excess = |(i, v): (usize, &f64)| {
            let excess = if i < self.num_equalities { v.abs() } else { (-v).max(0.0) };
            if v.is_finite() { excess } else { f64::INFINITY }
        };
        self.values.iter().enumerate().map(excess).fold(0.0, f64::max)
    }

    /// Move a point onto the constraints by Newton steps of least norm(D step) on those that are violated, halved until the
    /// violation falls; say whether it got there.
    pub(crate) fn restore(
        &mut self,
        problem: &dyn LeastSquares,
        theta: &mut [f64],
        scaling: &[f64],
        passes: usize,
    ) -> bool {
        if self.len() == 0 {
            return true;
        }
        let manifold = problem.manifold();
        let m = manifold.tangent();
        let (mut step, mut moved) = (vec![0.0; m], theta.to_vec());
        self.linearise(problem, theta);
        for _ in 0..passes {
            let violation = self.violation();
            if violation == 0.0 || !violation.is_finite() {
                break;
            }
            let wrong: Vec<usize> =
                (0..self.len()).filter(|i| *i < self.num_equalities || self.values[*i] < 0.0).collect();
            let rows: Vec<f64> = wrong.iter().flat_map(|i| self.jacobian[i * m..(i + 1) * m].iter().copied()).collect();
            let rhs: Vec<f64> = wrong.iter().map(|i| -self.values[*i]).collect();
            minimum_norm(wrong.len(), m, &rows, &rhs, scaling, &mut step);
            let mut improved = false;
            for _ in 0..30 {
                manifold.retract(theta, &step, &mut moved);
                self.linearise(problem, &moved);
                if self.violation() < violation {
                    improved = true;
                    break;
                }
                step.iter_mut().for_each(|d| *d *= 0.5);
                if violation <= RESTORED {
                    break;
                }
            }
            if !improved {
                self.linearise(problem, theta);
                break;
            }
            theta.copy_from_slice(&moved);
        }
        self.violation() <= RESTORED
    }

    /// Write the gradient minus its part along the equalities and along those active inequalities that the descent would
    /// leave (multipliers of the right sign).
    pub(crate) fn free_gradient(&self, model: &Model, out: &mut [f64]) {
        let m = model.cols;
        out.copy_from_slice(&model.gradient);
        let mut held: Vec<usize> =
            (0..self.len()).filter(|i| *i < self.num_equalities || self.values[*i] <= ACTIVE).collect();
        // Multipliers y of g = A'y; drop the inequality of the most negative one and solve again.
        while !held.is_empty() {
            let columns = held.len();
            let matrix: Vec<f64> =
                (0..m * columns).map(|at| self.jacobian[held[at % columns] * m + at / columns]).collect();
            let mut multipliers = vec![0.0; columns];
            minimum_norm(m, columns, &matrix, &model.gradient, &vec![1.0; columns], &mut multipliers);
            let worst = (0..columns)
                .filter(|k| held[*k] >= self.num_equalities && multipliers[*k] < 0.0)
                .min_by(|a, b| multipliers[*a].total_cmp(&multipliers[*b]));
            match worst {
                Some(k) => {
                    held.remove(k);
                }
                None => {
                    for j in 0..m {
                        out[j] -= (0..columns).map(|k| matrix[j * columns + k] * multipliers[k]).sum::<f64>();
                    }
                    return;
                }
            }
        }
    }
}
