//! The distribution that the conditions of a planar trial are drawn from.

use std::f64::consts::TAU;

use cfpose::theta::{Layout, RotationForm};
use cfpose_optim::manifold::{multiply3, rotation_exp};
use rand::RngExt;
use rand_chacha::ChaCha12Rng;

use crate::sampling::chosen;

/// Where the true pose is, a third each.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum View {
    /// Euler angles within +-.35, T_bar within +-.3.
    Table,
    /// Any turn, tilt to 30 degrees, depth .8 to 1.6.
    Mild,
    /// Any turn, tilt to 60 degrees, depth .5 to 3.
    Wide,
}

/// How both sets are drawn from the curve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Sampling {
    /// The same points, evenly spaced in the parameter: 45 %.
    Same,
    /// Uniform parameters, anew for each side: 35 %.
    Independent,
    /// Uniform arc lengths, anew for each side: 10 %.
    ArcLength,
    /// Modulated density, anew for each side: 10 %.
    Modulated,
}

/// Which side has a hidden arc of 3 to 40 %; one in 35 % of the trials.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Occlusion {
    None,
    Source,
    Target,
    Both,
}

/// What the outliers are; 35 % of the trials have 3 to 70 % of N.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Outlier {
    /// A square of .05 of the image's size.
    Blob,
    /// Uniform over 1.6 times the extent.
    Uniform,
    /// A second curve.
    Curve,
}

/// Conditions of one trial.
pub(super) struct Conditions {
    pub num_source: usize,
    pub num_target: usize,
    pub pose: View,
    /// Standard deviation in sizes of the image (half the larger side of its bounding box): one of 0, .002, .005, .01, .02, .03, .05.
    pub noise: f64,
    /// b_i of the start, `None` in 40 % of the trials, else .1, .2, .5 or 1.
    pub start: Option<f64>,
    pub sampling: Sampling,
    pub occlusion: Occlusion,
    pub outlier: Option<Outlier>,
    pub outlier_share: f64,
    pub foreign: bool,
}

impl Conditions {
    /// Draw in the order of the fields; `points` fixes N, `clean` leaves out arcs and outliers, `foreign` is the share of other
    /// curves.
    pub fn draw(points: Option<usize>, clean: bool, foreign: f64, rng: &mut ChaCha12Rng) -> Self {
        let sizes = [(50, 12), (100, 22), (200, 20), (300, 20), (1000, 16), (3142, 10)];
        let drawn = chosen(&sizes, rng);
        let num_source = points.unwrap_or(drawn);
        let pose = chosen(&[(View::Table, 1), (View::Mild, 1), (View::Wide, 1)], rng);
        let noise = [0.0, 0.002, 0.005, 0.01, 0.02, 0.03, 0.05][rng.random_range(0..7)];
        let start = [0.1, 0.2, 0.5, 1.0][rng.random_range(0..4)];
        let start = (rng.random::<f64>() >= 0.4).then_some(start);
        let kinds =
            [(Sampling::Same, 45), (Sampling::Independent, 35), (Sampling::ArcLength, 10), (Sampling::Modulated, 10)];
        let sampling = chosen(&kinds, rng);
        let ratio = if rng.random::<f64>() < 0.5 { rng.random_range(0.5..1.5) } else { 1.0 };
        let ratio = if sampling == Sampling::Same { 1.0 } else { ratio };
        let side = chosen(&[(Occlusion::Source, 1), (Occlusion::Target, 1), (Occlusion::Both, 1)], rng);
        let occlusion = if rng.random::<f64>() < 0.35 && !clean { side } else { Occlusion::None };
        let kind = chosen(&[(Outlier::Blob, 1), (Outlier::Uniform, 1), (Outlier::Curve, 1)], rng);
        let outlier = (rng.random::<f64>() < 0.35 && !clean).then_some(kind);
        let outlier_share = rng.random_range(0.03..0.7);
        Self {
            num_source,
            num_target: (ratio * num_source as f64).round() as usize,
            pose,
            noise,
            start,
            sampling,
            occlusion,
            outlier,
            outlier_share,
            foreign: rng.random::<f64>() < foreign,
        }
    }

    /// Return the conditions by name.
    pub fn named(&self) -> Vec<(&'static str, String)> {
        let word = |value: &dyn std::fmt::Debug| format!("{value:?}").to_lowercase();
        vec![
            ("N", self.num_source.to_string()),
            ("view", word(&self.pose)),
            ("noise", self.noise.to_string()),
            ("start", self.start.map_or_else(|| "none".to_string(), |b_i| b_i.to_string())),
            ("sampling", word(&self.sampling)),
            ("hidden", word(&self.occlusion)),
            ("outliers", self.outlier.map_or_else(|| "none".to_string(), |kind| word(&kind))),
            ("target", if self.foreign { "another curve" } else { "the curve" }.to_string()),
        ]
    }
}

/// Draw Euler angles and T_bar: the centre of the curve at a depth, on a ray with image coordinates within +-.3; any turn in the
/// plane, then a tilt about an axis in it.
pub(super) fn anywhere(tilt_deg: f64, depth: std::ops::Range<f64>, rng: &mut ChaCha12Rng) -> [f64; 6] {
    let (turn, azimuth) = (TAU * rng.random::<f64>(), TAU * rng.random::<f64>());
    let tilt = tilt_deg.to_radians() * rng.random::<f64>();
    let z = rng.random_range(depth);
    let ray: [f64; 2] = std::array::from_fn(|_| rng.random_range(-0.3..0.3));
    let tilted = rotation_exp(&[tilt * azimuth.cos(), tilt * azimuth.sin(), 0.0]);
    let rotation = multiply3(&tilted, &rotation_exp(&[0.0, 0.0, turn]));
    // The centre (0, 0, 1) goes to z (ray, 1).
    let translation = [z * ray[0] - rotation[2], z * ray[1] - rotation[5], z - rotation[8]];
    let theta: Vec<f64> = rotation.iter().chain(&translation).copied().collect();
    let list = Layout::pose3().to_list(&theta, RotationForm::Euler);
    std::array::from_fn(|j| list[j])
}
