//! The evaluation kernel: nanoseconds per point for value and Jacobian of every (model, family) pair.
//!
//! `cargo bench -p cfpose-benches --bench kernel`; a first argument filters pairs by name.
use std::hint::black_box;
use std::time::Instant;

use cfpose::check::Sample;
use cfpose::{Execution, Isa, Registry};

/// Median nanoseconds of one call over at least 0.1 s.
fn time(mut work: impl FnMut()) -> f64 {
    work();
    let start = Instant::now();
    work();
    let once = start.elapsed().as_secs_f64();
    let batch = (2e-3 / once.max(1e-9)).ceil().max(1.0) as usize;
    let mut samples: Vec<f64> = (0..31)
        .map(|_| {
            let start = Instant::now();
            for _ in 0..batch {
                work();
            }
            start.elapsed().as_secs_f64() / batch as f64
        })
        .collect();
    samples.sort_by(f64::total_cmp);
    samples[samples.len() / 2] * 1e9
}

fn main() {
    let filter = std::env::args().skip(1).find(|a| !a.starts_with("--")).unwrap_or_default();
    let registry = Registry::default();
    println!("{:<32} {:>8} {:>9} {:>9} {:>9}", "model x family", "N", "avx512", "avx2", "baseline");
    for model in &registry.models {
        for family in &registry.families {
            let pair = format!("{} x {}", model.name, family.name);
            if !pair.contains(&filter) {
                continue;
            }
            for count in [3142, 100_000] {
                let Ok(sample) = Sample::draw(&registry, model.name, count, 0.3, 1) else { continue };
                let mut line = format!("{pair:<32} {count:>8}");
                for name in ["avx512", "avx2", "baseline"] {
                    let Some(isa) = Isa::by_name(name) else { continue };
                    let execution = Execution { isa, pool: None };
                    let Ok(Some(problem)) = sample.problem(&registry, family.name, &execution) else { continue };
                    let ns = time(|| {
                        black_box(problem.evaluate(black_box(&sample.theta)));
                    });
                    line += &format!(" {:>9.2}", ns / count as f64);
                }
                println!("{line}");
            }
        }
    }
}
