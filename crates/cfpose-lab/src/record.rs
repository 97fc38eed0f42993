//! One record: what one method did in one trial.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use crate::seed::fnv1a;

/// [`fnv1a`] of files in 16 hexadecimal digits, by the name of the file without its folder; files of one name are joined by `+`.
pub type DataHashes = BTreeMap<String, String>;

/// The version that records carry.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");

/// One line of `trials.jsonl`.
///
/// Everything but `seconds` (and `timed_out`, where the experiment has a wall-clock limit) depends on the experiment and the
/// instruction set alone.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// Fingerprint of the experiment.
    pub experiment: String,
    /// Name of the scenario.
    pub scenario: String,
    /// All parameters of the cell.
    pub parameters: Map<String, Value>,
    /// Name of the method.
    pub method: String,
    /// What the scenario drew at random, by name.
    #[serde(skip_serializing_if = "Map::is_empty", default)]
    pub conditions: Map<String, Value>,
    /// Whether the data determine one theta; where not, `good` is wrong whatever the estimate.
    #[serde(skip_serializing_if = "is_true", default = "truth")]
    pub determined: bool,
    /// Repetition, from 0.
    pub repetition: usize,
    /// Key of the trial, 16 hexadecimal digits.
    pub key: String,
    /// Whether the estimate is usable and within the scenario's threshold.
    pub success: bool,
    /// The same by the sum of angle and translation.
    pub success_sum: bool,
    /// Angle between estimate and truth, degrees.
    pub rotation_deg: Option<f64>,
    /// Norm of the difference of translations.
    pub translation: Option<f64>,
    /// e = sqrt(angle^2 + translation^2), angle in radians; the first metric of a scenario without a pose.
    pub error: Option<f64>,
    /// angle + translation, angle in radians.
    pub e_sum: Option<f64>,
    /// The scenario's metrics that are not those of a pose, by name ([`crate::metric::Metric`]); a scenario without a pose has its
    /// first one, where less is better, in `error` too.
    #[serde(skip_serializing_if = "BTreeMap::is_empty", default)]
    pub metrics: BTreeMap<String, f64>,
    /// Estimate as a list (rotation vector, translation); ambient for a least-squares problem.
    pub theta: Option<Vec<f64>>,
    /// Status of the best solve.
    pub status: String,
    /// Whether the estimate may be used.
    pub usable: bool,
    /// `good`, `suspect`, `failed`, or nothing where the weighting has no statistic.
    pub verdict: Option<String>,
    /// What the estimate is the best fit of: `moments` or `points`.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub by: Option<String>,
    /// Reported standard deviation of the noise.
    #[serde(default)]
    pub noise_sigma: Option<f64>,
    /// Reported J statistic.
    #[serde(default)]
    pub j_statistic: Option<f64>,
    /// Degrees of freedom of the J statistic.
    #[serde(default)]
    pub degrees_of_freedom: Option<usize>,
    /// Probability of a larger J statistic for data that fit the model.
    #[serde(default)]
    pub p_value: Option<f64>,
    /// Squared Mahalanobis distance of the truth from the estimate under the reported covariance
    /// ([`crate::calibration::mahalanobis`]).
    #[serde(default)]
    pub mahalanobis: Option<f64>,
    /// Degrees of freedom of `mahalanobis`: free tangent directions.
    #[serde(default)]
    pub mahalanobis_dof: Option<usize>,
    /// Cost at the estimate.
    pub cost: Option<f64>,
    /// Residual evaluations over all starts.
    pub evaluations: usize,
    /// Iterations over all starts.
    pub iterations: usize,
    /// Number of starts.
    pub starts: usize,
    /// Whether the trial took at least the experiment's wall-clock limit, so that its result depends on the machine.
    #[serde(default)]
    pub timed_out: bool,
    /// Number of source and target points; 0 in records of programs that did not count.
    #[serde(skip_serializing_if = "is_zero", default)]
    pub num_source: usize,
    /// Number of target points, likewise.
    #[serde(skip_serializing_if = "is_zero", default)]
    pub num_target: usize,
    /// Free tangent directions of theta.
    #[serde(skip_serializing_if = "is_zero", default)]
    pub unknowns: usize,
    /// Tangent coordinates of the start at the truth, by direction (`rx`); empty where the method finds its own start.
    #[serde(skip_serializing_if = "BTreeMap::is_empty", default)]
    pub start_offset: BTreeMap<String, f64>,
    /// Lowest cost of the first solve from the first start after every budget of [`BUDGETS`], up to the one in which it ended.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub trace: Vec<f64>,
    /// Why there is no estimate.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub message: Option<String>,
    /// Instruction set.
    pub isa: String,
    /// Wall-clock seconds of preparing and solving.
    pub seconds: f64,
    /// Hash of every file that the scenario read, by name, and of those that the method names, as `weights:NAME`.
    #[serde(skip_serializing_if = "DataHashes::is_empty", default)]
    pub data: DataHashes,
    /// Version of the program that computed the record; empty in records of programs that wrote none.
    #[serde(default)]
    pub version: String,
    /// [`fnv1a`] of the record as a line of JSON with this field empty, 16 hexadecimal digits.
    #[serde(default)]
    pub checksum: String,
}

/// Numbers of residual evaluations after which a trace is read.
pub const BUDGETS: [usize; 20] = [1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 256, 384, 512, 768, 1024];

fn is_zero(value: &usize) -> bool {
    *value == 0
}

fn is_true(value: &bool) -> bool {
    *value
}

fn truth() -> bool {
    true
}

impl Record {
    /// Say whether the verdict is `good` where it must not be: the estimate is no success, or the data do not determine theta.
    pub fn is_wrong_but_good(&self) -> bool {
        self.verdict.as_deref() == Some("good") && !(self.success && self.determined)
    }

    /// Return the number of source points, if the record or a parameter `points` says it.
    pub fn num_points(&self) -> Option<usize> {
        let parameter = || self.parameters.get("points")?.as_u64().map(|count| count as usize);
        Some(self.num_source).filter(|count| *count > 0).or_else(parameter)
    }

    /// Return the number of unknowns: free tangent directions, or the length of theta in records that do not say.
    pub fn num_unknowns(&self) -> usize {
        if self.unknowns > 0 { self.unknowns } else { self.theta.as_ref().map_or(0, Vec::len) }
    }

    /// Return the value of a metric by name, those of a pose included.
    pub fn metric(&self, name: &str) -> Option<f64> {
        match name {
            "rotation_deg" => self.rotation_deg,
            "translation" => self.translation,
            "error" => self.error,
            _ => self.metrics.get(name).copied(),
        }
    }

    /// Say whether two records agree in everything but the time.
    pub fn same_result(&self, other: &Record) -> bool {
        let result = |record: &Record| Record { seconds: 0.0, checksum: String::new(), ..record.clone() };
        result(self) == result(other)
    }

    /// Compute the checksum of the record as it is.
    fn sum(&self) -> String {
        let mut line = serde_json::to_string(self).unwrap_or_default();
        // The checksum is the last field: cutting it out of the line is cheaper than a record without it.
        let end = format!("\"checksum\":\"{}\"}}", self.checksum);
        if line.ends_with(&end) {
            line.truncate(line.len() - end.len());
            line.push_str("\"checksum\":\"\"}");
        } else {
            let bare = Record { checksum: String::new(), ..self.clone() };
            line = serde_json::to_string(&bare).unwrap_or_default();
        }
        format!("{:016x}", fnv1a(line.as_bytes()))
    }

    /// Write the checksum into the record.
    pub fn seal(&mut self) {
        self.checksum = self.sum();
    }

    /// Say whether the record is as it was sealed; records of programs that wrote no checksum count as whole.
    pub fn is_whole(&self) -> bool {
        (self.version.is_empty() && self.checksum.is_empty()) || self.checksum == self.sum()
    }

    /// Return what identifies the record in its experiment.
    pub fn identity(&self) -> (String, String) {
        (self.key.clone(), self.method.clone())
    }
}
