//! The inlining cliff: lanes must be faster than plain numbers, as a ratio within one run.
//!
//! Per-point code that is not inlined falls out of the instruction set and becomes slower than plain numbers. Healthy pairs are 4
//! to 8 times faster with AVX-512 and 3 to 4 times with AVX2; the bounds leave room for a busy machine.

use std::time::Duration;

use cfpose::check::Sample;
use cfpose::{Execution, Isa, Registry};

use crate::{Failure, on_each_set};

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
fn speedup(model: &str, family: &str, isa: Isa) -> Result<f64, Failure> {
    let registry = Registry::default();
    let sample = Sample::draw(&registry, model, 4096, 0.3, 1)?;
    let problem = sample.problem(&registry, family, &Execution::default())?.ok_or("no such pair")?.with_direct_sums();
    let times = on_each_set(&problem, &sample.theta, &[isa, Isa::baseline()], Duration::from_millis(150));
    Ok(times[1] / times[0])
}

/// Compare all pairs and fail where one is below the bound of its instruction set.
pub fn lanes_are_faster_than_plain_numbers() -> Result<(), Failure> {
    let isa = Isa::detect();
    let least = match isa.name() {
        "avx512" => 2.0,
        "avx2" => 1.3,
        name => return Err(format!("`{name}` has no vectors, nothing to compare").into()),
    };
    let mut slow = Vec::new();
    for (model, family) in PAIRS {
        // A machine that stalls once must not fail the comparison: the best of three.
        let mut ratio = 0.0_f64;
        for _ in 0..3 {
            ratio = ratio.max(speedup(model, family, isa)?);
        }
        println!("{model} x {family}: {ratio:.1} times as fast on {} (bound {least})", isa.name());
        // A ratio that is no number fails too.
        if ratio.is_nan() || ratio <= least {
            slow.push(format!(
                "{model} x {family}: only {ratio:.2} times as fast on {} as on plain numbers",
                isa.name()
            ));
        }
    }
    if slow.is_empty() { Ok(()) } else { Err(slow.join("; ").into()) }
}
