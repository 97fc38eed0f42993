//! Points that are the pixels of a region: what is chosen for them where nobody says otherwise.

use std::collections::HashSet;

use cfpose::distances::Sampling;
use cfpose::estimator::Pipeline;
use cfpose::{Points, Registry, Settings};

/// Fewest pixels, and the least share of them with a neighbour to the right and one below.
const FEWEST: usize = 200;
const FILLED: f64 = 0.6;

/// Say whether points are the pixels of a region: all at different places of a lattice of integers, most of them beside others, with
/// weights from 0 to 1.
pub(super) fn is_one(points: &Points) -> bool {
    if points.dim() != 2 || points.len() < FEWEST || points.weights().iter().any(|w| *w > 1.0) {
        return false;
    }
    let (x, y) = (points.column(0), points.column(1));
    let whole = |v: &f64| v.fract() == 0.0 && v.abs() < 1e6;
    if !(x.iter().all(whole) && y.iter().all(whole)) {
        return false;
    }
    let places: HashSet<(i64, i64)> = x.iter().zip(y).map(|(x, y)| (*x as i64, *y as i64)).collect();
    let inner = places.iter().filter(|(x, y)| places.contains(&(x + 1, *y)) && places.contains(&(*x, y + 1))).count();
    places.len() == points.len() && inner as f64 > FILLED * points.len() as f64
}

/// Let a region count by its area: the model with area elements where it has them, the sampling that of a lattice.
pub(super) fn choose(settings: &mut Settings, registry: &Registry) {
    settings.sampling = Some(Sampling::Raster);
    let (name, given) = match settings.model.split_once('[') {
        Some((name, given)) => (name, Some(given.trim_end_matches(']'))),
        None => (settings.model.as_str(), None),
    };
    let entry = registry.models.iter().find(|entry| entry.name == name);
    let has_area = entry.is_some_and(|entry| entry.parameters.iter().any(|parameter| parameter.name == "area"));
    if has_area && !given.is_some_and(|given| given.contains("area")) {
        settings.model = match given {
            Some(given) => format!("{name}[{given},area=on]"),
            None => format!("{name}[area=on]"),
        };
    }
}

/// Return the stages of means alone: distances between pixels prefer shifts by whole pixels.
pub(super) fn without_points(pipeline: &Pipeline) -> Pipeline {
    Pipeline { points: None, support: false, ..pipeline.clone() }
}
