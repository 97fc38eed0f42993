//! Start strategies: where a solve begins when the user gives no theta.

use cfpose_kernel::points::Points;

use crate::entry::{EntryError, ParameterSpec, Parameters, parse_spec};
use crate::error::{Error, Side};
use crate::geometry::free::Freedom;
use crate::geometry::theta::{euler_of_rotation, rotation_of_euler};
use crate::model::Model;

mod grid;
mod identity;
mod local_features;
mod pca;
mod whitened_affine;

pub use grid::{direction_grid, rotation_grid};

/// What a start strategy may look at.
pub struct StartContext<'a> {
    /// The model.
    pub model: &'a Model,
    /// Source points as the model takes them.
    pub source: &'a Points,
    /// Target points mapped into the feature space (not normalised).
    pub target: &'a Points,
    /// Cost at ambient theta: for strategies that keep only the best of many proposals.
    pub cost: &'a (dyn Fn(&[f64]) -> f64 + 'a),
    /// Seed for strategies that draw random numbers.
    pub seed: u64,
    /// What is free where not everything is; whoever asks gives what is fixed its value afterwards.
    pub freedom: Option<&'a Freedom>,
}

/// Proposes starts in ambient coordinates, in a fixed order.
pub trait StartStrategy: Send + Sync {
    /// Return the table name.
    fn name(&self) -> &'static str;

    /// Propose starts.
    ///
    /// # Errors
    /// [`Error::Unsupported`] when the strategy does not apply to the model, with the reason.
    fn starts(&self, context: &StartContext<'_>) -> Result<Vec<Vec<f64>>, Error>;
}

/// One line of the table of start strategies.
pub struct StartEntry {
    /// Name, kebab-case.
    pub name: &'static str,
    /// One line for lists.
    pub summary: &'static str,
    /// Parameters with defaults.
    pub parameters: &'static [ParameterSpec],
    /// Reference.
    pub source: &'static str,
    /// Build the strategy.
    pub build: fn(&Parameters) -> Result<Box<dyn StartStrategy>, EntryError>,
}

/// All start strategies of the library.
pub const ALL: &[&StartEntry] =
    &[&identity::ENTRY, &pca::ENTRY, &grid::ENTRY, &whitened_affine::ENTRY, &local_features::ENTRY];

/// The parameter `reflections` of strategies that choose signs.
const REFLECTIONS: ParameterSpec = ParameterSpec {
    name: "reflections",
    default: "forbid",
    meaning: "allow or forbid: whether affine maps of negative determinant are proposed too (rotations never are reflections)",
};

/// Return the text of a start with the parameter `reflections` set, where the strategy has one and the text does not say.
///
/// ```
/// use cfpose::{Registry, start::with_reflections};
/// let starts = Registry::default().starts;
/// assert_eq!(with_reflections(&starts, "pca", true), "pca[reflections=allow]");
/// assert_eq!(with_reflections(&starts, "whitened-affine[keep=9]", false), "whitened-affine[keep=9,reflections=forbid]");
/// assert_eq!(with_reflections(&starts, "identity", true), "identity");
/// ```
pub fn with_reflections(table: &[&StartEntry], spec: &str, allow: bool) -> String {
    let Ok((name, given)) = parse_spec(spec) else { return spec.to_string() };
    let knows =
        |entry: &&&StartEntry| entry.name == name && entry.parameters.iter().any(|p| p.name == REFLECTIONS.name);
    if !table.iter().any(|entry| knows(&entry)) || given.iter().any(|(key, _)| key == REFLECTIONS.name) {
        return spec.to_string();
    }
    let mut parts: Vec<String> = given.iter().map(|(key, value)| format!("{key}={value}")).collect();
    parts.push(format!("reflections={}", if allow { "allow" } else { "forbid" }));
    format!("{name}[{}]", parts.join(","))
}

fn reflections_of(parameters: &Parameters) -> Result<bool, EntryError> {
    parameters.choice("reflections", &[("forbid", false), ("allow", true)])
}

/// Mean and covariance of both sides in the space of a [`LinearGroup`].
struct Moments {
    dim: usize,
    source_mean: [f64; 3],
    target_mean: [f64; 3],
    source_covariance: [[f64; 3]; 3],
    target_covariance: [[f64; 3]; 3],
}

impl Moments {
    fn new(context: &StartContext<'_>, dim: usize) -> Result<Self, Error> {
        let source = inhomogeneous(Side::Source, context.source, dim)?;
        let target = inhomogeneous(Side::Target, context.target, dim)?;
        Ok(Self {
            dim,
            source_mean: source.mean(),
            target_mean: target.mean(),
            source_covariance: source.covariance(),
            target_covariance: target.covariance(),
        })
    }

    /// Return the scale that matches the total spread.
    fn scale(&self) -> f64 {
        let trace = |c: &[[f64; 3]; 3]| c[0][0] + c[1][1] + c[2][2];
        (trace(&self.target_covariance) / trace(&self.source_covariance)).sqrt()
    }

    /// Return b so that A mean(source) + b = mean(target), A row by row.
    fn offset(&self, a: &[f64]) -> Vec<f64> {
        let image = |i: usize| (0..self.dim).map(|k| a[i * self.dim + k] * self.source_mean[k]).sum::<f64>();
        (0..self.dim).map(|i| self.target_mean[i] - image(i)).collect()
    }
}

/// Return points of dimension `dim`: as they are, or divided by the last of `dim + 1` homogeneous coordinates.
fn inhomogeneous(side: Side, points: &Points, dim: usize) -> Result<Points, Error> {
    if points.dim() == dim {
        return Ok(points.clone());
    }
    let last = points.column(points.dim() - 1);
    let columns = (0..dim).map(|d| points.column(d).iter().zip(last).map(|(x, z)| x / z).collect()).collect();
    Points::weighted(columns, points.weights().to_vec())
        .map_err(|_| Error::Data { side, problem: "a start needs points in front of the camera".to_string() })
}

/// A proposed start and the rotation it came from (row by row), by which starts are told apart.
struct Proposal {
    rotation: Vec<f64>,
    theta: Vec<f64>,
}

/// Keep the `keep` proposals of least cost that differ by more than `separation` radians (below 0: all do);
/// `keep` 0 keeps everything, in order.
fn screened(context: &StartContext<'_>, proposals: Vec<Proposal>, keep: usize, separation: f64) -> Vec<Vec<f64>> {
    if keep == 0 {
        return proposals.into_iter().map(|proposal| proposal.theta).collect();
    }
    let cost = |theta: &[f64]| {
        let value = (context.cost)(theta);
        if value.is_finite() { value } else { f64::INFINITY }
    };
    let mut ranked: Vec<(f64, Proposal)> = proposals.into_iter().map(|p| (cost(&p.theta), p)).collect();
    ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
    // norm(R - S)^2 = 4 (1 - cos angle) in 2 and in 3 dimensions; reflections are farther than any rotation of interest.
    let limit = if separation < 0.0 { -1.0 } else { 4.0 * (1.0 - separation.cos()) };
    let mut kept: Vec<Proposal> = Vec::new();
    for (_, proposal) in ranked {
        let far = |other: &Proposal| {
            let pairs = other.rotation.iter().zip(&proposal.rotation);
            pairs.map(|(a, b)| (a - b).powi(2)).sum::<f64>() > limit
        };
        if kept.len() < keep && kept.iter().all(far) {
            kept.push(proposal);
        }
    }
    kept.into_iter().map(|proposal| proposal.theta).collect()
}

/// Return about `count` even rotations in 2 or 3 dimensions, row by row: turns about the free angles where not all are.
fn rotations(dim: usize, count: usize, freedom: Option<&Freedom>) -> Vec<Vec<f64>> {
    if dim != 3 {
        let turn = |i: usize| (std::f64::consts::TAU * i as f64 / count as f64).sin_cos();
        return (0..count).map(turn).map(|(sin, cos)| vec![cos, -sin, sin, cos]).collect();
    }
    match freedom.and_then(Freedom::turns) {
        None => rotation_grid(count).into_iter().map(|r| r.to_vec()).collect(),
        Some((axes, base)) => turns(axes, base, count),
    }
}

/// Return the rotations R = Rz Ry Rx whose free angles run over an even grid of about `count` nodes, the others as in `base`.
fn turns(axes: &[usize], base: &[f64], count: usize) -> Vec<Vec<f64>> {
    let along = match axes.len() {
        0 => 1,
        1 => count.max(1),
        _ => (count as f64).sqrt().round().max(1.0) as usize,
    };
    // Angles about y cover half a turn: the other half is the same rotations with other angles about x and z.
    let angle = |axis: usize, i: usize| match axis {
        1 => std::f64::consts::PI * ((i as f64 + 0.5) / along as f64 - 0.5),
        _ => std::f64::consts::TAU * i as f64 / along as f64,
    };
    let mut all = vec![euler_of_rotation(base)];
    for axis in axes {
        let turned = |angles: &[f64; 3], i: usize| {
            let mut angles = *angles;
            angles[*axis] = if *axis == 1 { angle(1, i) } else { angles[*axis] + angle(*axis, i) };
            angles
        };
        all = all.iter().flat_map(|angles| (0..along).map(move |i| turned(angles, i))).collect();
    }
    all.iter().map(|angles| rotation_of_euler(angles).to_vec()).collect()
}
