//! The inlining cliff: lanes must be faster than plain numbers, as a ratio within one run.
//!
//! Per-point code that is not inlined falls out of the instruction set and becomes slower than plain numbers. Healthy pairs are 4
//! to 8 times faster with AVX-512 and 3 to 4 times with AVX2; the bounds leave room for a busy machine.

use std::hint::black_box;
use std::time::{Duration, Instant};

use cfpose::check::Sample;
use cfpose::{Execution, Isa, Registry};

/// Model, family: separable, closed under differentiation, neither; with and without projection.
const PAIRS: [(&str, &str); 6] = [
    ("bearing3", "trig18"),
    ("bearing3", "hermite[degree=3]"),
    ("bearing3", "fourier[k=2]"),
    ("bearing3", "rbf"),
    ("rigid3", "trig18"),
    ("homography", "hermite[degree=4]"),
];

/// Return time on plain numbers over time on lanes: shortest of many, in turns.
fn speedup(model: &str, family: &str, isa: Isa) -> f64 {
    let registry = Registry::default();
    let sample = Sample::draw(&registry, model, 4096, 0.3, 1).unwrap();
    let problem = sample.problem(&registry, family, &Execution::default()).unwrap().unwrap().with_direct_sums();
    let mut best = [f64::MAX; 2];
    let begun = Instant::now();
    while begun.elapsed() < Duration::from_millis(150) {
        for (set, best) in [isa, Isa::baseline()].iter().zip(&mut best) {
            let start = Instant::now();
            black_box(problem.evaluate_on(black_box(&sample.theta), *set));
            *best = best.min(start.elapsed().as_secs_f64());
        }
    }
    best[1] / best[0]
}

#[test]
fn lanes_are_faster_than_plain_numbers() {
    let isa = Isa::detect();
    let least = match isa.name() {
        "avx512" => 2.0,
        "avx2" => 1.3,
        name => {
            eprintln!("SKIPPED: `{name}` has no vectors, nothing to compare");
            return;
        }
    };
    for (model, family) in PAIRS {
        // A machine that stalls once must not fail the build: the best of three.
        let ratio = (0..3).map(|_| speedup(model, family, isa)).fold(0.0, f64::max);
        eprintln!("{model} x {family}: {ratio:.1} times as fast on {}", isa.name());
        assert!(
            ratio > least,
            "{model} x {family}: only {ratio:.2} times as fast on {} as on plain numbers",
            isa.name()
        );
    }
}
