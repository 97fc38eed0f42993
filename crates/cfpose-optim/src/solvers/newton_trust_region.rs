//! Newton's method in a trust region, with the exact Hessian.

use crate::descent::region::RadiusSearch;
use crate::descent::{Model, Proposal, StepRule, accept, descend};
use crate::entry::ParameterSpec;
use crate::linear::symmetric_eigen;
use crate::manifold::norm;
use crate::outcome::Outcome;
use crate::problem::LeastSquares;
use crate::session::run;
use crate::solver::{Control, Needs, SolveError, Solver, SolverEntry};

/// Minimise by steps that minimise `g'd + 1/2 d'H d` within `norm(D d) <= radius`, H the exact Hessian
/// `J'J + sum_i r_i Hess(r_i)` along the retraction.
///
/// The second derivatives come from the problem's curvature (second-order dual numbers through the same code as the
/// residual). Converges quadratically where the residual at the solution is large and Gauss-Newton only linearly; leaves
/// saddle points by directions of negative curvature. Radius and tests are those of [`crate::solvers::TrustRegion`], D is the
/// running maximum of the column norms of J and of a thousandth of the roots of the diagonal of H.
///
/// Source: More and Sorensen, Computing a trust region step, SIAM J. Sci. Stat. Comput. 4 (1983); here by the
/// eigenvalues of the scaled Hessian, since m is small.
///
/// ```
/// use cfpose_optim::solvers::NewtonTrustRegion;
/// use cfpose_optim::testproblems::Rosenbrock;
/// use cfpose_optim::{Control, Solver};
/// let outcome = NewtonTrustRegion::default().solve(&Rosenbrock, &[-1.2, 1.0], &mut Control::default()).unwrap();
/// assert!((outcome.theta[0] - 1.0).abs() < 1e-9 && outcome.counts.curvatures > 0);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NewtonTrustRegion {
    /// First radius relative to the scaled size of theta.
    pub initial_radius: f64,
    /// A trial with a gain ratio above this is accepted.
    pub accept: f64,
}

impl Default for NewtonTrustRegion {
    fn default() -> Self {
        Self { initial_radius: 1.0, accept: 1e-4 }
    }
}

impl Solver for NewtonTrustRegion {
    fn name(&self) -> &'static str {
        ENTRY.name
    }

    fn needs(&self) -> Needs {
        Needs { jacobian: true, curvature: true, bounds: true, ..Needs::default() }
    }

    fn solve(
        &self,
        problem: &dyn LeastSquares,
        start: &[f64],
        control: &mut Control<'_>,
    ) -> Result<Outcome, SolveError> {
        run(self.name(), self.needs(), problem, start, control, |session, start| {
            let mut search = RadiusSearch { initial: self.initial_radius, growth: 2.0, accept: self.accept };
            descend(session, start, &mut ExactHessian::default(), &mut search)
        })
    }
}

/// The exact step in the eigenbasis of the scaled Hessian D^-1 H D^-1.
#[derive(Debug, Default)]
struct ExactHessian {
    /// Eigenvalues, smallest first, and eigenvectors (m x m, row by row, in columns); empty when there are none.
    values: Vec<f64>,
    vectors: Vec<f64>,
    /// Scaled gradient in the eigenbasis.
    gradient: Vec<f64>,
}

impl StepRule for ExactHessian {
    fn needs_curvature(&self) -> bool {
        true
    }

    fn prepare(&mut self, model: &Model) {
        let m = model.cols;
        let mut hessian = model.curvature.clone();
        hessian.resize(m * m, 0.0);
        for row in model.jacobian.chunks_exact(m.max(1)) {
            for j in 0..m {
                for l in 0..m {
                    hessian[j * m + l] += row[j] * row[l];
                }
            }
        }
        for j in 0..m {
            for l in 0..m {
                hessian[j * m + l] /= model.scaling[j] * model.scaling[l];
            }
        }
        (self.values, self.vectors) = symmetric_eigen(m, &hessian).unwrap_or_default();
        let along = |i: usize| (0..m).map(|j| self.vectors[j * m + i] * model.gradient[j] / model.scaling[j]).sum();
        self.gradient = (0..self.values.len()).map(along).collect();
    }

    fn step(&mut self, model: &Model, radius: f64, step: &mut [f64]) -> Option<Proposal> {
        let m = model.cols;
        if self.values.len() != m || m == 0 {
            return None;
        }
        let (coordinates, full) = self.region_step(radius);
        for j in 0..m {
            let scaled: f64 = (0..m).map(|i| self.vectors[j * m + i] * coordinates[i]).sum();
            step[j] = scaled / model.scaling[j];
        }
        let terms = self.gradient.iter().zip(&self.values).zip(&coordinates);
        let predicted = -terms.map(|((g, v), c)| g * c + 0.5 * v * c * c).sum::<f64>();
        let finite = step.iter().all(|d| d.is_finite());
        finite.then(|| Proposal { predicted, scaled_norm: model.scaled_norm(step), full })
    }
}

impl ExactHessian {
    /// Return the minimiser in the eigenbasis: `-g_i / (value_i + shift)` with the least shift that keeps it in the region,
    /// and whether it is the unrestricted Newton step.
    fn region_step(&self, radius: f64) -> (Vec<f64>, bool) {
        let largest = self.values.iter().fold(0.0_f64, |a, v| a.max(v.abs()));
        let floor = largest * f64::EPSILON * self.values.len() as f64;
        let at = |shift: f64| -> Vec<f64> {
            let entry = |(g, v): (&f64, &f64)| if *g == 0.0 { 0.0 } else { -g / (v + shift) };
            self.gradient.iter().zip(&self.values).map(entry).collect()
        };
        let lowest = self.values[0];
        if lowest > floor {
            let newton = at(0.0);
            if norm(&newton) <= radius {
                return (newton, true);
            }
        }
        // The shift lies above -lowest; norm(step) falls from there on.
        let mut low = (-lowest).max(0.0);
        let mut high = low + norm(&self.gradient) / radius + floor;
        let base = low;
        if norm(&at(low + floor)) <= radius {
            return (self.hard_case(at(low + floor), radius), lowest >= -floor);
        }
        for _ in 0..200 {
            let middle = 0.5 * (low + high);
            if middle <= low || middle >= high || (high - low) <= 1e-12 * (high - base) {
                break;
            }
            if norm(&at(middle)) > radius { low = middle } else { high = middle }
        }
        (at(high), false)
    }

    /// Go on to the boundary along the eigenvector of the lowest eigenvalue where the gradient has no part along it
    /// ("hard case"); a positive semidefinite Hessian needs no such move.
    fn hard_case(&self, mut step: Vec<f64>, radius: f64) -> Vec<f64> {
        if self.values[0] < 0.0 {
            let others: f64 = step[1..].iter().map(|s| s * s).sum();
            step[0] = (radius * radius - others).max(0.0).sqrt().copysign(-self.gradient[0]);
        }
        step
    }
}

/// The line of the solver table.
pub const ENTRY: SolverEntry = SolverEntry {
    name: "newton-trust-region",
    summary: "Newton's method in a trust region with the exact Hessian by automatic differentiation",
    parameters: &[
        ParameterSpec {
            name: "initial-radius",
            default: "1",
            meaning: "first radius relative to the scaled size of theta, > 0",
        },
        ParameterSpec {
            name: "accept",
            default: "1e-4",
            meaning: "least gain ratio of an accepted trial, 0 <= . < 1/4",
        },
    ],
    source: "More and Sorensen 1983",
    build: |parameters| {
        Ok(Box::new(NewtonTrustRegion {
            initial_radius: parameters.number("initial-radius", "a number above 0", |v| v.is_finite() && v > 0.0)?,
            accept: accept(parameters)?,
        }))
    },
};
