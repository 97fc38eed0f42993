//! The preset `auto`: the pipeline of a model, from what the model says about itself.

use cfpose_optim::manifold::Manifold;

use super::pipeline::{NoiseModel, Pipeline, PointsStage, Stage};
use crate::geometry::free::Freedom;
use crate::geometry::theta::BlockKind;
use crate::model::{LinearKind, Model, Relations};

/// Points of each side in the annealed stages: enough for a start of the next stage.
const COARSE_POINTS: usize = 800;

/// Starts about one free angle: 30 degrees apart.
const TURNS: usize = 12;

/// Weighting of the last stage.
pub(super) const WEIGHTED: &str = "two-step";

/// Return the pipeline of a model.
///
/// * A model with an image-plane variant: annealed waves on the unit sphere, then the image plane, where noise is additive.
/// * A fixed target in a space where noise is additive: annealed waves, noise as a parameter, the weighted stage.
/// * Everything else: the features of the model's documented basin from its start strategy, no statistic.
///
/// Where a rotation is free in part, global starts are turns about its free angles.
pub(super) fn pipeline(model: &Model, freedom: Option<&Freedom>) -> Pipeline {
    let whole = of_model(model);
    match (freedom.and_then(Freedom::turns), &whole.global_start) {
        (Some((axes, _)), Some(_)) => {
            let count = if axes.len() < 2 { TURNS } else { TURNS * TURNS };
            let turns = format!("grid[count={count}]");
            let points = whole.points.clone().map(|points| PointsStage { start: Some(turns.clone()), ..points });
            Pipeline { global_start: Some(turns), points, keep: whole.keep.max(4), ..whole }
        }
        _ => whole,
    }
}

/// The printed method: `trig18`, weighting `identity`, one solve.
pub(super) fn printed(max_iterations: usize) -> Stage {
    Stage { iterations: max_iterations, ..Stage::new("only", "trig18") }
}

fn of_model(model: &Model) -> Pipeline {
    if let Some(relations) = &model.relations {
        return projective(relations, model);
    }
    let facts = model.source.factored();
    let additive = !model.target.is_moving() && facts.is_some_and(|facts| facts.identity_projection);
    if additive && model.normaliser.is_none() { direct(model) } else { plain(model) }
}

/// Coarse-to-fine waves on the sphere: a wide basin first, then accuracy (docs/method.md, *The stages of `auto`*). A level needs at
/// least as many functions as there are unknowns: 6, 32, 122, 256.
fn annealed(unknowns: usize) -> Vec<Stage> {
    let levels = [(1, 0.0, 6), (2, 0.8, 32), (3, 0.6, 122), (4, 0.3, 256)];
    let stage = |(k, damping, _): &(usize, f64, usize)| Stage {
        iterations: 20,
        source_points: COARSE_POINTS / 2,
        target_points: COARSE_POINTS,
        ..Stage::new(&format!("waves-{k}"), &format!("fourier[k={k},w0=1.2,damping={damping}]"))
    };
    levels.iter().filter(|(_, _, functions)| *functions >= unknowns).map(stage).collect()
}

/// Rays: docs/method.md, *The stages of `auto`*.
fn projective(relations: &Relations, model: &Model) -> Pipeline {
    let mut stages = annealed(model.layout.manifold().tangent());
    // A map without a rotation has no grid of poses to begin from.
    let global = if model.layout.range("rotation").is_some() { "grid[count=300]" } else { "identity" };
    stages.iter_mut().for_each(|stage| stage.model = Some(relations.sphere.clone()));
    if let Some(last) = stages.last_mut() {
        last.gate = true;
    }
    let on_plane = |stage: Stage| Stage { model: Some(relations.plane.clone()), noise: NoiseModel::Isotropic, ..stage };
    stages.push(on_plane(Stage {
        source_points: COARSE_POINTS,
        ..Stage::new("noise", "fourier[k=3,w0=1.5,damping=0.4]")
    }));
    stages.push(on_plane(Stage {
        source_points: COARSE_POINTS,
        weighting: WEIGHTED.to_string(),
        gate: true,
        ..Stage::new("weighted", "fourier[k=4,w0=1.5]")
    }));
    Pipeline {
        restarts: 6,
        global_start: Some(global.to_string()),
        screening_stages: 2,
        keep: 8,
        support: true,
        points: Some(PointsStage {
            start: Some(if global == "identity" { global.to_string() } else { "grid[count=200]".to_string() }),
            ..PointsStage::default()
        }),
        ..Pipeline::new(stages)
    }
}

/// Maps of the plane or of space onto itself. A model that says nothing about itself but its map gets these stages too, where the
/// waves have more functions than it has unknowns.
fn direct(model: &Model) -> Pipeline {
    let (dim, unknowns) = (model.dim(), model.layout.manifold().tangent());
    let waves = if dim == 3 { 32 } else { 12 };
    // The first stage has to have a function for each unknown: a warp of many control points has its own features.
    let known = unknowns <= waves && model.linear.is_some() || model.regulariser.is_none() && unknowns < waves;
    if dim == 1 || !known {
        return plain(model);
    }
    let global = match model.linear.as_ref().map(|group| group.kind) {
        Some(LinearKind::General) => "whitened-affine",
        Some(_) => "pca",
        None if rotates(model) => "grid[count=72,keep=8]",
        None => "identity",
    };
    let rigid = model.linear.as_ref().is_some_and(|group| group.kind == LinearKind::Rotation);
    let stages = vec![
        Stage {
            iterations: 20,
            source_points: COARSE_POINTS,
            target_points: 2 * COARSE_POINTS,
            ..Stage::new("waves", "fourier[k=2,w0=1.2,damping=0.4]")
        },
        Stage {
            noise: NoiseModel::Isotropic,
            weighting: WEIGHTED.to_string(),
            ..Stage::new("weighted", if dim == 3 { "fourier[k=2,w0=1.5]" } else { "fourier[k=4,w0=1.5]" })
        },
    ];
    Pipeline {
        restarts: 0,
        global_start: Some(global.to_string()),
        screening_stages: 1,
        keep: 4,
        support: true,
        points: Some(PointsStage {
            start: Some(match model.linear.as_ref().map(|group| group.kind) {
                Some(LinearKind::Rotation | LinearKind::Similarity) => "grid[count=160]".to_string(),
                _ => global.to_string(),
            }),
            parts: rigid.then(|| "local-features".to_string()),
            ..PointsStage::default()
        }),
        ..Pipeline::new(stages)
    }
}

/// Models without additive noise: their own features, the identity weighting, no statistic.
fn plain(model: &Model) -> Pipeline {
    let no_grid = model.linear.is_some() || !rotates(model);
    let global = match &model.linear {
        Some(group) if group.kind == LinearKind::General => Some("whitened-affine".to_string()),
        _ if no_grid => None,
        _ => Some("grid[count=72,keep=8]".to_string()),
    };
    Pipeline { global_start: global, ..Pipeline::new(vec![Stage::new("only", model.basin.features)]) }
}

/// Say whether theta has a rotation.
fn rotates(model: &Model) -> bool {
    model.layout.blocks().iter().any(|block| matches!(block.kind, BlockKind::Rotation))
}
