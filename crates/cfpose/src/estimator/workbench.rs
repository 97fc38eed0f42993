//! Where stages are made ready: models and sides that several stages ask for are built once.

use std::sync::{Arc, OnceLock};

use cfpose_kernel::points::{Points, PointsError};

use super::Parts;
use super::pipeline::{NoiseModel, Stage};
use super::stage::ReadyStage;
use crate::distances::sampling::{draw, stray, thin};
use crate::entry::BuildContext;
use crate::error::{Error, Side};
use crate::model::Model;
use crate::problem::{Sides, adapt};
use crate::streams::stream;

/// Point sets of an estimate, as the files hold them or a part of that.
#[derive(Clone)]
pub(super) struct Data {
    pub source: Arc<Points>,
    pub target: Arc<Points>,
    /// Rows of the files (from 0) that are left, `None` for all.
    pub kept_source: Option<Arc<Vec<usize>>>,
    pub kept_target: Option<Arc<Vec<usize>>>,
    /// Source that models are built for: one with control points among the points means others by theta on another source.
    model_source: Arc<Points>,
}

impl Data {
    /// Take all rows.
    pub fn whole(source: Arc<Points>, target: Arc<Points>) -> Self {
        Self { model_source: Arc::clone(&source), source, target, kept_source: None, kept_target: None }
    }

    /// Leave the stray points of both sides out.
    pub fn without_stray(&self) -> Result<Self, Error> {
        let rest = |points: &Points| -> Option<Vec<usize>> {
            let stray = stray(points);
            (!stray.is_empty()).then(|| (0..points.len()).filter(|k| stray.binary_search(k).is_err()).collect())
        };
        self.keep(rest(&self.source).as_deref(), rest(&self.target).as_deref())
    }

    /// Take a random choice of at most `most` points of each side, by their weights; theta means the same on it.
    pub fn thinned(&self, most: usize, seed: u64) -> Result<Self, PointsError> {
        let mut rng = stream(seed, "explored");
        let mut choose = |points: &Arc<Points>| match points.len() <= most {
            true => Ok(Arc::clone(points)),
            false => draw(points, most, &mut rng).map(Arc::new),
        };
        let (source, target) = (choose(&self.source)?, choose(&self.target)?);
        Ok(Self { model_source: Arc::clone(&self.model_source), ..Self::whole(source, target) })
    }

    /// Keep some rows (indices into what is left), `None` for all of a side.
    pub fn keep(&self, source: Option<&[usize]>, target: Option<&[usize]>) -> Result<Self, Error> {
        let mut kept = self.clone();
        let compose = |before: &Option<Arc<Vec<usize>>>, rows: &[usize]| match before {
            Some(before) => Arc::new(rows.iter().map(|k| before[*k]).collect::<Vec<_>>()),
            None => Arc::new(rows.to_vec()),
        };
        if let Some(rows) = source {
            kept.source = Arc::new(self.source.select(rows).map_err(of_side(Side::Source))?);
            kept.model_source = Arc::clone(&kept.source);
            kept.kept_source = Some(compose(&self.kept_source, rows));
        }
        if let Some(rows) = target {
            kept.target = Arc::new(self.target.select(rows).map_err(of_side(Side::Target))?);
            kept.kept_target = Some(compose(&self.kept_target, rows));
        }
        Ok(kept)
    }
}

/// Name the side of a fault in points.
pub(super) fn of_side(side: Side) -> impl Fn(PointsError) -> Error {
    move |problem| Error::Points { side, problem }
}

/// What the stages of one pipeline share while they are built: models and sides that several of them ask for.
pub(super) struct Workbench<'a> {
    parts: &'a Parts,
    data: &'a Data,
    models: Vec<(String, Arc<Model>)>,
    sides: Vec<(SidesKey, Sides)>,
}

/// What decides the sides of a stage: model, normaliser, points of each side at most.
type SidesKey = (String, String, [usize; 2]);

impl<'a> Workbench<'a> {
    /// Build stages on these points.
    pub fn new(parts: &'a Parts, data: &'a Data) -> Self {
        Self { parts, data, models: Vec::new(), sides: Vec::new() }
    }

    fn context(&self) -> BuildContext<'a> {
        BuildContext {
            seed: self.parts.settings.seed,
            source: Some(&self.data.model_source),
            ..BuildContext::default()
        }
    }

    fn model(&mut self, spec: &str) -> Result<Arc<Model>, Error> {
        if let Some((_, model)) = self.models.iter().find(|(known, _)| known == spec) {
            return Ok(Arc::clone(model));
        }
        let model = Arc::new(self.parts.registry.model(spec, &self.context())?);
        self.models.push((spec.to_string(), Arc::clone(&model)));
        Ok(model)
    }

    /// Return the sides of a stage: its points, thinned where it asks for that.
    fn sides(&mut self, spec: &str, stage: &Stage, model: &Arc<Model>, limits: [usize; 2]) -> Result<Sides, Error> {
        let normaliser = stage.normaliser.as_deref().or(model.normaliser).unwrap_or("paper");
        let key = (spec.to_string(), normaliser.to_string(), limits);
        if let Some((_, sides)) = self.sides.iter().find(|(known, _)| *known == key) {
            return Ok(sides.clone());
        }
        let (name, settings) = (&self.parts.settings.model, &self.parts.settings);
        let mut rng = stream(settings.seed, "thin");
        let mut choose = |side, points: Arc<Points>, limit: usize| -> Result<Arc<Points>, Error> {
            if limit == 0 || points.len() <= limit {
                return Ok(points);
            }
            thin(&points, limit, &mut rng).map(Arc::new).map_err(of_side(side))
        };
        if let Some(key) = model.source.attribute().filter(|key| self.data.source.attribute(key).is_none()) {
            let problem = format!("model `{name}` needs the attribute `{key}` of every source point");
            return Err(Error::Unsupported(problem));
        }
        let source =
            choose(Side::Source, adapt(Side::Source, name, model.source_points, &self.data.source)?, limits[0])?;
        let target =
            choose(Side::Target, adapt(Side::Target, name, model.target_points, &self.data.target)?, limits[1])?;
        let built = self.parts.registry.normaliser(normaliser)?;
        let (model, reference) = (Arc::clone(model), &self.parts.reference);
        let sides = Sides::new(model, built.as_ref(), source, target, reference, &self.parts.execution)?;
        self.sides.push((key, sides.clone()));
        Ok(sides)
    }

    /// Build a stage.
    pub fn stage(&mut self, stage: &Stage) -> Result<ReadyStage, Error> {
        let (parts, data) = (self.parts, self.data);
        let spec = stage.model.clone().unwrap_or_else(|| parts.settings.model.clone());
        let model = self.model(&spec)?;
        let weighting = parts.registry.weighting(&stage.weighting)?;
        // A random choice of points has a sampling error of its own: fine for a start, not for the statistics.
        let exact = weighting.has_statistic() || stage.noise != NoiseModel::None;
        let limit = |points: &Points, limit: usize| if exact && !points.is_in_curve_order() { 0 } else { limit };
        let limits = [limit(&data.source, stage.source_points), limit(&data.target, stage.target_points)];
        let sides = self.sides(&spec, stage, &model, limits)?;
        let all_source = match limits[0] {
            0 => Arc::clone(&sides.source),
            _ => adapt(Side::Source, &parts.settings.model, model.source_points, &data.source)?,
        };
        let family = sides.family(&self.context(), |context| parts.registry.family(&stage.features, context))?;
        let problem = sides.problem(&family, stage.noise.into(), parts.manifold.as_ref());
        let solver = parts.settings.solver_of(stage, &model).to_string();
        Ok(ReadyStage {
            stage: Stage {
                model: Some(spec),
                normaliser: stage.normaliser.clone().or(model.normaliser.map(str::to_string)).or(Some("paper".into())),
                solver: Some(solver.clone()),
                ..stage.clone()
            },
            solver: parts.registry.solver(&solver)?,
            weighting,
            problem,
            family,
            sides,
            all_source,
            all_lifted: OnceLock::new(),
            target_tree: OnceLock::new(),
            num_source: effective(&data.source),
            num_target: effective(&data.target),
            counts: [data.target.len(), data.source.len()],
        })
    }
}

/// Return (sum w)^2 / sum w^2, the number of equally weighted points with the same variance of a mean.
fn effective(points: &Points) -> f64 {
    let (sum, squares) = points.weights().iter().fold((0.0, 0.0), |(s, t), w| (s + w, t + w * w));
    sum * sum / squares
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Estimator, Execution, Registry, Settings};

    #[test]
    fn theta_means_the_same_on_a_part() {
        // The control points of this warp are the farthest points of a disk: others on every part of it.
        let rows: Vec<[f64; 2]> = (0..2000)
            .map(|k| {
                let (angle, radius) = (2.4 * f64::from(k), (f64::from(k) / 2000.0).sqrt());
                [radius * angle.cos(), radius * angle.sin()]
            })
            .collect();
        let points = Points::from_rows(&rows).unwrap();
        let settings = Settings::preset("auto", "thin-plate2[points=5]").unwrap();
        let estimator =
            Estimator::new(&Registry::default(), &settings, &points, &points, &Execution::default()).unwrap();
        let (all, stage) = (&estimator.stages.data, &estimator.pipeline.stages[0]);
        let part = all.thinned(300, 1).unwrap();
        let theta: Vec<f64> = (0..10).map(|k| f64::from(k).sin()).collect();
        let mapped = |data: &Data| {
            let stage = Stage { source_points: 0, ..stage.clone() };
            Workbench::new(&estimator.parts, data).stage(&stage).unwrap().mapped_source(&theta).unwrap()
        };
        let (of_all, of_part) = (mapped(all), mapped(&part));
        for k in 0..part.source.len() {
            let same = (0..all.source.len()).find(|j| all.source.point(*j) == part.source.point(k)).unwrap();
            assert!((0..2).all(|d| (of_all.point(same)[d] - of_part.point(k)[d]).abs() < 1e-12), "{k}");
        }
    }
}
