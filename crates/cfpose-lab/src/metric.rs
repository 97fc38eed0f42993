//! What a scenario measures of an estimate: named numbers, of which the error of a pose is one case.

use cfpose::PoseError;

/// One number that a scenario computes for every estimate.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Metric {
    /// Name in records, summaries and tables.
    pub name: &'static str,
    /// Unit, `1` for a plain number.
    pub unit: &'static str,
    /// Whether a smaller value is a better one.
    pub smaller_is_better: bool,
}

impl Metric {
    /// Make a metric of which less is better: an error.
    pub const fn error(name: &'static str, unit: &'static str) -> Self {
        Self { name, unit, smaller_is_better: true }
    }

    /// Make a metric of which more is better: a number of right digits, an overlap.
    pub const fn gain(name: &'static str, unit: &'static str) -> Self {
        Self { name, unit, smaller_is_better: false }
    }

    /// Say whether the metric is one of a pose: it stands in a column of its own in every record.
    pub fn is_of_pose(&self) -> bool {
        POSE.iter().any(|metric| metric.name == self.name)
    }
}

/// The metrics of a pose: what [`Score::of_pose`] holds. `error` is e = sqrt(angle^2 + translation^2), angle in radians.
pub const POSE: &[Metric] =
    &[Metric::error("rotation_deg", "deg"), Metric::error("translation", "target"), Metric::error("error", "1")];

/// What a scenario says about one estimate, before it is called a success or none.
#[derive(Debug, Clone, PartialEq)]
pub struct Score {
    /// Error as a pose, where the model has one.
    pub pose: Option<PoseError>,
    /// One value for each of the scenario's metrics, in their order.
    pub values: Vec<f64>,
}

impl Score {
    /// Make the score of a scenario whose metrics are those of a pose.
    ///
    /// ```
    /// use cfpose::PoseError;
    /// let score = cfpose_lab::metric::Score::of_pose(PoseError { angle: 0.0, translation: 0.25 });
    /// assert_eq!(score.values, [0.0, 0.25, 0.25]);
    /// ```
    pub fn of_pose(error: PoseError) -> Self {
        Self { values: vec![error.angle.to_degrees(), error.translation, error.total()], pose: Some(error) }
    }

    /// Make a score of a scenario's own metrics.
    pub fn of(values: Vec<f64>) -> Self {
        Self { pose: None, values }
    }

    /// Return by how much an estimate misses: e of a pose, else the first metric, negated where more is better. Of several true
    /// thetas the one with the smallest counts.
    pub fn miss(&self, metrics: &[Metric]) -> f64 {
        match (&self.pose, metrics.first(), self.values.first()) {
            (Some(error), ..) => error.total(),
            (None, Some(metric), Some(value)) if !metric.smaller_is_better => -value,
            (None, _, value) => value.copied().unwrap_or(f64::INFINITY),
        }
    }
}
