//! Random Fourier features: waves whose frequencies are drawn from a Gaussian.

use cfpose_kernel::family::General;
use rand::SeedableRng;
use rand_chacha::ChaCha12Rng;
use rand_distr::{Distribution, StandardNormal};

use super::shared::waves::Waves;
use crate::entry::FamilyEntry;
use crate::entry::ParameterSpec;

pub(super) const ENTRY: FamilyEntry = FamilyEntry {
    name: "random-fourier",
    summary: "cos(w.x) and sin(w.x) with frequencies drawn from a Gaussian",
    parameters: &[
        ParameterSpec { name: "count", default: "32", meaning: "number of frequencies, 1 to 4096" },
        ParameterSpec {
            name: "scale",
            default: "2",
            meaning: "standard deviation of each frequency component, rad per unit of the feature space",
        },
        ParameterSpec {
            name: "seed",
            default: "run",
            meaning: "whole number, or `run` for the seed of the whole estimate",
        },
    ],
    source: "Rahimi and Recht 2007; not in the paper",
    details: "All cosines, then all sines, of w.x for `count` frequencies w ~ N(0, scale^2 I), the same for the same seed on every machine. The distance of means is a Monte-Carlo estimate of the maximum mean discrepancy under a Gaussian kernel of width 1 / scale. Costs one sine and cosine per frequency and point, `fourier` one per axis. Has a closed-form blur.",
    build: |parameters, context| {
        let count = parameters.count("count", 1, 4096)?;
        let scale = parameters.number("scale", "a positive number", |s| s > 0.0 && s.is_finite())?;
        let seed = match parameters.text("seed") {
            "run" => context.seed,
            _ => parameters.parse("seed", "a whole number of at least 0, or `run`")?,
        };
        let mut rng = ChaCha12Rng::seed_from_u64(seed);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let frequencies = (0..count).map(|_| [scale * normal(), scale * normal(), scale * normal()]).collect();
        Ok(Box::new(General(Waves::new(frequencies))))
    },
};
