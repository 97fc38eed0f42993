//! A scenario: a leaf and its stretched, noisy copy in another order. See docs/adding/scenario.md.

use cfpose::entry::ParameterSpec;
use cfpose::theta::Layout;
use cfpose::{Points, Side};
use cfpose_lab::rand::RngExt;
use cfpose_lab::rand_distr::StandardNormal;
use cfpose_lab::{ChaCha12Rng, Metric, Scenario, ScenarioEntry, ScenarioError, Score, Success, Trial};

/// Draws, in this order: five normals, theta; two normals a target point, the noise.
struct Leaf {
    noise: f64,
    turn: f64,
}

impl Scenario for Leaf {
    fn model(&self) -> &str {
        "stretch2"
    }

    fn trial(&self, rng: &mut ChaCha12Rng) -> Result<Trial, ScenarioError> {
        let mut normal = || rng.sample::<f64, _>(StandardNormal);
        let truth =
            vec![self.turn * normal(), 1.0 + 0.1 * normal(), 1.0 + 0.1 * normal(), 0.3 * normal(), 0.3 * normal()];
        let source: Vec<[f64; 2]> = (0..600).map(|k| outline(f64::from(k) / 600.0)).collect();
        // The order of the target has no meaning: turned round, so that nothing can depend on it.
        let target: Vec<[f64; 2]> =
            source.iter().rev().map(|p| stretched(&truth, *p).map(|x| x + self.noise * normal())).collect();
        let points = |side, rows: &[[f64; 2]]| {
            Points::from_rows(rows).map_err(|problem| ScenarioError::Points { side, problem })
        };
        let trial =
            Trial::new(points(Side::Source, &source)?, points(Side::Target, &target)?, truth, Success::Metric(0.05));
        Ok(trial.with_start(vec![0.0, 1.0, 1.0, 0.0, 0.0]))
    }

    // The model has no pose in 3-D, so the scenario has metrics of its own. The first one is `error` in the results and what
    // `Success::Metric` compares; `succeeds` could be any other rule.
    fn metrics(&self) -> &[Metric] {
        METRICS
    }

    fn score(&self, _layout: &Layout, estimate: &[f64], truth: &[f64], _trial: &Trial) -> Option<Score> {
        let norm = |range: std::ops::Range<usize>| range.map(|j| (estimate[j] - truth[j]).powi(2)).sum::<f64>().sqrt();
        let values = vec![norm(0..5), norm(1..3), norm(3..5)];
        values.iter().all(|value| value.is_finite()).then(|| Score::of(values))
    }
}

const METRICS: &[Metric] =
    &[Metric::error("misfit", "1"), Metric::error("stretch", "1"), Metric::error("shift", "target")];

/// Return a point of an outline without symmetry, t from 0 to 1.
fn outline(t: f64) -> [f64; 2] {
    let phi = std::f64::consts::TAU * t;
    let radius = 1.0 + 0.3 * phi.cos() + 0.15 * (2.0 * phi).sin() + 0.1 * (3.0 * phi).cos();
    [1.6 * radius * phi.cos(), radius * phi.sin()]
}

/// Map a point as the model does.
fn stretched(theta: &[f64], p: [f64; 2]) -> [f64; 2] {
    let (sine, cosine) = theta[0].sin_cos();
    let (x, y) = (theta[1] * p[0], theta[2] * p[1]);
    [cosine * x - sine * y + theta[3], sine * x + cosine * y + theta[4]]
}

/// The table line.
pub static ENTRY: ScenarioEntry = ScenarioEntry {
    name: "leaf",
    summary: "an outline without symmetry and its stretched copy; success below 0.05",
    parameters: &[
        ParameterSpec { name: "noise", default: "0.01", meaning: "standard deviation of the target's noise, >= 0" },
        ParameterSpec { name: "turn", default: "0.2", meaning: "standard deviation of the angle, radians, >= 0" },
    ],
    source: "own-lab",
    build: |parameters| {
        let at_least_zero = |key| parameters.number(key, "a number from 0 up", |v| v.is_finite() && v >= 0.0);
        Ok(Box::new(Leaf { noise: at_least_zero("noise")?, turn: at_least_zero("turn")? }))
    },
};
