//! The distribution that the conditions of a trial in space are drawn from.

use cfpose_optim::manifold::rotation_of_quaternion;
use rand::RngExt;
use rand_chacha::ChaCha12Rng;
use rand_distr::StandardNormal;

use super::HuntSpace;
use super::body::{Body, Kind};
use crate::scenario::Determined;

/// Conditions of one trial.
pub(super) struct Conditions {
    /// Source points: log uniform, 20 to 3000.
    pub count: usize,
    pub body: Body,
    /// Whether the target is another body: 8 % of the trials.
    pub foreign: bool,
    /// Whether it is the mirror image of a body that has no plane of symmetry: 4 %.
    pub mirrored: bool,
    /// Whether both sides hold the same points (50 %), else the body is sampled anew.
    pub same: bool,
    /// Standard deviation in radii: one of 0, .002, .005, .01, .02, .03.
    pub noise: f64,
    /// Whether the source has the noise too: 30 %.
    pub both: bool,
    /// Share of the target that a plane cuts off: 5 to 40 % in 25 % of the trials.
    pub cut: f64,
    /// Clutter in shares of the target: 5 to 50 % in 35 % of the trials.
    pub clutter: f64,
    /// Uniform, row by row.
    pub rotation: [f64; 9],
    /// Normal, .5.
    pub translation: [f64; 3],
    /// 1, or .5 to 2 for similarities.
    pub scale: f64,
}

impl Conditions {
    /// Draw in the order of the fields.
    pub fn draw(scenario: &HuntSpace, rng: &mut ChaCha12Rng) -> Self {
        let drawn = (20.0 * 150.0_f64.powf(rng.random())).round() as usize;
        let count = scenario.points.unwrap_or(drawn);
        let drawn = Body::draw(rng);
        let body = scenario.kind.map_or(drawn, |kind| Body::of(kind, rng));
        let damaged = !scenario.clean;
        let fate: f64 = rng.random();
        // The mirror image of a body with a plane of symmetry is the body itself.
        let chiral = matches!(body.kind, Kind::Star | Kind::Bump);
        Self {
            count,
            body,
            foreign: fate < 0.08 && damaged,
            mirrored: (0.08..0.12).contains(&fate) && damaged && chiral,
            same: rng.random::<f64>() < 0.5,
            noise: [0.0, 0.002, 0.005, 0.01, 0.02, 0.03][rng.random_range(0..6)],
            both: rng.random::<f64>() < 0.3,
            cut: if rng.random::<f64>() < 0.25 && damaged { rng.random_range(0.05..0.4) } else { 0.0 },
            clutter: if rng.random::<f64>() < 0.35 && damaged { rng.random_range(0.05..0.5) } else { 0.0 },
            rotation: rotation_of_quaternion(&std::array::from_fn(|_| rng.sample(StandardNormal))),
            translation: std::array::from_fn(|_| 0.5 * rng.sample::<f64, _>(StandardNormal)),
            scale: match (rng.random_range(-0.69..0.69_f64), scenario.model) {
                (log_scale, "similarity3") => log_scale.exp(),
                _ => 1.0,
            },
        }
    }

    /// Say what the data determine.
    pub fn determined(&self) -> Determined {
        match (self.foreign || self.mirrored, self.same) {
            (true, _) => Determined::Nothing,
            // The pattern of the points tells symmetric poses apart, where the noise does not hide it.
            (false, true) => Determined::Theta,
            (false, false) => self.body.determined(),
        }
    }

    /// Return the conditions by name.
    pub fn named(&self) -> Vec<(&'static str, String)> {
        let word = |value: bool, yes: &str, no: &str| if value { yes } else { no }.to_string();
        let sizes = [50, 100, 200, 300, 1000, 3001];
        let size = sizes.into_iter().find(|most| self.count <= *most).unwrap_or(usize::MAX);
        vec![
            ("N", format!("<= {size}")),
            ("body", format!("{:?}", self.body.kind).to_lowercase()),
            ("noise", self.noise.to_string()),
            ("noise on", word(self.both, "both sides", "the target")),
            ("sampling", word(self.same, "same", "independent")),
            ("cut", word(self.cut > 0.0, "yes", "no")),
            ("clutter", word(self.clutter > 0.0, "yes", "no")),
            ("target", word(self.foreign, "another body", if self.mirrored { "mirrored" } else { "the body" })),
        ]
    }
}
