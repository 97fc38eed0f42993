//! A first theta by moments: means of waves over the regions, area elements, and weights of what is seen.

use std::sync::Arc;

use cfpose::block::Transform;
use cfpose::problem::MomentProblem;
use cfpose::{BuildContext, Execution, Points};
use cfpose_optim::solvers::LevenbergMarquardt;
use cfpose_optim::{Control, Solver, Stopping};

use super::mapper::as_model_takes;
use super::pattern::Pattern;
use super::registrar::Registrar;
use super::seen::Seen;
use super::view::View;

/// Steps of the coarse stages and of the last one.
const STEPS: [usize; 3] = [15, 15, 10];

impl Registrar {
    /// Match the means of waves over both regions from a start, coarse ones first; return theta and the squared norm of the last residual.
    ///
    /// With `seen` the source counts as far as the frame can show it ([`View::partly`]), else as if the frame were whole. `None` where the
    /// solver finds no finite theta.
    pub fn by_moments(&self, pattern: &Pattern, view: &View, start: &[f64], seen: bool) -> Option<(Vec<f64>, f64)> {
        let partly = view.partly.as_ref().filter(|_| seen);
        let targets = partly.map_or(&view.points, |(_, points)| points);
        let mut built = self.registry.model(&self.region_model, &BuildContext::default()).ok()?;
        if let Some((visibility, _)) = partly {
            built.source = Box::new(Seen { map: built.source, visibility: Arc::clone(visibility) });
        }
        let model = Arc::new(built);
        let manifold = self.manifold_at(start);
        let transform = spread_of(&targets[0]);
        let mut theta = start.to_vec();
        let mut cost = f64::INFINITY;
        for (stage, family) in self.families.iter().enumerate() {
            let fine = usize::from(stage + 1 == self.families.len());
            let source = as_model_takes(&model, &pattern.points[fine]).ok()?;
            let target = as_model_takes(&model, &targets[fine]).ok()?;
            let (model, family) = (Arc::clone(&model), Arc::clone(family));
            let problem = MomentProblem::new(model, family, transform, &source, &target, Execution::default())
                .with_model_manifold(Arc::clone(&manifold));
            let stopping = Stopping {
                max_iterations: STEPS[stage],
                cost_tolerance: Some(1e-9),
                step_tolerance: Some(1e-8),
                ..Stopping::default()
            };
            let mut control = Control { stopping, ..Control::default() };
            let outcome = LevenbergMarquardt::default().solve(&problem, &theta, &mut control).ok()?;
            if !outcome.cost.is_finite() {
                return None;
            }
            (theta, cost) = (outcome.theta, 2.0 * outcome.cost);
        }
        Some((theta, cost))
    }
}

/// Return the normalisation of the feature space: mean 0, and 1 for twice the root mean square distance from it.
fn spread_of(points: &Points) -> Transform {
    let (mean, covariance) = (points.mean(), points.covariance());
    let scale = 0.5 / (covariance[0][0] + covariance[1][1]).max(1e-300).sqrt();
    Transform::new([mean[0], mean[1], 0.0], [[scale, 0.0, 0.0], [0.0, scale, 0.0], [0.0, 0.0, 1.0]])
}
