//! Time, in the same run, one step of the cone program, of the null-space method and of the damped inner step.
//!
//! `cargo run --release -p cfpose-optim --example step_times`

use std::hint::black_box;
use std::time::Instant;

use cfpose_optim::linear::{Qr, null_space_step};
use cfpose_optim::solvers::{ConeProblem, ConeStep, Loss};
use rand_chacha::ChaCha12Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

const COLS: usize = 6;

/// Return the least time of a repetition in microseconds.
fn least_micros(mut action: impl FnMut()) -> f64 {
    let mut least = f64::INFINITY;
    for _ in 0..200 {
        let began = Instant::now();
        for _ in 0..20 {
            action();
        }
        least = least.min(began.elapsed().as_secs_f64() * 1e6 / 20.0);
    }
    least
}

fn main() {
    println!("| residuals x parameters | null-space step | cone program, region inactive | ratio | damped step |");
    println!("|---|---:|---:|---:|---:|");
    for rows in [18, 40, 120] {
        let mut rng = ChaCha12Rng::seed_from_u64(rows as u64);
        let mut normals = |n: usize| -> Vec<f64> { (0..n).map(|_| StandardNormal.sample(&mut rng)).collect() };
        let (residual, jacobian) = (normals(rows), normals(rows * COLS));
        let (constraint, value) = (normals(COLS), [0.01]);
        let column = |j: usize| (0..rows).map(|k| jacobian[k * COLS + j].powi(2)).sum::<f64>().sqrt();
        let scaling: Vec<f64> = (0..COLS).map(column).collect();
        let entry = |j: usize| (0..rows).map(|k| jacobian[k * COLS + j] * residual[k]).sum::<f64>();
        let gradient: Vec<f64> = (0..COLS).map(entry).collect();
        let problem = ConeProblem {
            rows,
            cols: COLS,
            residual: &residual,
            jacobian: &jacobian,
            gradient: &gradient,
            num_equalities: 1,
            values: &value,
            constraints: &constraint,
            scaling: &scaling,
        };
        let (mut exact, mut cones, mut damped) = ([0.0; COLS], [0.0; COLS], [0.0; COLS]);
        let null_space = least_micros(|| {
            null_space_step(rows, COLS, black_box(&jacobian), &residual, 1, &constraint, &value, &mut exact);
        });
        let mut step = ConeStep::new(Loss::Squares);
        let clarabel = least_micros(|| {
            step.solve(black_box(&problem), 1e3, &mut cones);
        });
        let mut qr = Qr::default();
        let inner = least_micros(|| {
            qr.factorise(rows, COLS, black_box(&jacobian), &residual);
            qr.solve_damped(1e-3, &scaling, &mut damped);
        });
        let difference = exact.iter().zip(&cones).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(difference < 1e-7, "the steps differ by {difference:e}");
        let ratio = clarabel / null_space;
        println!("| {rows} x {COLS} | {null_space:.2} us | {clarabel:.1} us | {ratio:.1} | {inner:.2} us |");
    }
}
