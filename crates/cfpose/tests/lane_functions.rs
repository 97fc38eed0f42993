//! Accuracy of the vectorised elementary functions on every instruction set of this machine.

use cfpose::{Isa, Jet, Lane, Scalar};
use cfpose_kernel::lane::exp_below;
use num_dual::{Derivative, DualSVec64};
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
    Ln,
    Sinh,
    Cosh,
    Tanh,
    Powf(f64),
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
                Function::Ln => x.ln(),
                Function::Sinh => x.sinh(),
                Function::Cosh => x.cosh(),
                Function::Tanh => x.tanh(),
                Function::Powf(exponent) => x.powf(exponent),
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

/// Apply atan2 to two slices, a vector at a time; the first is y and takes the result.
struct ApplyAtan2<'a>(&'a mut [f64], &'a [f64]);

impl WithSimd for ApplyAtan2<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        for (y, x) in self.0.chunks_exact_mut(S::F64_LANES).zip(self.1.chunks_exact(S::F64_LANES)) {
            Lane::load(simd, y).atan2(Lane::load(simd, x)).store(y);
        }
    }
}

fn atan2(isa: Isa, y: &[f64], x: &[f64]) -> Vec<f64> {
    let (mut padded_y, mut padded_x) = (y.to_vec(), x.to_vec());
    padded_y.resize(y.len().div_ceil(8) * 8, 0.0);
    padded_x.resize(padded_y.len(), 1.0);
    isa.run(ApplyAtan2(&mut padded_y, &padded_x));
    padded_y.truncate(y.len());
    padded_y
}

/// Distance in units in the last place, those of subnormal numbers included; different signs or kinds are infinitely far.
fn places(value: f64, exact: f64) -> f64 {
    if value.is_nan() && exact.is_nan() {
        return 0.0;
    }
    if value.is_nan() || exact.is_nan() || value.is_sign_negative() != exact.is_sign_negative() {
        return f64::INFINITY;
    }
    value.to_bits().abs_diff(exact.to_bits()) as f64
}

/// Numbers of every size and sign: all bit patterns are equally likely, NaN and infinities left out.
fn all_sizes(seed: u64, count: usize) -> Vec<f64> {
    let mut rng = ChaCha12Rng::seed_from_u64(seed);
    let mut x = Vec::with_capacity(count);
    while x.len() < count {
        let value = f64::from_bits(rng.random::<u64>());
        if value.is_finite() {
            x.push(value);
        }
    }
    x
}

/// Numbers close to 1 on both sides, at every distance.
fn around_one(seed: u64) -> Vec<f64> {
    let mut rng = ChaCha12Rng::seed_from_u64(seed);
    (0..100_000).map(|k| 1.0 + (2.0 * rng.random::<f64>() - 1.0) * 0.5_f64.powi(k % 54)).collect()
}

const SPECIAL: [f64; 15] = [
    0.0,
    -0.0,
    f64::INFINITY,
    f64::NEG_INFINITY,
    f64::NAN,
    1.0,
    -1.0,
    5e-324,
    -5e-324,
    2.2e-308,
    -2.2e-308,
    f64::MAX,
    f64::MIN,
    -2.5,
    0.5,
];

#[test]
fn ln_is_within_one_ulp() {
    let positive = all_sizes(1, 200_000).into_iter().map(f64::abs);
    let small = all_sizes(2, 50_000).into_iter().map(|x| x.abs() * 1e-310 / f64::MAX.sqrt());
    let x: Vec<f64> = positive.chain(small).chain(around_one(3)).chain(SPECIAL).collect();
    for isa in Isa::available() {
        let y = apply(isa, Function::Ln, &x);
        let worst = (0..x.len()).fold(0.0_f64, |w, k| w.max(places(y[k], x[k].ln())));
        assert!(worst <= 1.0, "{}: {worst} ulp", isa.name());
    }
}

#[test]
fn powf_is_within_two_ulp_for_every_exponent() {
    let moderate = samples(30.0);
    let exponents = [
        -1e3,
        -100.0,
        -7.0,
        -3.0,
        -2.5,
        -2.0,
        -1.0,
        -0.5,
        -1e-3,
        1e-9,
        1e-3,
        1.0 / 3.0,
        0.5,
        0.75,
        1.5,
        2.5,
        3.0,
        4.0,
        7.0,
        10.3,
        101.0,
        1e3,
        1e6,
        1e12,
        -1e15,
    ];
    let x: Vec<f64> =
        all_sizes(4, 50_000).into_iter().chain(moderate.into_iter().step_by(4)).chain(around_one(5)).collect();
    for isa in Isa::available() {
        for exponent in exponents {
            let y = apply(isa, Function::Powf(exponent), &x);
            for k in 0..x.len() {
                let exact = x[k].powf(exponent);
                let subnormal = exact.abs() < 2.3e-308;
                let good = if subnormal { y[k].abs() < 2.3e-308 } else { places(y[k], exact) <= 2.0 };
                let name = isa.name();
                assert!(good, "{name}: {:e}^{exponent} = {exact:e}, not {:e}", x[k], y[k]);
            }
        }
    }
}

#[test]
fn powf_of_special_numbers_is_that_of_the_standard_library() {
    let exponents = [0.0, 1.0, 2.0, 3.0, -1.0, -2.0, -3.0, 0.5, -0.5, 2.5, -1e-3, 1e17, -1e17, 1e300, f64::INFINITY];
    for isa in Isa::available() {
        for exponent in exponents.into_iter().chain([f64::NEG_INFINITY, f64::NAN]) {
            let y = apply(isa, Function::Powf(exponent), &SPECIAL);
            for (value, x) in y.iter().zip(SPECIAL) {
                let exact = x.powf(exponent);
                let subnormal = exact != 0.0 && exact.abs() < 2.3e-308;
                let good = if subnormal { value.abs() < 2.3e-308 } else { places(*value, exact) <= 2.0 };
                assert!(good, "{}: {x:e}^{exponent:e} = {exact:e}, not {value:e}", isa.name());
            }
        }
    }
}

#[test]
fn atan2_is_within_two_ulp_in_every_direction_and_at_every_size() {
    let mut rng = ChaCha12Rng::seed_from_u64(6);
    let (mut y, mut x) = (all_sizes(7, 100_000), all_sizes(8, 100_000));
    for k in 0..300_000 {
        // Directions near the octant borders, at radius 1 and near the end of the range.
        let angle =
            0.25 * std::f64::consts::PI * (f64::from(k % 8) + 2.0 * (rng.random::<f64>() - 0.5).powi(k % 5 * 2 + 1));
        let size = [1.0, 1e-307, 1.2e308, 1e-160][k as usize % 4];
        y.push(size * angle.sin());
        x.push(size * angle.cos());
    }
    for a in SPECIAL {
        for b in SPECIAL {
            y.push(a);
            x.push(b);
        }
    }
    for isa in Isa::available() {
        let angle = atan2(isa, &y, &x);
        for k in 0..y.len() {
            let (exact, name) = (y[k].atan2(x[k]), isa.name());
            assert!(
                places(angle[k], exact) <= 2.0,
                "{name}: atan2({:e}, {:e}) = {exact:e}, not {:e}",
                y[k],
                x[k],
                angle[k]
            );
        }
    }
}

#[test]
fn hyperbolic_functions_are_within_three_ulp() {
    let sizes = [1e-300, 1e-9, 0.1, 0.624, 0.626, 1.0, 1.1, 20.0, 300.0, 710.4].into_iter();
    let x: Vec<f64> = sizes
        .flat_map(|range| samples(range).into_iter().step_by(5))
        .chain(all_sizes(9, 50_000))
        .chain(SPECIAL)
        .chain([710.4, 710.5, -710.4, -710.5])
        .collect();
    for isa in Isa::available() {
        for (function, exact, name) in [
            (Function::Sinh, f64::sinh as fn(f64) -> f64, "sinh"),
            (Function::Cosh, f64::cosh, "cosh"),
            (Function::Tanh, f64::tanh, "tanh"),
        ] {
            let y = apply(isa, function, &x);
            for k in 0..x.len() {
                let far = places(y[k], exact(x[k]));
                assert!(far <= 3.0, "{}: {name}({:e}) = {:e}, not {:e}", isa.name(), x[k], exact(x[k]), y[k]);
            }
        }
    }
}

/// Six functions of (x, y), x > 0.
#[inline(always)]
fn six<N: Scalar>(x: N, y: N) -> [N; 6] {
    let angle = y.atan2(x - 1.5);
    [(x * y * y + 0.1).ln(), (x + y * y).powf(1.7), angle, (x * y).sinh(), (x - y).cosh(), (x + y).tanh()]
}

/// Values and both derivatives of the six functions at one point, on lanes.
struct Derivatives([f64; 2]);

impl WithSimd for Derivatives {
    type Output = [[f64; 3]; 6];
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> [[f64; 3]; 6] {
        let x = Jet::<S, 2>::variable(Lane::splat(simd, self.0[0]), 0);
        let y = Jet::<S, 2>::variable(Lane::splat(simd, self.0[1]), 1);
        let first = |lane: Lane<S>| {
            let mut values = [0.0; 8];
            lane.store(&mut values);
            values[0]
        };
        six(x, y).map(|jet| [first(jet.re), first(jet.eps[0]), first(jet.eps[1])])
    }
}

#[test]
fn derivatives_of_the_functions_agree_with_num_dual_and_with_differences() {
    let mut rng = ChaCha12Rng::seed_from_u64(10);
    for isa in Isa::available() {
        for _ in 0..500 {
            let (x, y) = (0.1 + 2.8 * rng.random::<f64>(), 6.0 * rng.random::<f64>() - 3.0);
            let seed = |value: f64, e: [f64; 2]| DualSVec64::<2>::new(value, Derivative::some(e.into()));
            let oracle = six(seed(x, [1.0, 0.0]), seed(y, [0.0, 1.0]));
            let h = 1e-5;
            let moved = [(six(x + h, y), six(x - h, y)), (six(x, y + h), six(x, y - h))];
            for (i, found) in isa.run(Derivatives([x, y])).into_iter().enumerate() {
                let slope = oracle[i].eps.0.map_or([0.0; 2], |eps| [eps[0], eps[1]]);
                let scale = 1.0 + oracle[i].re.abs() + slope[0].abs() + slope[1].abs();
                assert!((found[0] - oracle[i].re).abs() < 1e-14 * scale, "{}: value {i} at ({x}, {y})", isa.name());
                for j in 0..2 {
                    assert!((found[1 + j] - slope[j]).abs() < 1e-13 * scale, "{}: slope {i} at ({x}, {y})", isa.name());
                    let difference = (moved[j].0[i] - moved[j].1[i]) / (2.0 * h);
                    // The angle jumps by 2 pi at the negative x axis.
                    if difference.abs() < 1e4 {
                        let error = (found[1 + j] - difference).abs();
                        assert!(error < 1e-6 * scale.powi(3), "{}: difference {i} at ({x}, {y}): {error}", isa.name());
                    }
                }
            }
        }
    }
}

#[test]
fn derivatives_exist_where_num_dual_divides_by_zero() {
    for isa in Isa::available() {
        struct Edges;
        impl WithSimd for Edges {
            type Output = [f64; 4];
            #[inline(always)]
            fn with_simd<S: Simd>(self, simd: S) -> [f64; 4] {
                let zero = Jet::<S, 1>::variable(Lane::splat(simd, 0.0), 0);
                let two = zero.constant(2.0);
                let far = Jet::<S, 1>::variable(Lane::splat(simd, 800.0), 0);
                [zero.powf(1.5).eps[0], two.atan2(zero).eps[0], far.tanh().eps[0], far.tanh().re]
                    .map(|v| v.sum() / S::F64_LANES as f64)
            }
        }
        assert_eq!(isa.run(Edges), [0.0, -0.5, 0.0, 1.0], "{}", isa.name());
    }
    // The oracle's own angle on the y axis, and its tanh far out.
    let x = num_dual::Dual64::new(0.0, 1.0);
    let angle = Scalar::atan2(x.constant(2.0), x);
    assert_eq!((angle.re, angle.eps), (std::f64::consts::FRAC_PI_2, -0.5));
    let far = Scalar::tanh(num_dual::Dual64::new(800.0, 1.0));
    assert_eq!((far.re, far.eps), (1.0, 0.0));
}

#[test]
fn exponentials_of_plain_loops_are_within_two_ulp() {
    for k in 0..=700_000 {
        let x = -0.001 * f64::from(k);
        assert!(ulps(exp_below(x), x.exp()) <= 2.0, "{x}");
    }
    assert!(exp_below(-1e9) == exp_below(-700.0));
}
