//! Distances between the points after a fit: support, coherence, sampling.

use cfpose::Points;
use cfpose::distances::{Sampling, Support};
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha12Rng;
use rand_distr::StandardNormal;

const COUNT: usize = 1500;

/// A closed lopsided curve (dim 2) or surface (dim 3) of size about 1, at random places.
fn shape(dim: usize, count: usize, rng: &mut ChaCha12Rng) -> Vec<[f64; 3]> {
    let mut point = || {
        let (t, z) = (std::f64::consts::TAU * rng.random::<f64>(), 2.0 * rng.random::<f64>() - 1.0);
        let r = 1.0 + 0.25 * (2.0 * t + 0.3).cos() + 0.12 * (3.0 * t).cos();
        if dim == 2 {
            return [r * t.cos(), r * t.sin(), 0.0];
        }
        let s = (1.0 - z * z).sqrt();
        [r * s * t.cos(), r * s * t.sin(), z * (1.0 + 0.3 * s * t.sin())]
    };
    (0..count).map(|_| point()).collect()
}

fn noisy(rows: &[[f64; 3]], dim: usize, sigma: f64, rng: &mut ChaCha12Rng) -> Vec<[f64; 3]> {
    let mut moved = rows.to_vec();
    for row in &mut moved {
        row[..dim].iter_mut().for_each(|x| *x += sigma * rng.sample::<f64, _>(StandardNormal));
    }
    moved.shuffle(rng);
    moved
}

fn points(rows: &[[f64; 3]], dim: usize) -> Points {
    Points::from_columns((0..dim).map(|d| rows.iter().map(|row| row[d]).collect()).collect()).unwrap()
}

fn rng(seed: u64) -> ChaCha12Rng {
    ChaCha12Rng::seed_from_u64(seed)
}

/// Return source and target, the target sampled as said, with so much noise.
fn pair(dim: usize, sampling: Sampling, sigma: f64, seed: u64) -> [Points; 2] {
    let mut rng = rng(seed);
    let source = shape(dim, COUNT, &mut rng);
    let clean = match sampling {
        Sampling::Same => source.clone(),
        Sampling::Thinned => source[..COUNT * 3 / 5].to_vec(),
        Sampling::Independent => shape(dim, COUNT, &mut rng),
        Sampling::Raster => unreachable!("no pixels here"),
    };
    let target = noisy(&clean, dim, sigma, &mut rng);
    [points(&source, dim), points(&target, dim)]
}

fn detect(dim: usize, sampling: Sampling, sigma: f64, seed: u64) -> Sampling {
    let [source, target] = pair(dim, sampling, sigma, seed);
    Sampling::detect(
        &Support::of(&source, &target, None),
        dim,
        [target.len(), source.len()],
        &cfpose::Criteria::default(),
    )
}

#[test]
fn the_sampling_is_seen_by_distances_where_the_noise_leaves_it_visible() {
    for dim in [2, 3] {
        let [source, _] = pair(dim, Sampling::Same, 0.0, 0);
        let spacing = Support::of(&source, &source, None).source_spacing;
        for seed in 0..4 {
            for truth in [Sampling::Same, Sampling::Thinned, Sampling::Independent] {
                for share in [0.0, 0.1, 0.25] {
                    let found = detect(dim, truth, share * spacing, seed);
                    assert_eq!(found, truth, "{dim}-D, noise {share} of the spacing, seed {seed}");
                }
            }
            // Much noise hides where the points were: the counts decide, and independent samples pass for the same points.
            for (truth, expected) in [
                (Sampling::Same, Sampling::Same),
                (Sampling::Thinned, Sampling::Thinned),
                (Sampling::Independent, Sampling::Same),
            ] {
                assert_eq!(detect(dim, truth, 4.0 * spacing, seed), expected, "{dim}-D, large noise, seed {seed}");
            }
        }
    }
}

#[test]
fn distances_along_normals_are_the_noise_however_the_sets_were_sampled() {
    for dim in [2, 3] {
        for sampling in [Sampling::Same, Sampling::Thinned, Sampling::Independent] {
            let [source, target] = pair(dim, sampling, 0.03, 5);
            let sigma = Support::of(&source, &target, None).normal_sigma;
            println!("{dim}-D {sampling:?}: {sigma:.4}");
            assert!((sigma / 0.03 - 1.0).abs() < 0.2, "{dim}-D {sampling:?}: {sigma}");
        }
    }
}

#[test]
fn coherence_tells_a_misplaced_shape_from_noise() {
    for dim in [2, 3] {
        for (seed, sigma) in [(1, 0.0), (2, 0.02), (3, 0.1)] {
            for sampling in [Sampling::Same, Sampling::Independent] {
                let [source, target] = pair(dim, sampling, sigma, seed);
                let right = Support::of(&source, &target, None);
                assert!(right.coherence < 0.15, "{dim}-D, noise {sigma}, {sampling:?}: {}", right.coherence);
                let rows: Vec<[f64; 3]> = (0..source.len())
                    .map(|k| {
                        let p = source.point(k);
                        [p[0] * 0.92 - p[1] * 0.39 + 0.3, p[0] * 0.39 + p[1] * 0.92, p[2]]
                    })
                    .collect();
                let wrong = Support::of(&points(&rows, dim), &target, None);
                println!("{dim}-D noise {sigma} {sampling:?}: {:.2} {:.2}", right.coherence, wrong.coherence);
                // A region of a surface is wide, and its normals turn within it: less is in common than along a curve.
                let least = if dim == 2 { 0.6 } else { 0.3 };
                assert!(wrong.coherence > least, "{dim}-D, noise {sigma}, {sampling:?}: {}", wrong.coherence);
                assert!(wrong.distance() > 1.2 * right.distance(), "{dim}-D, noise {sigma}, {sampling:?}");
            }
        }
    }
}

#[test]
fn what_one_set_lacks_is_unexplained_in_the_other() {
    for dim in [2, 3] {
        let [source, target] = pair(dim, Sampling::Independent, 0.01, 9);
        let kept: Vec<usize> = (0..target.len()).filter(|k| target.point(*k)[0] > 0.0).collect();
        let share = 1.0 - kept.len() as f64 / target.len() as f64;
        let part = target.select(&kept).unwrap();
        let support = Support::of(&source, &part, Some(0.01));
        println!("{dim}-D: cut {share:.2}, unexplained {:.2}", support.unexplained_source);
        // A margin along the cut is within the reach of the neighbours.
        assert!(support.unexplained_source > 0.6 * share && support.unexplained_source < share + 0.02, "{dim}-D");
        assert!(support.unexplained_target < 0.01, "{dim}-D: {}", support.unexplained_target);

        // Clutter is the other way round.
        let mut rows: Vec<[f64; 3]> = (0..target.len()).map(|k| target.point(k)).collect();
        let mut random = rng(10);
        for _ in 0..target.len() / 4 {
            rows.push(std::array::from_fn(|d| if d < dim { 3.0 + random.random::<f64>() } else { 0.0 }));
        }
        let support = Support::of(&source, &points(&rows, dim), Some(0.01));
        assert!((support.unexplained_target - 0.2).abs() < 0.02, "{dim}-D: {}", support.unexplained_target);
        assert!(support.unexplained_source < 0.02, "{dim}-D: {}", support.unexplained_source);
    }
}
