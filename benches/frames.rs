//! A stream of frames: an estimator built once and solved many times repeats none of the set-up.
//!
//! `cargo bench -p cfpose-benches --bench frames`. 100 frames of 300 points, `rigid3`, preset `auto`, each begun where the last one
//! ended. Three ways in one run: the estimator is built for every frame; it is built once and solved again; it is built once and
//! gets the next target. The last column is the time of a frame over that of the first way.
//!
//! Then rendered images: the sequences of `cfpose cells`, each frame from the pose before, on one thread, from decoded pixels to theta,
//! covariance and verdict; the first frame has no start.

use std::hint::black_box;
use std::sync::Arc;
use std::time::Instant;

use cfpose::{Estimator, Execution, Points, Registry, Settings, Supervision};
use cfpose_lab::rendered::{RenderedSequence, SEQUENCES, draw_sequence, prepare_sequence};
use cfpose_vision::{SegmentOptions, Transfer};

const FRAMES: usize = 100;

/// A bent sheet of 300 points.
fn sheet() -> Vec<[f64; 3]> {
    let point = |k: u32| {
        let (u, v) = ((f64::from(k) * 0.618_034).fract(), f64::from(k) / 300.0);
        [2.0 * u, v * (1.0 + 0.5 * u), 0.6 * u * u + 0.3 * (3.0 * v).sin() * u]
    };
    (0..300).map(point).collect()
}

/// The sheet turned about z by an angle and shifted, points in another order.
fn frame(rows: &[[f64; 3]], angle: f64) -> Points {
    let (sin, cos) = angle.sin_cos();
    let moved: Vec<[f64; 3]> =
        rows.iter().rev().map(|p| [cos * p[0] - sin * p[1] + angle, sin * p[0] + cos * p[1], p[2]]).collect();
    Points::from_rows(&moved).expect("finite points")
}

/// Follow a rendered sequence several times; print the time of the first frame and of the others.
fn images(sequence: &RenderedSequence) -> Option<()> {
    const ROUNDS: usize = 5;
    let drawn = draw_sequence(sequence, 1)?;
    let (registrar, pattern) = prepare_sequence(sequence, &drawn)?;
    let look = SegmentOptions::default();
    let (mut first, mut others, mut followed) = (0.0, 0.0, 0usize);
    for _ in 0..ROUNDS {
        let mut last: Option<Vec<f64>> = None;
        for (picture, _) in &drawn.frames {
            let begun = Instant::now();
            let light = Arc::new(picture.light(Transfer::Linear));
            let found = registrar.follow(&pattern, light, &look, drawn.camera, last.as_deref(), 1).ok()?;
            let seconds = begun.elapsed().as_secs_f64();
            *if last.is_some() { &mut others } else { &mut first } += seconds;
            followed += usize::from(found.by == "followed");
            last = Some(black_box(found).theta);
        }
    }
    let count = ROUNDS * (drawn.frames.len() - 1);
    let mean = others / count as f64;
    let name = sequence.name;
    let share = 100.0 * followed as f64 / count as f64;
    println!("| {name} | {:.1} | {:.2} | {:.0} | {share:.0} |", 1e3 * first / ROUNDS as f64, 1e3 * mean, 1.0 / mean);
    Some(())
}

fn main() -> Result<(), cfpose::Error> {
    points()?;
    println!("\n| images | first ms | ms a frame | frames a second | followed % |\n|---|---|---|---|---|");
    SEQUENCES.iter().for_each(|sequence| images(sequence).expect("the pattern is seen in all frames"));
    Ok(())
}

fn points() -> Result<(), cfpose::Error> {
    let (registry, execution, rows) = (Registry::default(), Execution::default(), sheet());
    let source = Points::from_rows(&rows).expect("finite points");
    let still = frame(&rows, 0.1);
    let settings = Settings::preset("auto", "rigid3")?;
    let start = registry.model("rigid3", &Default::default())?.identity;
    let from = settings.clone().start_at(start.clone());

    let begun = Instant::now();
    for _ in 0..FRAMES {
        let estimator = Estimator::new(&registry, &from, &source, &still, &execution)?;
        black_box(estimator.solve(Supervision::default())?);
    }
    let every = begun.elapsed().as_secs_f64() / FRAMES as f64;

    let estimator = Estimator::new(&registry, &from, &source, &still, &execution)?;
    let begun = Instant::now();
    for _ in 0..FRAMES {
        black_box(estimator.solve_from(std::slice::from_ref(&start), Supervision::default())?);
    }
    let again = begun.elapsed().as_secs_f64() / FRAMES as f64;

    let begun = Instant::now();
    for _ in 0..FRAMES {
        black_box(Estimator::new(&registry, &from, &source, &still, &execution)?);
    }
    let setup = begun.elapsed().as_secs_f64() / FRAMES as f64;

    let (mut theta, begun) = (start.clone(), Instant::now());
    for k in 0..FRAMES {
        let target = frame(&rows, 0.1 + 1e-2 * k as f64);
        theta = estimator.with_target(&target)?.solve_from(&[theta], Supervision::default())?.theta;
    }
    let stream = begun.elapsed().as_secs_f64() / FRAMES as f64;

    println!("| way | ms a frame | ratio |\n|---|---|---|");
    for (name, seconds) in [
        ("built for every frame", every),
        ("built once, solved again", again),
        ("the set-up alone", setup),
        ("built once, next target, from the last pose", stream),
    ] {
        println!("| {name} | {:.3} | {:.2} |", 1e3 * seconds, seconds / every);
    }
    // What is left when the set-up is taken off is the solve: none of the set-up is repeated.
    println!("solve again + set-up over built for every frame: {:.2}", (again + setup) / every);
    Ok(())
}
