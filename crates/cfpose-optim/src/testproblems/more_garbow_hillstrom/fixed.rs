//! Problems 1 to 19.

use std::f64::consts::PI;

use num_dual::DualNum;

use super::data;

/// Write the residual of a problem.
pub(super) fn values<T: DualNum<Primitive = f64> + Copy>(number: usize, x: &[T], r: &mut [T]) {
    match number {
        1 => {
            r[0] = (x[1] - x[0] * x[0]) * 10.0;
            r[1] = -x[0] + 1.0;
        }
        2 => {
            r[0] = x[0] + ((-x[1] + 5.0) * x[1] - 2.0) * x[1] - 13.0;
            r[1] = x[0] + ((x[1] + 1.0) * x[1] - 14.0) * x[1] - 29.0;
        }
        3 => {
            r[0] = x[0] * x[1] * 1e4 - 1.0;
            r[1] = (-x[0]).exp() + (-x[1]).exp() - 1.0001;
        }
        4 => {
            r[0] = x[0] - 1e6;
            r[1] = x[1] - 2e-6;
            r[2] = x[0] * x[1] - 2.0;
        }
        5 => {
            for (i, y) in [1.5, 2.25, 2.625].into_iter().enumerate() {
                r[i] = -x[0] * (-x[1].powi(i as i32 + 1) + 1.0) + y;
            }
        }
        6 => {
            for (i, value) in r.iter_mut().enumerate() {
                let t = i as f64 + 1.0;
                *value = -((x[0] * t).exp() + (x[1] * t).exp()) + (2.0 + 2.0 * t);
            }
        }
        7 => {
            let shift = if x[0].re() > 0.0 { 0.0 } else { 0.5 };
            let angle = (x[1] / x[0]).atan() / (2.0 * PI) + shift;
            r[0] = (x[2] - angle * 10.0) * 10.0;
            r[1] = ((x[0] * x[0] + x[1] * x[1]).sqrt() - 1.0) * 10.0;
            r[2] = x[2];
        }
        8 => {
            for (i, y) in data::BARD.iter().enumerate() {
                let (u, v) = (i as f64 + 1.0, 15.0 - i as f64);
                r[i] = -(x[0] + (x[1] * v + x[2] * u.min(v)).recip() * u) + *y;
            }
        }
        9 => {
            for (i, y) in data::GAUSSIAN.iter().enumerate() {
                let t = -x[2] + (7.0 - i as f64) / 2.0;
                r[i] = x[0] * (-x[1] * t * t * 0.5).exp() - *y;
            }
        }
        10 => {
            for (i, y) in data::MEYER.iter().enumerate() {
                r[i] = x[0] * (x[1] / (x[2] + (50.0 + 5.0 * i as f64))).exp() - *y;
            }
        }
        11 => gulf(x, r),
        12 => {
            for (i, value) in r.iter_mut().enumerate() {
                let t = 0.1 * (i as f64 + 1.0);
                *value = (-x[0] * t).exp() - (-x[1] * t).exp() - x[2] * ((-t).exp() - (-10.0 * t).exp());
            }
        }
        13 => {
            r[0] = x[0] + x[1] * 10.0;
            r[1] = (x[2] - x[3]) * 5.0_f64.sqrt();
            r[2] = (x[1] - x[2] * 2.0).powi(2);
            r[3] = (x[0] - x[3]).powi(2) * 10.0_f64.sqrt();
        }
        14 => {
            r[0] = (x[1] - x[0] * x[0]) * 10.0;
            r[1] = -x[0] + 1.0;
            r[2] = (x[3] - x[2] * x[2]) * 90.0_f64.sqrt();
            r[3] = -x[2] + 1.0;
            r[4] = (x[1] + x[3] - 2.0) * 10.0_f64.sqrt();
            r[5] = (x[1] - x[3]) / 10.0_f64.sqrt();
        }
        15 => {
            for (i, (y, u)) in data::KOWALIK.iter().enumerate() {
                r[i] = -x[0] * (x[1] * *u + u * u) / (x[2] * *u + x[3] + u * u) + *y;
            }
        }
        16 => {
            for (i, value) in r.iter_mut().enumerate() {
                let t = (i as f64 + 1.0) / 5.0;
                *value = (x[0] + x[1] * t - t.exp()).powi(2) + (x[2] + x[3] * t.sin() - t.cos()).powi(2);
            }
        }
        17 => {
            for (i, y) in data::OSBORNE1.iter().enumerate() {
                let t = 10.0 * i as f64;
                r[i] = -(x[0] + x[1] * (-x[3] * t).exp() + x[2] * (-x[4] * t).exp()) + *y;
            }
        }
        18 => {
            for (i, value) in r.iter_mut().enumerate() {
                let t = 0.1 * (i as f64 + 1.0);
                let y = (-t).exp() - 5.0 * (-10.0 * t).exp() + 3.0 * (-4.0 * t).exp();
                *value = x[2] * (-x[0] * t).exp() - x[3] * (-x[1] * t).exp() + x[5] * (-x[4] * t).exp() - y;
            }
        }
        _ => {
            for (i, y) in data::OSBORNE2.iter().enumerate() {
                let t = 0.1 * i as f64;
                let bell = |height: T, width: T, at: T| height * (-(-at + t).powi(2) * width).exp();
                let sum = x[0] * (-x[4] * t).exp()
                    + bell(x[1], x[5], x[8])
                    + bell(x[2], x[6], x[9])
                    + bell(x[3], x[7], x[10]);
                r[i] = -sum + *y;
            }
        }
    }
}

/// Number 11; |y - x2|^x3 with its one-sided limit 0 at y = x2.
fn gulf<T: DualNum<Primitive = f64> + Copy>(x: &[T], r: &mut [T]) {
    for (i, value) in r.iter_mut().enumerate() {
        let t = (i as f64 + 1.0) / 100.0;
        let y = 25.0 + (-50.0 * t.ln()).powf(2.0 / 3.0);
        let distance = (-x[1] + y).abs();
        let power = (distance.ln() * x[2]).exp();
        *value = (-power / x[0]).exp() - t;
    }
}
