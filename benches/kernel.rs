//! The evaluation kernel: nanoseconds per point for value and Jacobian of every (model, family) pair, and ratios of one run.
//!
//! ```text
//! cargo bench -p cfpose-benches --bench kernel             # ratios, then the table of all pairs (long)
//! cargo bench -p cfpose-benches --bench kernel -- ratios   # ratios only
//! cargo bench -p cfpose-benches --bench kernel -- lanes    # fails where lanes are not faster than plain numbers
//! cargo bench -p cfpose-benches --bench kernel -- rigid3   # pairs whose name contains the word
//! ```
//!
//! `-- peers` prints one JSON line for `benches/peers/bearing3_trig18.py`.

use std::hint::black_box;
use std::time::{Duration, Instant};

use cfpose::check::Sample;
use cfpose::problem::MomentProblem;
use cfpose::{Estimator, Execution, Isa, Points, Registry, Settings, Start, Supervision};
use cfpose_optim::problem::LeastSquares;

#[path = "../examples/07_custom_family.rs"]
#[allow(dead_code)]
mod custom_family;
#[path = "../examples/06_custom_model.rs"]
#[allow(dead_code)]
mod custom_model;
#[path = "kernel/hand.rs"]
mod hand;
#[path = "kernel/lanes.rs"]
mod lanes;
#[path = "kernel/scalar.rs"]
mod scalar;

use hand::{Hand, HandSums};

type Failure = Box<dyn std::error::Error>;

/// Return the shortest time of each of several works, in seconds, measured in turns so that all see the same machine.
fn fastest(works: &mut [&mut dyn FnMut()], budget: Duration) -> Vec<f64> {
    let mut best = vec![f64::MAX; works.len()];
    let begun = Instant::now();
    let mut rounds = 0;
    while rounds < 3 || begun.elapsed() < budget {
        for (work, best) in works.iter_mut().zip(&mut best) {
            // Long enough for the clock: at least 20 microseconds.
            let (start, mut runs) = (Instant::now(), 0_u32);
            while runs == 0 || start.elapsed() < Duration::from_micros(20) {
                work();
                runs += 1;
            }
            *best = best.min(start.elapsed().as_secs_f64() / f64::from(runs));
        }
        rounds += 1;
    }
    best
}

/// Return seconds per evaluation of the same problem on each instruction set.
fn on_each_set(problem: &MomentProblem, theta: &[f64], sets: &[Isa], budget: Duration) -> Vec<f64> {
    let mut works: Vec<Box<dyn FnMut() + '_>> = Vec::new();
    for isa in sets {
        works.push(Box::new(move || {
            black_box(problem.evaluate_on(black_box(theta), *isa));
        }));
    }
    let mut borrowed: Vec<&mut dyn FnMut()> = works.iter_mut().map(|work| work.as_mut() as &mut dyn FnMut()).collect();
    fastest(&mut borrowed, budget)
}

fn main() -> Result<(), Failure> {
    let filter = std::env::args().skip(1).find(|a| !a.starts_with("--")).unwrap_or_default();
    match filter.as_str() {
        "peers" => return peers(),
        "ratios" => return ratios(),
        "lanes" => return lanes::lanes_are_faster_than_plain_numbers(),
        "" => ratios()?,
        _ => {}
    }
    pairs(&filter);
    Ok(())
}

fn ratios() -> Result<(), Failure> {
    against_scalar_and_hand()?;
    own_entries()?;
    moments()?;
    thousand_starts()?;
    linear_time()
}

/// Print nanoseconds per point of all pairs whose name contains `filter`.
fn pairs(filter: &str) {
    let registry = Registry::default();
    let sets = Isa::available();
    let names: String = sets.iter().map(|isa| format!(" {:>9}", isa.name())).collect();
    println!("\nns per point, value and Jacobian\n{:<32} {:>8}{names}", "model x family", "N");
    for model in &registry.models {
        for family in &registry.families {
            let pair = format!("{} x {}", model.name, family.name);
            for count in [1000, 3142, 100_000, 1_000_000] {
                if !pair.contains(filter) {
                    continue;
                }
                let Ok(sample) = Sample::draw(&registry, model.name, count, 0.3, 1) else { continue };
                let Ok(Some(problem)) = sample.problem(&registry, family.name, &Execution::default()) else { continue };
                let times = on_each_set(&problem, &sample.theta, &sets, Duration::from_millis(60));
                let cells: String = times.iter().map(|t| format!(" {:>9.2}", t * 1e9 / count as f64)).collect();
                let note = if problem.uses_moments() { "  from moments" } else { "" };
                println!("{pair:<32} {count:>8}{cells}{note}");
            }
        }
    }
}

/// Make the hand-written form of a sample of `bearing3`.
fn by_hand<'a>(sample: &'a Sample) -> Result<Hand<'a>, Failure> {
    let transform = sample.transform;
    Ok(Hand {
        columns: [0, 1, 2].map(|d| sample.source.column(d)),
        rotation: sample.theta[..9].try_into()?,
        translation: sample.theta[9..].try_into()?,
        mean: transform.mean(),
        scale: [0, 1, 2].map(|q| transform.matrix()[q][q]),
    })
}

/// Return the largest deviation of C times sums / N from a Jacobian.
fn deviation(problem: &MomentProblem, sums: &HandSums, count: usize, jacobian: &[f64]) -> f64 {
    let c = problem.family().coefficients(3).unwrap_or_default();
    let mut worst = 0.0_f64;
    for i in 0..18 {
        for j in 0..6 {
            let entry: f64 = (0..18).map(|k| c[i * 18 + k] * sums.jacobian[k][j] / count as f64).sum();
            worst = worst.max((entry - jacobian[i * 6 + j]).abs());
        }
    }
    worst
}

/// The chain rule with num-dual on plain numbers, the same kernel by hand, and the library.
fn against_scalar_and_hand() -> Result<(), Failure> {
    let registry = Registry::default();
    println!("bearing3 x trig18, one thread, ns per point");
    println!(
        "{:>8} {:>9} {:>8} {:>8} {:>8} {:>13} {:>14}",
        "N", "set", "scalar", "hand", "library", "scalar/library", "library/hand"
    );
    for count in [3142, 100_000] {
        let sample = Sample::draw(&registry, "bearing3", count, 0.3, 1)?;
        for isa in Isa::available() {
            let execution = Execution { isa, pool: None };
            let problem = sample.problem(&registry, "trig18", &execution)?.ok_or("no such pair")?;
            let exact = problem.evaluate(&sample.theta).jacobian;
            let case = by_hand(&sample)?;
            for sums in [isa.run(case), scalar::scalar_chain_rule(&case)] {
                let worst = deviation(&problem, &sums, count, &exact);
                assert!(worst < 1e-11, "the references compute something else: {worst:e}");
            }
            let times = fastest(
                &mut [
                    &mut || {
                        black_box(scalar::scalar_chain_rule(black_box(&case)));
                    },
                    &mut || {
                        black_box(isa.run(black_box(case)));
                    },
                    &mut || {
                        black_box(problem.evaluate(black_box(&sample.theta)));
                    },
                ],
                Duration::from_millis(1500),
            );
            let ns = |index: usize| times[index] * 1e9 / count as f64;
            println!(
                "{count:>8} {:>9} {:>8.1} {:>8.1} {:>8.1} {:>13.1} {:>14.2}",
                isa.name(),
                ns(0),
                ns(1),
                ns(2),
                ns(0) / ns(2),
                ns(2) / ns(1)
            );
        }
    }
    Ok(())
}

/// The model and the family of examples 06 and 07, written without a thought of lanes.
fn own_entries() -> Result<(), Failure> {
    let mut registry = Registry::default();
    registry.models.push(&custom_model::SHEAR);
    registry.families.push(&custom_family::BUMPS);
    println!("\nentries of examples 06 and 07, N = 100000: ratio of the scalar path to lanes");
    let sets = Isa::available();
    for (model, family) in [("shear2", "trig18"), ("bearing3", "bumps"), ("shear2", "bumps")] {
        let sample = Sample::draw(&registry, model, 100_000, 0.3, 1)?;
        let problem = sample.problem(&registry, family, &Execution::default())?.ok_or("no such pair")?;
        let times = on_each_set(&problem, &sample.theta, &sets, Duration::from_millis(1000));
        let scalar = times[times.len() - 1];
        let cells: Vec<String> =
            sets.iter().zip(&times).map(|(isa, time)| format!("{} {:.1}", isa.name(), scalar / time)).collect();
        println!("{model} x {family}: {}", cells.join(", "));
    }
    Ok(())
}

/// Residual and Jacobian from moments: no dependence on N.
fn moments() -> Result<(), Failure> {
    let registry = Registry::default();
    println!("\nrigid3 from moments, microseconds per evaluation (residual and Jacobian)");
    for family in ["hermite[degree=3]", "hermite[degree=4]", "hermite[degree=6]"] {
        let mut line = format!("{family:<20}");
        for count in [1000, 3142, 100_000, 1_000_000] {
            let sample = Sample::draw(&registry, "rigid3", count, 0.3, 1)?;
            let problem = sample.problem(&registry, family, &Execution::default())?.ok_or("no such pair")?;
            assert!(problem.uses_moments());
            // As solvers call it: the bare residual and Jacobian.
            let (rows, columns) = (problem.num_residuals(), problem.manifold().tangent());
            let (mut residual, mut jacobian) = (vec![0.0; rows], vec![0.0; rows * columns]);
            let mut work = || problem.jacobian(black_box(&sample.theta), &mut residual, &mut jacobian);
            let times = fastest(&mut [&mut work], Duration::from_millis(300));
            line += &format!("  N={count}: {:.2}", times[0] * 1e6);
        }
        println!("{line}");
    }
    Ok(())
}

/// A bent strip with a bump, in golden-ratio order.
fn strip(count: usize) -> Vec<[f64; 3]> {
    let point = |k: usize| {
        let (u, v) = (k as f64 / count as f64, (k as f64 * 0.618_033_988_749_895).fract());
        [2.0 * u, v * (1.0 + 0.5 * u), 0.6 * u * u + 0.3 * (3.0 * v).sin() * u]
    };
    (0..count).map(point).collect()
}

/// A thousand whole solves on a million points.
fn thousand_starts() -> Result<(), Failure> {
    let registry = Registry::default();
    let source = strip(1_000_000);
    // A turn of half a radian about z and a shift.
    let (sin, cos) = 0.5_f64.sin_cos();
    let moved = |p: &[f64; 3]| [cos * p[0] - sin * p[1] + 5.0, sin * p[0] + cos * p[1] - 3.0, p[2] + 1.0];
    let target: Vec<[f64; 3]> = source.iter().rev().map(moved).collect();
    let settings = Settings {
        features: Some("hermite[degree=4]".into()),
        start: Some(Start::Named("grid[count=1000,keep=1000]".into())),
        ..Settings::preset("paper", "rigid3")?
    };
    let (source, target) = (Points::from_rows(&source)?, Points::from_rows(&target)?);
    let begun = Instant::now();
    let estimator = Estimator::new(&registry, &settings, &source, &target, &Execution::default())?;
    let pass = begun.elapsed();
    let begun = Instant::now();
    let estimate = estimator.solve(Supervision::default())?;
    println!(
        "\nrigid3 x hermite[degree=4], a million points: {} starts, {} evaluations in {:.3} s after one pass of {:.3} s",
        estimate.starts,
        estimate.evaluations,
        begun.elapsed().as_secs_f64(),
        pass.as_secs_f64()
    );
    Ok(())
}

/// Nanoseconds per point from ten thousand to ten million points.
fn linear_time() -> Result<(), Failure> {
    let registry = Registry::default();
    println!("\nbearing3 x trig18, ns per point as N grows");
    let mut all = Vec::new();
    for count in [10_000, 100_000, 1_000_000, 10_000_000] {
        let mut sample = Sample::draw(&registry, "bearing3", 1000, 0.3, 1)?;
        sample.source = Points::from_rows(&strip(count))?;
        let problem = sample.problem(&registry, "trig18", &Execution::default())?.ok_or("no such pair")?;
        let times = on_each_set(&problem, &sample.theta, &[Isa::detect()], Duration::from_millis(1500));
        all.push(times[0] * 1e9 / count as f64);
        println!("{count:>9} {:>6.2}", all[all.len() - 1]);
    }
    let (low, high) = all.iter().fold((f64::MAX, 0.0_f64), |(low, high), ns| (low.min(*ns), high.max(*ns)));
    println!("largest over smallest: {:.2}", high / low);
    Ok(())
}

/// Print what the Python script needs: times, the exact Jacobian and the case.
fn peers() -> Result<(), Failure> {
    let registry = Registry::default();
    for count in [3142, 100_000] {
        let mut sample = Sample::draw(&registry, "bearing3", 1000, 0.3, 1)?;
        sample.source = Points::from_rows(&strip(count))?;
        let problem = sample.problem(&registry, "trig18", &Execution::default())?.ok_or("no such pair")?;
        let sets = Isa::available();
        let times = on_each_set(&problem, &sample.theta, &sets, Duration::from_millis(2000));
        let cells: Vec<String> =
            sets.iter().zip(&times).map(|(isa, t)| format!("{:?}: {:e}", isa.name(), t * 1e9 / count as f64)).collect();
        println!(
            "{{\"count\": {count}, \"ns_per_point\": {{{}}}, \"theta\": {:?}, \"mean\": {:?}, \"matrix\": {:?}, \"coefficients\": {:?}, \"jacobian\": {:?}}}",
            cells.join(", "),
            sample.theta,
            sample.transform.mean(),
            sample.transform.matrix(),
            problem.family().coefficients(3).unwrap_or_default(),
            problem.evaluate(&sample.theta).jacobian,
        );
    }
    Ok(())
}
