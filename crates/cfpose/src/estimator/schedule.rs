//! Coarse to fine: small random subsets first, all points last.
//!
//! Far from the solution a step is worth no more than a rough direction, and a subset gives it at a fraction of the cost.
//! The next subset is so large that the sampling error of its solution lies below the step that was just taken.

use cfpose_optim::manifold::norm;
use cfpose_optim::problem::LeastSquares;

use super::solve::Runner;
use super::stage::ReadyStage;
use super::workbench::of_side;
use crate::distances::sampling::thin;
use crate::error::{Error, Side};
use crate::geometry::linalg::invert;
use crate::problem::MomentProblem;
use crate::statistics::{Randomness, feature_covariance};
use crate::streams::stream;

impl ReadyStage {
    /// Solve on growing subsets of both sides; returns theta where all points should begin.
    pub fn coarse_to_fine(&self, start: &[f64], runner: &mut Runner<'_, '_>) -> Result<Vec<f64>, Error> {
        let (seed, criteria) = (runner.parts.settings.seed, &runner.parts.criteria);
        let (source, target) = (&self.sides.source, &self.sides.target);
        let full = source.len().max(target.len());
        let (mut theta, mut count) = (start.to_vec(), criteria.first_subset.max(2));
        while 2 * count <= full {
            let mut rng = stream(seed, &format!("subset-{count}"));
            let source = thin(source, count, &mut rng).map_err(of_side(Side::Source))?;
            let target = thin(target, count, &mut rng).map_err(of_side(Side::Target))?;
            let kappa = (source.len() as f64).recip() + (target.len() as f64).recip();
            let problem = self.problem_on(runner.parts, &source, &target);
            let outcome = runner.run(&problem, &theta, self.solver.as_ref())?;
            if !outcome.usable() {
                break;
            }
            let mut step = vec![0.0; problem.manifold().tangent()];
            problem.manifold().local(&theta, &outcome.theta, &mut step);
            theta.clone_from(&outcome.theta);
            let Some(error) = sampling_error(&problem, &theta, kappa, seed) else { break };
            // error ~ count^(-1/2): half the step needs 4 (error / step)^2 times as many points.
            let growth = 4.0 * (error / norm(&step).max(f64::MIN_POSITIVE)).powi(2);
            let [least, most] = criteria.subset_growth;
            count = (count as f64 * growth.clamp(least, most)) as usize;
        }
        Ok(theta)
    }
}

/// Return the standard deviation of theta (tangent norm) that the choice of the points causes: A S A', A = (J'J)^-1 J'.
fn sampling_error(problem: &MomentProblem, theta: &[f64], kappa: f64, seed: u64) -> Option<f64> {
    let (residual, jacobian) = problem.unweighted(theta, true);
    let (features, m) = (problem.num_features(), problem.manifold().tangent());
    debug_assert!(residual.len() >= features);
    let randomness = Randomness { noise: [[0.0; 3]; 3], kappa, num_target: 1.0 };
    let covariance = feature_covariance(problem, theta, &randomness, seed).ok()?;
    let normal: Vec<f64> =
        (0..m * m).map(|at| (0..features).map(|i| jacobian[i * m + at / m] * jacobian[i * m + at % m]).sum()).collect();
    let inverse = invert(m, &normal)?;
    let mut variance = 0.0;
    for j in 0..m {
        let row: Vec<f64> =
            (0..features).map(|i| (0..m).map(|k| inverse[j * m + k] * jacobian[i * m + k]).sum()).collect();
        for (a, left) in row.iter().enumerate() {
            let product: f64 = row.iter().enumerate().map(|(b, right)| covariance[a * features + b] * right).sum();
            variance += left * product;
        }
    }
    variance.is_finite().then(|| variance.max(0.0).sqrt())
}
