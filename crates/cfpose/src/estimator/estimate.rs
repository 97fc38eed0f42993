//! The result of an estimate.

use cfpose_optim::Outcome;
use serde::Serialize;

use super::candidate::{By, Minimised};
use super::points::Evidence;
use super::prior::PriorReport;
use super::undetermined::Undetermined;
use super::verdict::Verdict;
use crate::distances::support::Support;
use crate::geometry::pose::Pose;
use crate::statistics::Statistics;
use crate::statistics::conditioning::Conditioning;

/// Another theta that was found or is implied.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Alternative {
    /// Ambient theta.
    pub theta: Vec<f64>,
    /// Its cost.
    pub cost: f64,
    /// Its verdict, `None` where the weighting has no statistic; `Ambiguous` where it explains the points as well as the best.
    pub verdict: Option<Verdict>,
    /// Likelihood of the points relative to that at the most likely theta; where the pipeline asks it.
    pub relative_likelihood: Option<f64>,
}

/// The result of an estimate. Everything in it belongs to `theta`, or says to what. It serialises under the names of its fields;
/// thetas are ambient there.
///
/// ```
/// use cfpose::{Estimator, Execution, Points, Registry, Settings, Verdict};
/// // A bent sheet, turned by a quarter about z and shifted; the order of the points has no meaning.
/// let sheet: Vec<[f64; 3]> = (0..400)
///     .map(|k| (f64::from(k) * 0.618_034 % 1.0, f64::from(k) / 400.0))
///     .map(|(u, v)| [2.0 * u, v * (1.0 + 0.5 * u), 0.6 * u * u + 0.3 * (3.0 * v).sin() * u])
///     .collect();
/// let turned: Vec<[f64; 3]> = sheet.iter().rev().map(|p| [-p[1] + 0.5, p[0], p[2]]).collect();
/// let (source, target) = (Points::from_rows(&sheet)?, Points::from_rows(&turned)?);
/// let settings = Settings::preset("auto", "rigid3")?;
/// let estimator = Estimator::new(&Registry::default(), &settings, &source, &target, &Execution::default())?;
/// let estimate = estimator.solve(Default::default())?;
/// assert_eq!(estimate.verdict, Some(Verdict::Good));
/// let pose = estimate.pose.unwrap();
/// assert!((pose.translation[0] - 0.5).abs() < 1e-6 && (pose.rotation[3] - 1.0).abs() < 1e-6);
/// // The covariance is that of the six tangent coordinates: rotation (radians), translation.
/// let statistics = estimate.statistics.unwrap();
/// assert_eq!(statistics.covariance.len(), 36);
/// assert!(statistics.covariance[0] > 0.0 && statistics.p_value > 1e-3);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Estimate {
    /// Best theta, ambient.
    pub theta: Vec<f64>,
    /// What theta is the best fit of: means of features, or distances between the points.
    pub by: By,
    /// Its pose `target_from_source`, where the model has one.
    pub pose: Option<Pose>,
    /// How the solve that led to theta ended; its cost is that of theta in the problem that was minimised last, its theta holds
    /// the nuisance parameters too.
    pub outcome: Outcome,
    /// Number of starts that were solved.
    pub starts: usize,
    /// Residual evaluations over all starts.
    pub evaluations: usize,
    /// Iterations over all starts.
    pub iterations: usize,
    /// Verdict; `None` where the weighting has no statistic, except `Failed`.
    pub verdict: Option<Verdict>,
    /// Other thetas, best first.
    pub alternatives: Vec<Alternative>,
    /// What is degenerate, undetermined, mirrored or ambiguous at theta: one sentence each.
    pub warnings: Vec<String>,
    /// Rank and conditioning of the Jacobian at theta.
    pub conditioning: Conditioning,
    /// J statistic at theta, covariance, noise; where the weighting has them.
    pub statistics: Option<Statistics>,
    /// Distances between the points at theta; where the pipeline looks at them.
    pub support: Option<Support>,
    /// Share of the target points that were left out as outliers.
    pub clutter: Option<f64>,
    /// Whether theta is the most likely one for the points rather than the best fit of means.
    pub refined: bool,
    /// What the likelihood of the points says; where the pipeline asks it.
    pub evidence: Option<Evidence>,
    /// Directions of theta that the points do not determine; their variances are NaN (null in JSON).
    pub undetermined: Vec<Undetermined>,
    /// What became of the prior; where one was given.
    pub prior: Option<PriorReport>,
    /// Rows (from 1) of stray points, source and target, which lie far outside and take no part.
    pub stray: [Vec<usize>; 2],
    /// How the sets were sampled, given or found.
    pub sampling: Option<&'static str>,
    /// What each stage of the pipeline did.
    pub stages: Vec<StageReport>,
    /// What was minimised last: stage, weighting, rows that are left.
    pub minimised: Minimised,
}

impl Estimate {
    /// Say whether the estimate may be used.
    pub fn usable(&self) -> bool {
        self.outcome.usable() && self.verdict != Some(Verdict::Failed)
    }
}

/// What a stage did, over all starts.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct StageReport {
    /// Name of the stage.
    pub name: String,
    /// Solves.
    pub solves: usize,
    /// Residual evaluations.
    pub evaluations: usize,
    /// Candidates that the gate of the stage gave up.
    pub rejected: usize,
}

impl StageReport {
    /// Begin a report with nothing done.
    pub(super) fn new(name: &str) -> Self {
        Self { name: name.to_string(), solves: 0, evaluations: 0, rejected: 0 }
    }

    /// Count one solve.
    pub(super) fn count(&mut self, evaluations: usize) {
        self.solves += 1;
        self.evaluations += evaluations;
    }

    /// Add the work of another report.
    pub(super) fn add(&mut self, other: &Self) {
        self.solves += other.solves;
        self.evaluations += other.evaluations;
        self.rejected += other.rejected;
    }
}
