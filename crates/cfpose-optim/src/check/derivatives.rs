//! Derivatives of a problem against finite differences along the retraction.

use std::fmt;

use crate::problem::LeastSquares;

/// One derivative: as the problem gives it and as differences say.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EntryCheck {
    /// Row: residual i of a Jacobian, tangent coordinate of a Hessian.
    pub row: usize,
    /// Column: tangent coordinate j.
    pub column: usize,
    /// The problem's value.
    pub given: f64,
    /// The difference quotient.
    pub numeric: f64,
    /// `|given - numeric|` beyond the rounding of the differences, relative to the larger of both and to a thousandth of the
    /// largest entry of that column.
    pub relative_error: f64,
}

/// All derivatives at one point.
#[derive(Debug, Clone, PartialEq)]
pub struct DerivativeReport {
    /// Every entry of the Jacobian, row by row; empty when the problem has none.
    pub jacobian: Vec<EntryCheck>,
    /// Every entry of the curvature `sum_i w_i Hess(r_i)` with w = r, row by row; empty when the problem has none.
    pub curvature: Vec<EntryCheck>,
    /// Largest difference between the residuals of `residual()` and of `jacobian()`, relative to the largest residual.
    pub residual_mismatch: f64,
}

impl DerivativeReport {
    /// Return the largest relative error over all entries, NaN when one of them is NaN.
    pub fn worst(&self) -> f64 {
        let errors = self.jacobian.iter().chain(&self.curvature).map(|e| e.relative_error);
        errors.fold(0.0, |a: f64, e| if a.is_nan() || e.is_nan() { f64::NAN } else { a.max(e) })
    }

    /// Say whether residuals agree and every derivative does to `tolerance`.
    pub fn passes(&self, tolerance: f64) -> bool {
        self.residual_mismatch <= 1e-9 && self.worst() <= tolerance
    }
}

impl fmt::Display for DerivativeReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "residual mismatch {:.3e}, worst relative error {:.3e}", self.residual_mismatch, self.worst())?;
        for (name, entries) in [("jacobian", &self.jacobian), ("curvature", &self.curvature)] {
            let mut sorted: Vec<&EntryCheck> = entries.iter().collect();
            sorted.sort_by(|a, b| b.relative_error.total_cmp(&a.relative_error));
            for e in sorted.into_iter().take(5) {
                let (r, c) = (e.row, e.column);
                writeln!(f, "{name}[{r},{c}]: given {:.9e}, numeric {:.9e}", e.given, e.numeric)?;
            }
        }
        Ok(())
    }
}

/// Compare Jacobian and curvature of a problem at `theta` with central differences along the retraction, extrapolated once
/// (Richardson); good derivatives agree to about 1e-7.
///
/// ```
/// use cfpose_optim::check::check_derivatives;
/// use cfpose_optim::testproblems::Rosenbrock;
/// let report = check_derivatives(&Rosenbrock, &[-1.2, 1.0]);
/// assert!(report.passes(1e-8), "{report}");
/// ```
pub fn check_derivatives(problem: &dyn LeastSquares, theta: &[f64]) -> DerivativeReport {
    let (rows, cols) = (problem.num_residuals(), problem.manifold().tangent());
    let (mut plain, mut residual) = (vec![0.0; rows], vec![0.0; rows]);
    let mut jacobian = vec![f64::NAN; rows * cols];
    problem.residual(theta, &mut plain);
    problem.jacobian(theta, &mut residual, &mut jacobian);
    let largest = plain.iter().fold(f64::MIN_POSITIVE, |a, v| a.max(v.abs()));
    let mismatch = plain.iter().zip(&residual).map(|(a, b)| (a - b).abs() / largest);
    let residual_mismatch = mismatch.fold(0.0, |a: f64, e| if e.is_nan() { f64::NAN } else { a.max(e) });
    let offered = problem.capabilities();
    let mut report = DerivativeReport { jacobian: Vec::new(), curvature: Vec::new(), residual_mismatch };
    if offered.jacobian {
        let numeric = differences(problem, theta, rows, |at, out| problem.residual(at, out));
        report.jacobian = compare(rows, cols, &jacobian, &numeric, &noise(problem, theta, &residual));
    }
    if offered.jacobian && offered.curvature {
        let mut given = vec![f64::NAN; cols * cols];
        problem.curvature(theta, &residual, &mut given);
        let numeric = gradient_differences(problem, theta, &residual);
        let mut gradient = vec![0.0; cols];
        for (row, r) in jacobian.chunks_exact(cols.max(1)).zip(&residual) {
            gradient.iter_mut().zip(row).for_each(|(g, a)| *g += a.abs() * r.abs());
        }
        report.curvature = compare(cols, cols, &given, &numeric, &noise(problem, theta, &gradient));
    }
    report
}

/// Widths of the differences along each tangent coordinate.
fn widths(problem: &dyn LeastSquares, theta: &[f64]) -> Vec<f64> {
    let mut extent = vec![0.0; problem.manifold().tangent()];
    problem.manifold().extent(theta, &mut extent);
    extent.into_iter().map(|e| 1e-4 * if e > 0.0 { e } else { 1.0 }).collect()
}

/// Return the derivative (rows x tangent) of `function(retract(theta, step))` at step 0.
fn differences(
    problem: &dyn LeastSquares,
    theta: &[f64],
    rows: usize,
    function: impl Fn(&[f64], &mut [f64]),
) -> Vec<f64> {
    along_steps(problem, theta, rows, |step, out| {
        let mut moved = theta.to_vec();
        problem.manifold().retract(theta, step, &mut moved);
        function(&moved, out);
    })
}

/// Return the derivative at step 0 of the gradient of `w'r(retract(theta, step))` with respect to the step.
fn gradient_differences(problem: &dyn LeastSquares, theta: &[f64], weights: &[f64]) -> Vec<f64> {
    let (rows, m) = (problem.num_residuals(), problem.manifold().tangent());
    along_steps(problem, theta, m, |step, out| {
        let mut moved = theta.to_vec();
        problem.manifold().retract(theta, step, &mut moved);
        let (mut residual, mut jacobian, mut turn) = (vec![0.0; rows], vec![0.0; rows * m], vec![0.0; m * m]);
        problem.jacobian(&moved, &mut residual, &mut jacobian);
        problem.manifold().differential(theta, step, &mut turn);
        out.fill(0.0);
        for (row, w) in jacobian.chunks_exact(m.max(1)).zip(weights) {
            for a in 0..m {
                for b in 0..m {
                    out[b] += w * row[a] * turn[a * m + b];
                }
            }
        }
    })
}

fn along_steps(
    problem: &dyn LeastSquares,
    theta: &[f64],
    rows: usize,
    function: impl Fn(&[f64], &mut [f64]),
) -> Vec<f64> {
    let m = problem.manifold().tangent();
    let mut out = vec![0.0; rows * m];
    let mut values = vec![0.0; rows];
    for (j, width) in widths(problem, theta).into_iter().enumerate() {
        let mut step = vec![0.0; m];
        for (factor, h) in [(4.0 / 3.0, 0.5 * width), (-1.0 / 3.0, width)] {
            for sign in [1.0, -1.0] {
                step[j] = sign * h;
                function(&step, &mut values);
                for i in 0..rows {
                    out[i * m + j] += factor * sign * values[i] / (2.0 * h);
                }
            }
        }
    }
    out
}

/// Return the rounding of the differences along each tangent coordinate, for function values of this size.
fn noise(problem: &dyn LeastSquares, theta: &[f64], values: &[f64]) -> Vec<f64> {
    let largest = values.iter().fold(0.0_f64, |a, v| a.max(v.abs()));
    widths(problem, theta).into_iter().map(|h| 100.0 * f64::EPSILON * largest / h).collect()
}

/// Compare entry by entry.
fn compare(rows: usize, cols: usize, given: &[f64], numeric: &[f64], noise: &[f64]) -> Vec<EntryCheck> {
    let column = |j: usize| (0..rows).map(|i| numeric[i * cols + j].abs()).fold(0.0, f64::max);
    let floors: Vec<f64> = (0..cols).map(|j| (1e-3 * column(j)).max(1e-12)).collect();
    let entry = |at: usize| {
        let (row, column) = (at / cols, at % cols);
        let (a, b) = (given[at], numeric[at]);
        let excess = (a - b).abs() - noise[column];
        let relative_error = if excess <= 0.0 { 0.0 } else { excess / a.abs().max(b.abs()).max(floors[column]) };
        EntryCheck { row, column, given: a, numeric: b, relative_error }
    };
    (0..rows * cols).map(entry).collect()
}
