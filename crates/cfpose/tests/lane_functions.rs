//! Accuracy of the vectorised elementary functions on every instruction set of this machine.

use cfpose::{Isa, Lane, Scalar};
use pulp::{Simd, WithSimd};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha12Rng;

#[derive(Clone, Copy)]
enum Function {
    SinPi,
    CosPi,
    Sin,
    Cos,
    Exp,
}

/// Apply one function to a slice, a vector at a time.
struct Apply<'a>(Function, &'a mut [f64]);

impl WithSimd for Apply<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        for chunk in self.1.chunks_exact_mut(S::F64_LANES) {
            let x = Lane::load(simd, chunk);
            let y = match self.0 {
                Function::SinPi => x.sin_cos_pi().0,
                Function::CosPi => x.sin_cos_pi().1,
                Function::Sin => x.sin_cos().0,
                Function::Cos => x.sin_cos().1,
                Function::Exp => x.exp(),
            };
            y.store(chunk);
        }
    }
}

fn apply(isa: Isa, function: Function, x: &[f64]) -> Vec<f64> {
    let mut padded = x.to_vec();
    padded.resize(x.len().div_ceil(8) * 8, 0.0);
    isa.run(Apply(function, &mut padded));
    padded.truncate(x.len());
    padded
}

/// sin and cos of pi x with exact reduction, in double-double where it matters: pi (x - n/2) = pi_hi r + pi_lo r.
fn reference_pi(x: f64) -> (f64, f64) {
    let n = (2.0 * x).round();
    let r = x - 0.5 * n;
    let hi = r * std::f64::consts::PI;
    let lo = r.mul_add(std::f64::consts::PI, -hi) + r * 1.224_646_799_147_353_2e-16;
    let (s, c) = hi.sin_cos();
    let (s, c) = (s + c * lo, c - s * lo);
    match (n as i64).rem_euclid(4) {
        0 => (s, c),
        1 => (c, -s),
        2 => (-s, -c),
        _ => (-c, s),
    }
}

/// Distance in units in the last place of the exact value.
fn ulps(value: f64, exact: f64) -> f64 {
    if value == exact {
        return 0.0;
    }
    let ulp = f64::from_bits(exact.abs().to_bits() + 1) - exact.abs();
    (value - exact).abs() / ulp.max(f64::MIN_POSITIVE)
}

fn samples(range: f64) -> Vec<f64> {
    let mut rng = ChaCha12Rng::seed_from_u64(5);
    let mut x: Vec<f64> = (0..200_000).map(|_| range * (2.0 * rng.random::<f64>() - 1.0)).collect();
    // Close to the zeros and the octant borders.
    for n in -40..=40 {
        for e in [0.0, 1e-3, 1e-7, 1e-12] {
            x.push(0.25 * f64::from(n) + e);
        }
    }
    x
}

#[test]
fn sin_cos_pi_is_within_two_ulp() {
    for isa in Isa::available() {
        for range in [1.0, 10.0, 1e6] {
            let x = samples(range);
            let (s, c) = (apply(isa, Function::SinPi, &x), apply(isa, Function::CosPi, &x));
            let mut worst = 0.0_f64;
            for k in 0..x.len() {
                let (exact_s, exact_c) = reference_pi(x[k]);
                worst = worst.max(ulps(s[k], exact_s)).max(ulps(c[k], exact_c));
            }
            assert!(worst <= 2.0, "{} up to {range}: {worst} ulp", isa.name());
        }
    }
}

#[test]
fn sin_cos_is_within_two_ulp_to_a_hundred_thousand() {
    for isa in Isa::available() {
        for range in [1.0, 30.0, 1e5] {
            let x = samples(range);
            let (s, c) = (apply(isa, Function::Sin, &x), apply(isa, Function::Cos, &x));
            let worst = (0..x.len()).fold(0.0_f64, |w, k| w.max(ulps(s[k], x[k].sin())).max(ulps(c[k], x[k].cos())));
            assert!(worst <= 2.0, "{} up to {range}: {worst} ulp", isa.name());
        }
    }
}

#[test]
fn exp_is_within_two_ulp_over_the_whole_range() {
    for isa in Isa::available() {
        for range in [1.0, 50.0, 708.0] {
            let x = samples(range);
            let y = apply(isa, Function::Exp, &x);
            let worst = (0..x.len()).fold(0.0_f64, |w, k| w.max(ulps(y[k], x[k].exp())));
            assert!(worst <= 2.0, "{} up to {range}: {worst} ulp", isa.name());
        }
    }
}

#[test]
fn special_values_propagate() {
    let special = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 0.0, -0.0, 710.0, -800.0, f64::MAX];
    for isa in Isa::available() {
        let exp = apply(isa, Function::Exp, &special);
        assert!(exp[0].is_nan() && exp[1] == f64::INFINITY && exp[2] == 0.0 && exp[3] == 1.0 && exp[4] == 1.0);
        assert!(exp[5] == f64::INFINITY && exp[6] == 0.0 && exp[7] == f64::INFINITY, "{exp:?}");
        for function in [Function::SinPi, Function::CosPi, Function::Sin, Function::Cos] {
            let y = apply(isa, function, &special);
            assert!(y[0].is_nan() && y[1].is_nan() && y[2].is_nan(), "{}: {y:?}", isa.name());
        }
        assert_eq!(apply(isa, Function::SinPi, &special)[3], 0.0);
        assert_eq!(apply(isa, Function::CosPi, &special)[3], 1.0);
    }
}
