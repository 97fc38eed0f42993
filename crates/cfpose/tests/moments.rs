//! The moment path: polynomial features of an affine model from moments of the points alone.

use cfpose::check::{Sample, derivatives};
use cfpose::moments::Moments;
use cfpose::{Execution, Isa, Points, Registry};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha12Rng;

const FAMILIES: [&str; 4] =
    ["hermite[degree=3]", "hermite[degree=6]", "hermite[degree=5,kind=separable]", "monomial[degree=6]"];

/// Names of the models whose means follow from moments.
fn affine_models(registry: &Registry) -> Vec<&'static str> {
    let draws = registry.models.iter().filter(|model| {
        let sample = Sample::draw(registry, model.name, 300, 0.1, 1).unwrap();
        let problem = sample.problem(registry, "hermite[degree=6]", &Execution::default()).unwrap();
        problem.is_some_and(|problem| problem.uses_moments())
    });
    draws.map(|model| model.name).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]
    #[test]
    fn moments_equal_direct_sums_and_num_dual(seed in 0_u64..1_000_000, spread in 0.1_f64..4.0, shift in -50.0_f64..50.0) {
        let registry = Registry::default();
        let models = affine_models(&registry);
        let model = models[(seed % models.len() as u64) as usize];
        let mut sample = Sample::draw(&registry, model, 400, spread, seed).unwrap();
        // A source far from the origin must not cost digits: moments are centred and scaled.
        let columns = (0..sample.source.dim()).map(|d| sample.source.column(d).iter().map(|x| 3.0 * x + shift).collect());
        let moved = Points::from_columns(columns.collect()).unwrap();
        sample.source = if shift.abs() < 5.0 { moved } else { sample.source };
        for family in FAMILIES {
            let fast = sample.problem(&registry, family, &Execution::default()).unwrap().unwrap();
            let direct = sample.problem(&registry, family, &Execution::default()).unwrap().unwrap().with_direct_sums();
            prop_assert!(fast.uses_moments() && !direct.uses_moments());
            let (a, b) = (fast.evaluate(&sample.theta), direct.evaluate(&sample.theta));
            let scale = |values: &[f64]| values.iter().fold(1.0_f64, |s, v| s.max(v.abs()));
            let means = scale(&b.source_means);
            for (x, y) in a.source_means.iter().zip(&b.source_means) {
                prop_assert!((x - y).abs() < 1e-10 * means, "{model} x {family}: {x} {y}");
            }
            let slopes = scale(&b.jacobian);
            for (x, y) in a.jacobian.iter().zip(&b.jacobian) {
                prop_assert!((x - y).abs() < 1e-10 * slopes, "{model} x {family}: {x} {y}");
            }
        }
    }
}

#[test]
fn rigid_and_gain_models_use_moments_and_pass_the_derivative_checks() {
    let registry = Registry::default();
    let models = affine_models(&registry);
    assert!(models.contains(&"rigid3") && models.contains(&"gain1"), "{models:?}");
    assert!(!models.contains(&"bearing3") && !models.contains(&"epipolar"), "{models:?}");
    for model in models {
        let sample = Sample::draw(&registry, model, 300, 0.5, 3).unwrap();
        for family in FAMILIES {
            let problem = sample.problem(&registry, family, &Execution::default()).unwrap().unwrap();
            let report = derivatives(&problem, &sample.theta);
            assert!(report.finite_difference < 1e-6 && report.oracle < 1e-10, "{model} x {family}: {report:?}");
        }
    }
}

#[test]
fn shards_merge_to_the_moments_of_the_whole() {
    let mut rng = ChaCha12Rng::seed_from_u64(1);
    let rows: Vec<[f64; 3]> =
        (0..10_000).map(|_| [rng.random(), 2.0 * rng.random::<f64>() + 7.0, rng.random()]).collect();
    let whole = Points::from_rows(&rows).unwrap();
    for isa in Isa::available() {
        let execution = Execution { isa, pool: None };
        let all = Moments::of_points(&whole, 6, &execution);
        let shard = |range: std::ops::Range<usize>| Points::from_rows(&rows[range]).unwrap();
        let mut merged = Moments::like(&all, &shard(0..1234), &execution);
        merged.merge(&Moments::like(&all, &shard(1234..8000), &execution));
        merged.merge(&Moments::like(&all, &shard(8000..10_000), &execution));
        for (a, b) in merged.values().iter().zip(all.values()) {
            assert!((a - b).abs() < 1e-12 * b.abs().max(1.0));
        }
    }
}
