//! An estimator as data: a sequence of stages and what surrounds them.

use serde::{Deserialize, Serialize};

use crate::criteria::Criteria;
use crate::problem::Noise;

/// How the noise of the target enters a stage.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum NoiseModel {
    /// Not at all.
    #[default]
    None,
    /// One variance as a nuisance parameter.
    Isotropic,
    /// A full covariance as nuisance parameters.
    Full,
}

impl From<NoiseModel> for Noise {
    fn from(model: NoiseModel) -> Self {
        match model {
            NoiseModel::None => Noise::None,
            NoiseModel::Isotropic => Noise::Isotropic,
            NoiseModel::Full => Noise::Full,
        }
    }
}

/// One stage: features, weighting, solver, gate.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct Stage {
    /// Name in reports.
    pub name: String,
    /// A variant of the model with the same theta (another relation); the estimate's model where absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub model: Option<String>,
    /// Feature family.
    pub features: String,
    /// Normaliser; the model's own, else `paper`, where absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub normaliser: Option<String>,
    /// Weighting.
    #[serde(default = "identity")]
    pub weighting: String,
    /// Noise as a nuisance parameter.
    #[serde(default)]
    pub noise: NoiseModel,
    /// Solver; the estimate's where absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub solver: Option<String>,
    /// Iterations of each solve at most.
    #[serde(default = "thirty")]
    pub iterations: usize,
    /// Source points that are used at most, 0 for all: a small stage needs few.
    #[serde(default)]
    pub source_points: usize,
    /// Target points that are used at most, 0 for all.
    #[serde(default)]
    pub target_points: usize,
    /// Begin on small random subsets of the points, larger ones as the steps become small.
    #[serde(default)]
    pub coarse_to_fine: bool,
    /// Give a hypothesis up after this stage when the model finds it implausible (behind the camera, back-facing).
    #[serde(default)]
    pub gate: bool,
}

fn identity() -> String {
    "identity".to_string()
}

fn thirty() -> usize {
    30
}

impl Stage {
    /// Make a stage of features with the identity weighting, 30 iterations, all points, no gate.
    pub fn new(name: &str, features: &str) -> Self {
        Self {
            name: name.to_string(),
            model: None,
            features: features.to_string(),
            normaliser: None,
            weighting: identity(),
            noise: NoiseModel::None,
            solver: None,
            iterations: thirty(),
            source_points: 0,
            target_points: 0,
            coarse_to_fine: false,
            gate: false,
        }
    }
}

/// The likelihood of the points as the last stage of a pipeline: its modes are searched, compared and polished.
///
/// ```
/// use cfpose::estimator::{Pipeline, PointsStage, Stage};
/// let means = Stage::new("means", "hermite[degree=3]");
/// let points = PointsStage { start: Some("grid[count=100]".to_string()), ..PointsStage::default() };
/// let pipeline = Pipeline { points: Some(points), ..Pipeline::new(vec![means]) };
/// assert_eq!(pipeline.points.unwrap().target_points, 2000);
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields, default)]
pub struct PointsStage {
    /// Start strategy that covers the model's manifold; absent: only what the means found and given starts are polished.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub start: Option<String>,
    /// Start strategy whose thetas are added to those: one that needs only a part of both sides, `local-features`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub parts: Option<String>,
    /// Source points that are used at most to polish the answer.
    pub source_points: usize,
    /// Target points that are used at most for that.
    pub target_points: usize,
}

impl Default for PointsStage {
    fn default() -> Self {
        Self { start: None, parts: None, source_points: 4000, target_points: 2000 }
    }
}

/// What is done about target points that the source does not explain, where the means have the last word.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Outliers {
    /// Nothing.
    #[default]
    None,
    /// Hypotheses from clusters of the target, scored by J and nearest-neighbour support (the paper's proposal, section V).
    Ransac,
}

/// A whole estimator, serialisable: the preset `auto` is such a value, chosen by the model.
///
/// ```
/// use cfpose::estimator::{Pipeline, Stage};
/// let pipeline = Pipeline::new(vec![Stage::new("only", "hermite[degree=3]")]);
/// assert_eq!((pipeline.restarts, pipeline.stages.len()), (0, 1));
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct Pipeline {
    /// Stages, in order; the last one's problem is the one that is reported.
    #[serde(rename = "stage")]
    pub stages: Vec<Stage>,
    /// Perturbed starts that are tried while no hypothesis is accepted.
    #[serde(default)]
    pub restarts: usize,
    /// Start strategy when no start is given, and when all perturbed starts failed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub global_start: Option<String>,
    /// Number of stages after which only the best of the global starts go on.
    #[serde(default)]
    pub screening_stages: usize,
    /// Number of global starts that go on.
    #[serde(default)]
    pub keep: usize,
    /// A hypothesis is accepted when J per degree of freedom is below this, and its residuals have nothing in common.
    #[serde(default = "three")]
    pub accept: f64,
    /// Rank hypotheses by distances between the points (else by cost), and gate by them.
    #[serde(default)]
    pub support: bool,
    /// Outliers.
    #[serde(default)]
    pub outliers: Outliers,
    /// The likelihood of the points, which has the last word; absent: the means have it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub points: Option<PointsStage>,
    /// Every threshold that decides.
    #[serde(default)]
    pub criteria: Criteria,
}

fn three() -> f64 {
    3.0
}

impl Pipeline {
    /// Make a pipeline of stages and nothing around them.
    pub fn new(stages: Vec<Stage>) -> Self {
        Self {
            stages,
            restarts: 0,
            global_start: None,
            screening_stages: 0,
            keep: 0,
            accept: three(),
            support: false,
            outliers: Outliers::None,
            points: None,
            criteria: Criteria::default(),
        }
    }
}
