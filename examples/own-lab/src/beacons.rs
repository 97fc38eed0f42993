//! A least-squares problem that has no points and no pose: a place from its distances to beacons. See docs/adding/scenario.md.

use std::sync::Arc;

use cfpose::entry::ParameterSpec;
use cfpose_lab::problems::{Ended, OfProblems, Posed, Problems};
use cfpose_lab::rand::RngExt;
use cfpose_lab::rand_distr::StandardNormal;
use cfpose_lab::{ChaCha12Rng, Metric, ScenarioEntry, ScenarioError, Score};
use cfpose_optim::manifold::{Euclidean, Manifold};
use cfpose_optim::{Capabilities, LeastSquares};

/// r_i = norm(x - beacon_i) - distance_i.
struct Ranges {
    beacons: Vec<[f64; 2]>,
    distances: Vec<f64>,
}

impl LeastSquares for Ranges {
    fn manifold(&self) -> &dyn Manifold {
        &Euclidean(2)
    }

    fn num_residuals(&self) -> usize {
        self.beacons.len()
    }

    fn residual(&self, x: &[f64], residual: &mut [f64]) {
        for ((beacon, distance), r) in self.beacons.iter().zip(&self.distances).zip(residual) {
            *r = (x[0] - beacon[0]).hypot(x[1] - beacon[1]) - distance;
        }
    }

    fn jacobian(&self, x: &[f64], residual: &mut [f64], jacobian: &mut [f64]) {
        self.residual(x, residual);
        for (beacon, row) in self.beacons.iter().zip(jacobian.chunks_exact_mut(2)) {
            let away = [x[0] - beacon[0], x[1] - beacon[1]];
            let norm = away[0].hypot(away[1]);
            row.copy_from_slice(&away.map(|a| a / norm));
        }
    }

    fn capabilities(&self) -> Capabilities {
        Capabilities { jacobian: true, curvature: false }
    }
}

/// Draws, in this order: two normals a beacon, its place; two normals, the place that is sought, at the origin of the frame; a normal
/// a distance; two normals, the start.
struct Beacons {
    count: usize,
    noise: f64,
}

/// `error` in the results: the first metric.
const METRICS: &[Metric] = &[Metric::error("misfit", "m"), Metric::gain("north", "m")];

impl Problems for Beacons {
    fn posed(&self, rng: &mut ChaCha12Rng) -> Result<Posed, ScenarioError> {
        let mut normal = || rng.sample::<f64, _>(StandardNormal);
        let beacons: Vec<[f64; 2]> = (0..self.count).map(|_| [3.0 * normal(), 3.0 * normal()]).collect();
        let distances = beacons.iter().map(|b| b[0].hypot(b[1]) + self.noise * normal()).collect();
        Ok(Posed { problem: Arc::new(Ranges { beacons, distances }), start: vec![normal(), normal()] })
    }

    fn metrics(&self) -> &[Metric] {
        METRICS
    }

    // The place is the origin. The second metric only shows that more can be better, and that there may be several.
    fn score(&self, ended: &Ended<'_>) -> Option<Score> {
        Some(Score::of(vec![ended.theta[0].hypot(ended.theta[1]), ended.theta[1]]))
    }

    fn succeeds(&self, ended: &Ended<'_>, score: &Score) -> bool {
        score.values[0] <= 5.0 * self.noise + 1e-6 && ended.cost.is_finite()
    }
}

/// The table line.
pub static ENTRY: ScenarioEntry = ScenarioEntry {
    name: "beacons",
    summary: "a place from its distances to beacons: a least-squares problem of your own; success within 5 standard deviations",
    parameters: &[
        ParameterSpec { name: "count", default: "8", meaning: "number of beacons, 3 to 1000" },
        ParameterSpec { name: "noise", default: "0.01", meaning: "standard deviation of a distance, m, >= 0" },
    ],
    source: "own-lab",
    build: |parameters| {
        let noise = parameters.number("noise", "a number from 0 up", |v| v.is_finite() && v >= 0.0)?;
        Ok(Box::new(OfProblems(Beacons { count: parameters.count("count", 3, 1000)?, noise })))
    },
};
