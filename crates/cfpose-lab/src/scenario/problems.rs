//! Trials that are least-squares problems of anyone: no points, no pose, the same experiments and statistics.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use cfpose_optim::LeastSquares;
use rand_chacha::ChaCha12Rng;

use crate::metric::{Metric, Score};
use crate::scenario::{Scenario, ScenarioError, Trial};

/// What [`Scenario::model`] returns where trials are problems.
pub const NO_MODEL: &str = "";

/// One problem and the place to begin.
#[derive(Clone)]
pub struct Posed {
    /// The problem; trials of one scenario may share it.
    pub problem: Arc<dyn LeastSquares>,
    /// Start, ambient.
    pub start: Vec<f64>,
}

/// Where a solver ended.
#[derive(Debug, Clone, Copy)]
pub struct Ended<'a> {
    /// Theta, ambient.
    pub theta: &'a [f64],
    /// Cost there: half the sum of squared residuals.
    pub cost: f64,
    /// Largest violation of the constraints, 0 without any.
    pub violation: f64,
}

/// A scenario whose trials are least-squares problems: what solvers are compared on without points. Of a method its solver, its
/// budgets and its seed are used.
///
/// ```
/// use std::sync::Arc;
/// use cfpose_lab::scenario::problems::{Ended, OfProblems, Posed, Problems};
/// use cfpose_lab::metric::{Metric, Score};
/// use cfpose_lab::{ChaCha12Rng, Scenario, ScenarioError, seed};
/// use cfpose_optim::testproblems::Rosenbrock;
///
/// struct Valley;
/// impl Problems for Valley {
///     fn posed(&self, _rng: &mut ChaCha12Rng) -> Result<Posed, ScenarioError> {
///         Ok(Posed { problem: Arc::new(Rosenbrock), start: vec![-1.2, 1.0] })
///     }
///     fn metrics(&self) -> &[Metric] {
///         const DISTANCE: &[Metric] = &[Metric::error("distance", "1")];
///         DISTANCE
///     }
///     fn score(&self, ended: &Ended<'_>) -> Option<Score> {
///         Some(Score::of(vec![(ended.theta[0] - 1.0).hypot(ended.theta[1] - 1.0)]))
///     }
///     fn succeeds(&self, _ended: &Ended<'_>, score: &Score) -> bool {
///         score.values[0] < 1e-6
///     }
/// }
/// // The `build` of a table line: `|_| Ok(Box::new(OfProblems(Valley)))`.
/// let scenario: Box<dyn Scenario> = Box::new(OfProblems(Valley));
/// let posed = scenario.problems().unwrap().posed(&mut seed::data_stream(1, 1)).unwrap();
/// assert_eq!(posed.start, [-1.2, 1.0]);
/// ```
pub trait Problems: Send + Sync {
    /// Draw one problem. All randomness comes from `rng`.
    ///
    /// # Errors
    /// [`ScenarioError`] when there is no problem.
    fn posed(&self, rng: &mut ChaCha12Rng) -> Result<Posed, ScenarioError>;

    /// Return the metrics; the first one is what `error` means in records, where less is better.
    fn metrics(&self) -> &[Metric];

    /// Measure where a solver ended: one value a metric, or `None`.
    fn score(&self, ended: &Ended<'_>) -> Option<Score>;

    /// Say whether the end is a success.
    fn succeeds(&self, ended: &Ended<'_>, score: &Score) -> bool;

    /// Read the files that the parameters name, as [`Scenario::load`].
    ///
    /// # Errors
    /// [`ScenarioError::File`].
    fn load(&mut self, _folder: &Path) -> Result<(), ScenarioError> {
        Ok(())
    }

    /// Return the files that were read, as [`Scenario::files`].
    fn files(&self) -> Vec<PathBuf> {
        Vec::new()
    }
}

/// A scenario of problems as a scenario.
pub struct OfProblems<P>(pub P);

impl<P: Problems> Scenario for OfProblems<P> {
    fn model(&self) -> &str {
        NO_MODEL
    }

    fn load(&mut self, folder: &Path) -> Result<(), ScenarioError> {
        self.0.load(folder)
    }

    fn files(&self) -> Vec<PathBuf> {
        self.0.files()
    }

    fn trial(&self, _rng: &mut ChaCha12Rng) -> Result<Trial, ScenarioError> {
        Err(ScenarioError::Impossible(
            "its trials are least-squares problems, not point sets; use it in `cfpose run`".to_string(),
        ))
    }

    fn metrics(&self) -> &[Metric] {
        self.0.metrics()
    }

    fn problems(&self) -> Option<&dyn Problems> {
        Some(&self.0)
    }
}
