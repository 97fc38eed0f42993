//! A first theta by moments: means of waves over the regions, area elements, and weights of what is seen.

use std::sync::Arc;

use cfpose::block::Transform;
use cfpose::problem::MomentProblem;
use cfpose::{BuildContext, Execution, Model, Points};
use cfpose_optim::solvers::LevenbergMarquardt;
use cfpose_optim::{Control, Solver, Stopping};

use super::mapper::as_model_takes;
use super::pattern::Pattern;
use super::registrar::Registrar;
use super::seen::{Seen, Visibility};
use super::view::View;

/// Steps of the coarse stages and of the last one.
const STEPS: [usize; 3] = [15, 15, 10];

/// Directions and shares of the half planes that are left out, and how many of the fits are kept.
const DIRECTIONS: u32 = 12;
const PARTS: [f64; 3] = [0.1, 0.2, 0.3];
const KEPT: usize = 6;

impl Registrar {
    /// Match the means of waves over both regions from a start, coarse ones first; return theta and the squared norm of the last residual.
    ///
    /// With `seen` the source counts as far as the frame can show it ([`View::partly`]), else as if the frame were whole. `None` where the
    /// solver finds no finite theta.
    pub fn by_moments(&self, pattern: &Pattern, view: &View, start: &[f64], seen: bool) -> Option<(Vec<f64>, f64)> {
        let partly = view.partly.as_ref().filter(|_| seen);
        let model = self.region_model(partly.map(|(visibility, _)| visibility))?;
        let targets = partly.map_or(&view.points, |(_, points)| points);
        let transform = spread_of(&targets[0]);
        let mut found = (start.to_vec(), f64::INFINITY);
        for stage in 0..self.families.len() {
            let fine = usize::from(stage + 1 == self.families.len());
            let sets = [&pattern.points[fine], &targets[fine]];
            found = self.match_means(&model, sets, transform, stage, &found.0)?;
        }
        Some(found)
    }

    /// Leave half planes of the reference out and match the rest; return what fits best.
    pub(super) fn by_parts(&self, pattern: &Pattern, view: &View, start: &[f64]) -> Vec<Vec<f64>> {
        let Some(model) = self.region_model(None) else { return Vec::new() };
        let (source, target) = (&pattern.points[0], &view.points[0]);
        let transform = spread_of(target);
        let mut found = Vec::new();
        for direction in 0..DIRECTIONS {
            let (sine, cosine) = (f64::from(direction) / f64::from(DIRECTIONS) * std::f64::consts::TAU).sin_cos();
            let along = |k: usize| cosine * source.column(0)[k] + sine * source.column(1)[k];
            let mut order: Vec<usize> = (0..source.len()).collect();
            order.sort_by(|a, b| along(*a).total_cmp(&along(*b)));
            for share in PARTS {
                let kept = &order[(share * order.len() as f64) as usize..];
                let Ok(part) = source.select(kept) else { continue };
                let coarse = self.match_means(&model, [&part, target], transform, 0, start);
                let fit = coarse.and_then(|(theta, _)| self.match_means(&model, [&part, target], transform, 1, &theta));
                found.extend(fit.filter(|(theta, _)| self.is_plausible(pattern, theta)));
            }
        }
        found.sort_by(|a, b| a.1.total_cmp(&b.1));
        found.into_iter().take(KEPT).map(|(theta, _)| theta).collect()
    }

    pub(super) fn region_model(&self, visibility: Option<&Arc<Visibility>>) -> Option<Arc<Model>> {
        let mut built = self.registry.model(&self.region_model, &BuildContext::default()).ok()?;
        if let Some(visibility) = visibility {
            built.source = Box::new(Seen { map: built.source, visibility: Arc::clone(visibility) });
        }
        Some(Arc::new(built))
    }

    /// Match the means of one stage's waves over two sets.
    fn match_means(
        &self,
        model: &Arc<Model>,
        [source, target]: [&Points; 2],
        transform: Transform,
        stage: usize,
        theta: &[f64],
    ) -> Option<(Vec<f64>, f64)> {
        let (source, target) = (as_model_takes(model, source).ok()?, as_model_takes(model, target).ok()?);
        let family = Arc::clone(&self.families[stage]);
        let problem = MomentProblem::new(Arc::clone(model), family, transform, &source, &target, Execution::default())
            .with_model_manifold(self.manifold_at(theta));
        let stopping = Stopping {
            max_iterations: STEPS[stage],
            cost_tolerance: Some(1e-9),
            step_tolerance: Some(1e-8),
            ..Stopping::default()
        };
        let mut control = Control { stopping, ..Control::default() };
        let outcome = LevenbergMarquardt::default().solve(&problem, theta, &mut control).ok()?;
        outcome.cost.is_finite().then_some((outcome.theta, 2.0 * outcome.cost))
    }
}

/// Return the normalisation of the feature space: mean 0, and 1 for twice the root mean square distance from it.
pub(super) fn spread_of(points: &Points) -> Transform {
    let (mean, covariance) = (points.mean(), points.covariance());
    let scale = 0.5 / (covariance[0][0] + covariance[1][1]).max(1e-300).sqrt();
    Transform::new([mean[0], mean[1], 0.0], [[scale, 0.0, 0.0], [0.0, scale, 0.0], [0.0, 0.0, 1.0]])
}
