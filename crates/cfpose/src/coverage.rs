//! Which directions of theta a family sees on given points, in words.

use std::fmt;

use cfpose_kernel::family::DynFamily;
use cfpose_kernel::points::Points;
use faer::{Col, Mat, Side};

use crate::entry::BuildContext;
use crate::error::Error;
use crate::registry::Registry;

mod motion;
mod scene;

use scene::Scene;

/// A sensitivity below this share of the largest is rounding.
const EXACT: f64 = 1e-8;

/// A change that stands out by less than this many standard deviations could be an accident of the sampling.
const SIGNIFICANT: f64 = 3.0;

/// Families that are tried, in this order, on directions that the family in question does not see.
const BETTER: [&str; 4] =
    ["hermite[degree=2]", "hermite[degree=3]", "hermite[degree=4]", "hermite[degree=6] + fourier[k=4]"];

/// How well a direction of theta is seen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Seen {
    /// The feature means change to first order.
    Observable,
    /// They change by no more than independently sampled points of a symmetric shape could make them.
    Weak,
    /// They do not change.
    Unobservable,
}

/// One direction of the tangent space.
#[derive(Debug, Clone, PartialEq)]
pub struct Direction {
    /// Tangent coordinates, scaled so that points move by 1 (root mean square, normalised units), where any moves.
    pub tangent: Vec<f64>,
    /// Norm of the change of the feature means along it.
    pub sensitivity: f64,
    /// (T - dof) / sqrt(2 dof) with T = change' S^-1 change, S the covariance of the change if the points were sampled
    /// independently: standard deviations above what sampling alone gives; infinite where it cannot give any.
    pub significance: f64,
    /// Judgement.
    pub seen: Seen,
    /// The motion in words.
    pub motion: String,
    /// Why it is not seen; empty where it is.
    pub reason: String,
}

/// Which directions of theta a family sees.
#[derive(Debug, Clone, PartialEq)]
pub struct CoverageReport {
    /// Model, as given.
    pub model: String,
    /// Family, as given.
    pub family: String,
    /// Number of points.
    pub num_points: usize,
    /// Number of features.
    pub num_features: usize,
    /// The shape of the points in words.
    pub shape: String,
    /// Largest by smallest sensitivity, infinite where a direction is not observable.
    pub condition: f64,
    /// Directions, the least seen first; those not seen are combined to be simple.
    pub directions: Vec<Direction>,
}

impl CoverageReport {
    /// Say whether every direction is observable.
    pub fn is_complete(&self) -> bool {
        self.directions.iter().all(|direction| direction.seen == Seen::Observable)
    }
}

impl fmt::Display for CoverageReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{}: {} function(s) for {} unknown(s) of {}",
            self.family,
            self.num_features,
            self.directions.len(),
            self.model
        )?;
        writeln!(f, "{} points, {}", self.num_points, self.shape)?;
        writeln!(f, "condition of J per unit of motion: {:.3e}", self.condition)?;
        for direction in self.directions.iter().filter(|direction| direction.seen != Seen::Observable) {
            let word = if direction.seen == Seen::Weak { "hardly observable" } else { "not observable" };
            writeln!(f, "{word}: {}; {}", direction.motion, direction.reason)?;
        }
        if self.is_complete() {
            writeln!(f, "every direction is observable")?;
        }
        Ok(())
    }
}

/// Return (T - dof) / sqrt(2 dof) of a change with covariance S; dof is the number of eigenvalues of S above 1e-4 of the
/// largest, T is taken over those and corrected for few points.
fn significance(change: &Col<f64>, covariance: &Mat<f64>, num_points: usize) -> f64 {
    let n = change.nrows();
    let Ok(eigen) = covariance.self_adjoint_eigen(Side::Lower) else { return 0.0 };
    let largest = if n > 0 { eigen.S()[n - 1] } else { 0.0 };
    let norm = change.norm_l2();
    let (mut statistic, mut rank, mut inside) = (0.0, 0_usize, 0.0);
    for i in 0..n {
        let part = eigen.U().col(i).transpose() * change;
        if largest > 0.0 && eigen.S()[i] > 1e-4 * largest {
            statistic += part * part / eigen.S()[i];
            inside += part * part;
            rank += 1;
        }
    }
    // Mostly along combinations of features that hardly scatter: certain. Less than that can be the sampling's doing too,
    // since directions that are found from the sample are a little off those of the shape.
    if norm * norm - inside > 0.5 * norm * norm {
        return f64::INFINITY;
    }
    // The mean of Hotelling's T^2 for estimated S; too few points can tell nothing.
    let (dof, n) = (rank as f64, num_points as f64);
    if n <= dof + 2.0 {
        return 0.0;
    }
    (statistic * (n - dof - 2.0) / n - dof) / (2.0 * dof).sqrt()
}

/// Report which directions of theta a family sees on given points, at the model's typical theta (the identity for motions).
///
/// J is measured per unit of motion: feature change for a root mean square motion of 1 of the normalised points, so rotations
/// and translations compare. A direction that is not seen is described in words and checked against richer families, which
/// tells a symmetric shape from a family that is too small.
///
/// ```
/// use cfpose::{Points, Registry, coverage::coverage};
/// // A flat plate: a separable family does not see it tilt.
/// let rows: Vec<[f64; 3]> = (0..60).map(|k| [f64::from(k % 10), f64::from(k / 10) * 0.5, 0.0]).collect();
/// let points = Points::from_rows(&rows).unwrap();
/// let report = coverage(&Registry::default(), "trig18", "rigid3", &points).unwrap();
/// assert!(report.shape.contains("plane") && !report.is_complete());
/// let report = coverage(&Registry::default(), "hermite", "rigid3", &points).unwrap();
/// assert!(report.is_complete());
/// ```
///
/// # Errors
/// [`Error`] for unknown names and points that do not fit the model.
pub fn coverage(registry: &Registry, family: &str, model: &str, points: &Points) -> Result<CoverageReport, Error> {
    let scene = Scene::new(registry, model, points)?;
    let context = BuildContext { dim: scene.mapped.dim(), target: Some(&scene.normalised), ..BuildContext::default() };
    let built = registry.family(family, &context)?;
    let mut directions = principal_directions(&scene, built.as_ref());
    let largest = directions.iter().map(|direction| direction.sensitivity).fold(0.0, f64::max);
    let smallest = directions.first().map_or(0.0, |direction| direction.sensitivity);
    let condition = if smallest > EXACT * largest { largest / smallest } else { f64::INFINITY };
    let unseen = directions.iter().filter(|direction| direction.seen != Seen::Observable).count();
    for direction in &mut directions[..unseen] {
        let (x, v) = scene.velocities(&direction.tangent);
        direction.motion = motion::describe(scene.mapped.dim(), &x, &v)
            .unwrap_or_else(|| motion::describe_coordinates(&scene.model.layout, &direction.tangent));
        direction.reason = reason(registry, &scene, family, &context, direction)?;
    }
    Ok(CoverageReport {
        model: model.to_string(),
        family: family.to_string(),
        num_points: points.len(),
        num_features: built.num_features(scene.mapped.dim()),
        shape: motion::describe_shape(&scene.mapped),
        condition,
        directions,
    })
}

/// Return the right singular directions of J in the metric of motion, least seen first, judged; those that move no point
/// come first of all.
fn principal_directions(scene: &Scene, family: &dyn DynFamily) -> Vec<Direction> {
    let m = scene.tangent();
    let metric = scene.motion_metric();
    let (mut still, mut moving): (Vec<Vec<f64>>, Vec<Vec<f64>>) = (Vec::new(), Vec::new());
    if let Ok(eigen) = metric.self_adjoint_eigen(Side::Lower) {
        let largest = eigen.S()[m - 1];
        for c in 0..m {
            let value = eigen.S()[c];
            let vector = (0..m).map(|j| eigen.U()[(j, c)]);
            if value > 1e-12 * largest {
                moving.push(vector.map(|entry| entry / value.sqrt()).collect());
            } else {
                still.push(vector.collect());
            }
        }
    }
    // Columns of unit motion; J times them has the sensitivities as singular values.
    let whitening = Mat::from_fn(m, moving.len(), |j, c| moving[c][j]);
    let j = scene.changes(family, &whitening);
    let mut principal: Vec<Vec<f64>> = Vec::new();
    if let Ok(svd) = j.svd() {
        let v = &whitening * svd.V();
        principal.extend((0..v.ncols()).rev().map(|c| (0..m).map(|row| v[(row, c)]).collect()));
    }
    let mut directions = judge(scene, family, &principal, 0.0);
    let largest = directions.iter().map(|direction| direction.sensitivity).fold(0.0, f64::max);
    directions.sort_by(|a, b| {
        (a.seen == Seen::Observable).cmp(&(b.seen == Seen::Observable)).then(a.sensitivity.total_cmp(&b.sensitivity))
    });
    let unseen = directions.iter().filter(|direction| direction.seen != Seen::Observable).count();
    let vectors: Vec<Vec<f64>> = directions[..unseen].iter().map(|direction| direction.tangent.clone()).collect();
    let simple = motion::simplify(&vectors, &metric);
    let mut all: Vec<Direction> = motion::simplify(&still, &Mat::identity(m, m))
        .into_iter()
        .map(|tangent| Direction {
            tangent,
            sensitivity: 0.0,
            significance: 0.0,
            seen: Seen::Unobservable,
            motion: String::new(),
            reason: "no point moves".to_string(),
        })
        .collect();
    all.extend(judge(scene, family, &simple, largest));
    all.extend(directions.drain(unseen..));
    all
}

/// Measure and judge directions; `largest` is the largest sensitivity of all directions if that is not among them.
fn judge(scene: &Scene, family: &dyn DynFamily, tangents: &[Vec<f64>], largest: f64) -> Vec<Direction> {
    let matrix = Mat::from_fn(scene.tangent(), tangents.len(), |j, c| tangents[c][j]);
    let changes = scene.changes(family, &matrix);
    let significances = scene.significances(family, &matrix, &changes);
    let norms: Vec<f64> = (0..tangents.len()).map(|c| changes.col(c).norm_l2()).collect();
    let largest = norms.iter().fold(largest, |a, b| a.max(*b));
    (0..tangents.len())
        .map(|c| {
            // An absolute floor for families that see nothing at all.
            let seen = match norms[c] {
                s if s <= (EXACT * largest).max(1e-12) => Seen::Unobservable,
                _ if significances[c] < SIGNIFICANT => Seen::Weak,
                _ => Seen::Observable,
            };
            Direction {
                tangent: tangents[c].clone(),
                sensitivity: norms[c],
                significance: significances[c],
                seen,
                motion: String::new(),
                reason: String::new(),
            }
        })
        .collect()
}

/// Say why a direction is not seen: no richer family sees it either, or the first one that does.
fn reason(
    registry: &Registry,
    scene: &Scene,
    family: &str,
    context: &BuildContext<'_>,
    direction: &Direction,
) -> Result<String, Error> {
    if !direction.reason.is_empty() {
        return Ok(direction.reason.clone());
    }
    for better in BETTER {
        let built = registry.family(better, context)?;
        let whole = principal_scale(scene, built.as_ref());
        if judge(scene, built.as_ref(), std::slice::from_ref(&direction.tangent), whole)[0].seen == Seen::Observable {
            let verb = if direction.seen == Seen::Weak { "hardly changes" } else { "does not change to first order" };
            return Ok(format!("`{family}` {verb}, `{better}` does"));
        }
    }
    Ok(match direction.seen {
        Seen::Weak => "the shape is symmetric under it as far as this number of points can tell".to_string(),
        _ => "the shape is symmetric under it".to_string(),
    })
}

/// Return the largest sensitivity of a family to any tangent coordinate of unit motion.
fn principal_scale(scene: &Scene, family: &dyn DynFamily) -> f64 {
    let m = scene.tangent();
    let metric = scene.motion_metric();
    let units =
        Mat::from_fn(m, m, |i, j| if i == j && metric[(i, i)] > 0.0 { metric[(i, i)].sqrt().recip() } else { 0.0 });
    let changes = scene.changes(family, &units);
    (0..m).map(|c| changes.col(c).norm_l2()).fold(0.0, f64::max)
}
