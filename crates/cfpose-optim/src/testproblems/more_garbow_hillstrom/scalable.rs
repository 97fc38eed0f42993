//! Problems 20 to 35, of variable size.

use num_dual::DualNum;

use super::{Reference, reference};

/// Return the problems at usual sizes.
pub(super) fn all() -> Vec<Reference> {
    let tiled = |pattern: &[f64], n: usize| (0..n).map(|j| pattern[j % pattern.len()]).collect::<Vec<_>>();
    let ramp = |n: usize| (1..=n).map(|j| j as f64 / n as f64).collect::<Vec<_>>();
    let boundary = |n: usize| {
        let at = |j: usize| (j as f64 / (n as f64 + 1.0)) * (j as f64 / (n as f64 + 1.0) - 1.0);
        (1..=n).map(at).collect::<Vec<_>>()
    };
    let (m, full) = (20.0, vec![1.0; 10]);
    vec![
        reference(20, "Watson, n = 6", 31, vec![0.0; 6], &[2.287670053e-3]),
        reference(20, "Watson, n = 9", 31, vec![0.0; 9], &[1.399760138e-6]),
        reference(21, "Extended Rosenbrock", 10, tiled(&[-1.2, 1.0], 10), &[0.0]),
        reference(22, "Extended Powell singular", 12, tiled(&[3.0, -1.0, 0.0, 1.0], 12), &[0.0]),
        reference(23, "Penalty I, n = 4", 5, vec![1.0, 2.0, 3.0, 4.0], &[2.24997e-5]),
        reference(23, "Penalty I, n = 10", 11, (1..=10).map(f64::from).collect(), &[7.08765e-5]),
        reference(24, "Penalty II, n = 4", 8, vec![0.5; 4], &[9.37629e-6]),
        reference(24, "Penalty II, n = 10", 20, vec![0.5; 10], &[2.93660e-4]),
        reference(25, "Variably dimensioned", 12, ramp(10).iter().map(|v| 1.0 - v).collect(), &[0.0]),
        reference(26, "Trigonometric", 10, vec![0.1; 10], &[0.0, 2.79506e-5]),
        reference(27, "Brown almost-linear", 10, vec![0.5; 10], &[0.0, 1.0]),
        reference(28, "Discrete boundary value", 10, boundary(10), &[0.0]),
        reference(29, "Discrete integral equation", 10, boundary(10), &[0.0]),
        reference(30, "Broyden tridiagonal", 10, vec![-1.0; 10], &[0.0]),
        reference(31, "Broyden banded", 10, vec![-1.0; 10], &[0.0]),
        reference(32, "Linear, full rank", 20, full.clone(), &[m - 10.0]),
        reference(33, "Linear, rank 1", 20, full.clone(), &[m * (m - 1.0) / (2.0 * (2.0 * m + 1.0))]),
        reference(
            34,
            "Linear, rank 1 with zero columns and rows",
            20,
            full,
            &[(m * m + 3.0 * m - 6.0) / (2.0 * (2.0 * m - 3.0))],
        ),
        reference(35, "Chebyquad, n = 7", 7, chebyquad_start(7), &[0.0]),
        reference(35, "Chebyquad, n = 8", 8, chebyquad_start(8), &[3.51687e-3]),
        reference(35, "Chebyquad, n = 9", 9, chebyquad_start(9), &[0.0]),
        reference(35, "Chebyquad, n = 10", 10, chebyquad_start(10), &[4.77271e-3, 6.50395e-3]),
    ]
}

fn chebyquad_start(n: usize) -> Vec<f64> {
    (1..=n).map(|j| j as f64 / (n as f64 + 1.0)).collect()
}

/// Write the residual of a problem.
pub(super) fn values<T: DualNum<Primitive = f64> + Copy>(number: usize, x: &[T], r: &mut [T]) {
    let n = x.len();
    match number {
        20 => watson(x, r),
        21 => {
            for i in 0..n / 2 {
                r[2 * i] = (x[2 * i + 1] - x[2 * i] * x[2 * i]) * 10.0;
                r[2 * i + 1] = -x[2 * i] + 1.0;
            }
        }
        22 => {
            for (x, r) in x.chunks_exact(4).zip(r.chunks_exact_mut(4)) {
                super::fixed::values(13, x, r);
            }
        }
        23 => {
            for i in 0..n {
                r[i] = (x[i] - 1.0) * 1e-5_f64.sqrt();
            }
            r[n] = sum_of_squares(x) - 0.25;
        }
        24 => penalty2(x, r),
        25 => {
            let weighted: T = weighted_sum(n, |j| x[j] - 1.0);
            for i in 0..n {
                r[i] = x[i] - 1.0;
            }
            r[n] = weighted;
            r[n + 1] = weighted * weighted;
        }
        26 => {
            let cosines = x.iter().fold(T::from(0.0), |sum, v| sum + v.cos());
            for i in 0..n {
                r[i] = -cosines + (-x[i].cos() + 1.0) * (i as f64 + 1.0) - x[i].sin() + n as f64;
            }
        }
        27 => {
            let sum = x.iter().fold(T::from(0.0), |sum, v| sum + *v);
            for i in 0..n - 1 {
                r[i] = x[i] + sum - (n as f64 + 1.0);
            }
            r[n - 1] = x.iter().fold(T::from(1.0), |product, v| product * *v) - 1.0;
        }
        28 => boundary_value(x, r),
        29 => integral_equation(x, r),
        30 => {
            for i in 0..n {
                let (before, after) = neighbours(x, i);
                r[i] = (-x[i] * 2.0 + 3.0) * x[i] - before - after * 2.0 + 1.0;
            }
        }
        31 => {
            for i in 0..n {
                let band = (i.saturating_sub(5)..=(i + 1).min(n - 1)).filter(|j| *j != i);
                let sum = band.fold(T::from(0.0), |sum, j| sum + x[j] * (x[j] + 1.0));
                r[i] = x[i] * (x[i] * x[i] * 5.0 + 2.0) + 1.0 - sum;
            }
        }
        32 => {
            let sum = x.iter().fold(T::from(0.0), |sum, v| sum + *v);
            let m = r.len() as f64;
            for (i, value) in r.iter_mut().enumerate() {
                let own = if i < n { x[i] } else { T::from(0.0) };
                *value = own - sum * (2.0 / m) - 1.0;
            }
        }
        33 => {
            let sum: T = weighted_sum(n, |j| x[j]);
            for (i, value) in r.iter_mut().enumerate() {
                *value = sum * (i as f64 + 1.0) - 1.0;
            }
        }
        34 => {
            let sum = (1..n - 1).fold(T::from(0.0), |sum, j| sum + x[j] * (j as f64 + 1.0));
            let last = r.len() - 1;
            for (i, value) in r.iter_mut().enumerate() {
                *value = sum * (if i == 0 || i == last { 0.0 } else { i as f64 }) - 1.0;
            }
        }
        _ => chebyquad(x, r),
    }
}

fn weighted_sum<T: DualNum<Primitive = f64> + Copy>(n: usize, value: impl Fn(usize) -> T) -> T {
    (0..n).fold(T::from(0.0), |sum, j| sum + value(j) * (j as f64 + 1.0))
}

fn sum_of_squares<T: DualNum<Primitive = f64> + Copy>(x: &[T]) -> T {
    x.iter().fold(T::from(0.0), |sum, v| sum + *v * *v)
}

/// Return x_{i-1} and x_{i+1}, 0 beyond the ends.
fn neighbours<T: DualNum<Primitive = f64> + Copy>(x: &[T], i: usize) -> (T, T) {
    let zero = T::from(0.0);
    (if i > 0 { x[i - 1] } else { zero }, x.get(i + 1).copied().unwrap_or(zero))
}

fn watson<T: DualNum<Primitive = f64> + Copy>(x: &[T], r: &mut [T]) {
    for i in 0..29 {
        let t = (i as f64 + 1.0) / 29.0;
        let (mut derivative, mut value) = (T::from(0.0), T::from(0.0));
        for j in (0..x.len()).rev() {
            value = value * t + x[j];
            if j > 0 {
                derivative = derivative * t + x[j] * j as f64;
            }
        }
        r[i] = derivative - value * value - 1.0;
    }
    r[29] = x[0];
    r[30] = x[1] - x[0] * x[0] - 1.0;
}

fn penalty2<T: DualNum<Primitive = f64> + Copy>(x: &[T], r: &mut [T]) {
    let n = x.len();
    let weight = 1e-5_f64.sqrt();
    r[0] = x[0] - 0.2;
    for i in 1..n {
        let y = ((i as f64 + 1.0) / 10.0).exp() + (i as f64 / 10.0).exp();
        r[i] = ((x[i] / 10.0).exp() + (x[i - 1] / 10.0).exp() - y) * weight;
    }
    for i in n..2 * n - 1 {
        r[i] = ((x[i - n + 1] / 10.0).exp() - (-0.1_f64).exp()) * weight;
    }
    r[2 * n - 1] = (0..n).fold(T::from(0.0), |sum, j| sum + x[j] * x[j] * (n - j) as f64) - 1.0;
}

fn boundary_value<T: DualNum<Primitive = f64> + Copy>(x: &[T], r: &mut [T]) {
    let h = 1.0 / (x.len() as f64 + 1.0);
    for i in 0..x.len() {
        let (before, after) = neighbours(x, i);
        let t = (i as f64 + 1.0) * h;
        r[i] = x[i] * 2.0 - before - after + (x[i] + t + 1.0).powi(3) * (0.5 * h * h);
    }
}

fn integral_equation<T: DualNum<Primitive = f64> + Copy>(x: &[T], r: &mut [T]) {
    let h = 1.0 / (x.len() as f64 + 1.0);
    let t = |j: usize| (j as f64 + 1.0) * h;
    for i in 0..x.len() {
        let term = |j: usize| (x[j] + t(j) + 1.0).powi(3);
        let before = (0..=i).fold(T::from(0.0), |sum, j| sum + term(j) * t(j));
        let after = (i + 1..x.len()).fold(T::from(0.0), |sum, j| sum + term(j) * (1.0 - t(j)));
        r[i] = x[i] + (before * (1.0 - t(i)) + after * t(i)) * (0.5 * h);
    }
}

/// Means of the shifted Chebyshev polynomials minus their integrals over 0 to 1.
fn chebyquad<T: DualNum<Primitive = f64> + Copy>(x: &[T], r: &mut [T]) {
    let n = x.len() as f64;
    r.fill(T::from(0.0));
    for v in x {
        let argument = *v * 2.0 - 1.0;
        let (mut before, mut current) = (T::from(1.0), argument);
        for value in r.iter_mut() {
            *value += current;
            (before, current) = (current, argument * current * 2.0 - before);
        }
    }
    for (i, value) in r.iter_mut().enumerate() {
        let degree = i as f64 + 1.0;
        let integral = if i % 2 == 1 { -1.0 / (degree * degree - 1.0) } else { 0.0 };
        *value = *value / n - integral;
    }
}
