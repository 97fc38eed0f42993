//! What an author of a scenario writes: from parameters and a generator to one trial.

use std::path::{Path, PathBuf};

use cfpose::entry::{EntryError, NamedEntry, ParameterSpec, Parameters};
use cfpose::theta::Layout;
use cfpose::{Points, PointsError, Pose, PoseError, Side};
use rand_chacha::ChaCha12Rng;

use crate::metric::{self, Metric, Score};

pub mod problems;

use problems::Problems;

/// Data of one trial and the truth about them.
#[derive(Debug, Clone, PartialEq)]
pub struct Trial {
    /// Source points P.
    pub source: Points,
    /// Target points Q.
    pub target: Points,
    /// True theta, ambient coordinates of the scenario's model.
    pub truth: Vec<f64>,
    /// Start theta_0, ambient; `None` where the method has to find its own.
    pub start: Option<Vec<f64>>,
    /// What counts as success.
    pub success: Success,
    /// Other thetas (ambient) that are as true, because the shape has a symmetry: the error is that of the nearest one.
    pub equally_true: Vec<Vec<f64>>,
    /// What the data determine.
    pub determined: Determined,
    /// What was drawn at random, as (name, value): reports count by them.
    pub conditions: Vec<(&'static str, String)>,
}

/// What the data of a trial determine, whoever estimates it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Determined {
    /// One theta.
    #[default]
    Theta,
    /// One of several thetas: an estimate may be right, but is never `good`, and lists the others.
    OneOfSeveral,
    /// Theta but for a direction: an estimate may be right, but is never `good`, and names the direction.
    ButADirection,
    /// Nothing: the target is another shape, and every estimate is wrong.
    Nothing,
}

impl Trial {
    /// Make a trial without a start, whose data determine theta.
    pub fn new(source: Points, target: Points, truth: Vec<f64>, success: Success) -> Self {
        let (equally_true, conditions) = (Vec::new(), Vec::new());
        Self { source, target, truth, start: None, success, equally_true, determined: Determined::Theta, conditions }
    }

    /// Begin from a theta (ambient).
    #[must_use]
    pub fn with_start(mut self, start: Vec<f64>) -> Self {
        self.start = Some(start);
        self
    }
}

/// The rule of success.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Success {
    /// e = sqrt(angle^2 + translation^2) <= threshold (radians and units of the translation).
    Error(f64),
    /// Both parts below their own bounds.
    Parts {
        /// Largest angle, radians.
        angle: f64,
        /// Largest norm of the difference of translations.
        translation: f64,
    },
    /// The first metric of the scenario is at least as good as this: at most where less is better, else at least.
    Metric(f64),
}

impl Success {
    /// Say whether the error of a pose is a success; it is none where the rule is about another metric.
    pub fn holds(self, error: &PoseError) -> bool {
        match self {
            Success::Metric(_) => false,
            Success::Error(threshold) => error.total() <= threshold,
            Success::Parts { angle, translation } => error.angle <= angle && error.translation <= translation,
        }
    }

    /// Say whether an error is a success by the *sum* of its parts, the stricter reading of the paper's norm.
    ///
    /// For separate bounds the two rules are the same.
    pub fn holds_for_sum(self, error: &PoseError) -> bool {
        match self {
            Success::Error(threshold) => error.angle + error.translation <= threshold,
            Success::Parts { .. } | Success::Metric(_) => self.holds(error),
        }
    }

    /// Say whether a score is a success.
    pub fn holds_for(self, score: &Score, metrics: &[Metric]) -> bool {
        match (self, metrics.first(), score.values.first()) {
            (Success::Metric(limit), Some(metric), Some(value)) if metric.smaller_is_better => *value <= limit,
            (Success::Metric(limit), Some(_), Some(value)) => *value >= limit,
            _ => score.pose.is_some_and(|error| self.holds(&error)),
        }
    }
}

/// Why a trial has no data.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ScenarioError {
    /// No valid point set came out.
    #[error("{side} points: {problem}")]
    Points {
        /// Which set.
        side: Side,
        /// What is wrong.
        problem: PointsError,
    },
    /// A file that the parameters name cannot be used.
    #[error("{0}")]
    File(String),
    /// The scenario's own code panicked.
    #[error("its code panics: {0}")]
    Panicked(String),
    /// The parameters do not describe a possible view.
    #[error("{0}")]
    Impossible(String),
}

/// A simulation with all parameters fixed. Object safe: experiments choose one by name.
pub trait Scenario: Send + Sync {
    /// Return the name of the model that describes the truth.
    fn model(&self) -> &str;

    /// Read the files that the parameters name, once before the first trial. Relative names stand for files in `folder`, that of
    /// the experiment file.
    ///
    /// Building a scenario reads nothing, so that results can be merged where the data are absent.
    ///
    /// # Errors
    /// [`ScenarioError::File`].
    fn load(&mut self, _folder: &Path) -> Result<(), ScenarioError> {
        Ok(())
    }

    /// Return the files that [`Scenario::load`] has read: their hashes stand in every record, and results of other data are refused.
    fn files(&self) -> Vec<PathBuf> {
        Vec::new()
    }

    /// Draw one trial. All randomness comes from `rng`, in the order that the scenario documents.
    ///
    /// # Errors
    /// [`ScenarioError`] when the draw leaves no data.
    fn trial(&self, rng: &mut ChaCha12Rng) -> Result<Trial, ScenarioError>;

    /// Compare an estimate with the truth, both ambient, as poses; `None` where the layout holds no pose in 3-D.
    fn error(&self, layout: &Layout, estimate: &[f64], truth: &[f64]) -> Option<PoseError> {
        let (estimate, truth) = (Pose::of_theta(layout, estimate)?, Pose::of_theta(layout, truth)?);
        let error = PoseError::between(&estimate, &truth);
        (error.angle.is_finite() && error.translation.is_finite()).then_some(error)
    }

    /// Return the scenario's metrics; those of a pose unless it says otherwise. The first one of a scenario without a pose is what
    /// `error` means in its records, where less is better.
    fn metrics(&self) -> &[Metric] {
        metric::POSE
    }

    /// Measure an estimate against one true theta, both ambient: a value for each of [`Scenario::metrics`]; `None` where it cannot be
    /// measured, which is no success.
    fn score(&self, layout: &Layout, estimate: &[f64], truth: &[f64], _trial: &Trial) -> Option<Score> {
        self.error(layout, estimate, truth).map(Score::of_pose)
    }

    /// Say whether a score is a success.
    fn succeeds(&self, score: &Score, trial: &Trial) -> bool {
        trial.success.holds_for(score, self.metrics())
    }

    /// Return the scenario of problems, where a trial is a least-squares problem and no pair of point sets ([`problems::OfProblems`]).
    fn problems(&self) -> Option<&dyn Problems> {
        None
    }
}

/// One line of the scenario table.
///
/// ```
/// use cfpose::entry::find;
/// use cfpose_lab::{scenarios, seed};
/// let (entry, parameters) = find("scenario", scenarios::ALL, "planar-curve[curve=fish,b_p=0.01]").unwrap();
/// let scenario = (entry.build)(&parameters).unwrap();
/// let trial = scenario.trial(&mut seed::data_stream(1, 2)).unwrap();
/// assert_eq!((trial.source.len(), trial.target.len()), (3142, 3142));
/// ```
pub struct ScenarioEntry {
    /// Name, kebab-case, equal to its file name.
    pub name: &'static str,
    /// One line for lists.
    pub summary: &'static str,
    /// Parameters with defaults; the order is that of the grid, the last one fastest.
    pub parameters: &'static [ParameterSpec],
    /// Paper section or reference.
    pub source: &'static str,
    /// Build the scenario.
    pub build: fn(&Parameters) -> Result<Box<dyn Scenario>, EntryError>,
}

impl NamedEntry for ScenarioEntry {
    fn name(&self) -> &'static str {
        self.name
    }
    fn summary(&self) -> &'static str {
        self.summary
    }
    fn parameters(&self) -> &'static [ParameterSpec] {
        self.parameters
    }
    fn source(&self) -> &'static str {
        self.source
    }
}
