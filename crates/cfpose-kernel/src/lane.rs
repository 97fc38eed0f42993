//! One SIMD vector of `f64` that carries its instruction-set token, so no code of ours needs `unsafe`.

use std::f64::consts::{FRAC_2_PI, LOG2_E, PI};
use std::ops::{Add, Div, Mul, Neg, Sub};

use pulp::Simd;

use crate::scalar::Scalar;

/// The widest vector of any supported instruction set, in `f64`.
pub const MAX_LANES: usize = 8;

/// Adding and subtracting 1.5 * 2^52 rounds to the nearest integer and leaves it in the low bits of the mantissa.
const ROUND: f64 = 6_755_399_441_055_744.0;

/// A vector of [`Simd::F64_LANES`] numbers of instruction set `S`.
#[derive(Clone, Copy)]
pub struct Lane<S: Simd> {
    value: S::f64s,
    simd: S,
}

impl<S: Simd> Lane<S> {
    /// Number of lanes.
    pub const WIDTH: usize = S::F64_LANES;

    /// Fill all lanes with one value.
    #[inline(always)]
    pub fn splat(simd: S, value: f64) -> Self {
        Self { value: simd.splat_f64s(value), simd }
    }

    /// Load the first lanes of a slice of at least [`Lane::WIDTH`] values.
    #[inline(always)]
    pub fn load(simd: S, values: &[f64]) -> Self {
        Self { value: S::as_simd_f64s(&values[..S::F64_LANES]).0[0], simd }
    }

    /// Store into the first lanes of a slice of at least [`Lane::WIDTH`] values.
    #[inline(always)]
    pub fn store(self, out: &mut [f64]) {
        S::as_mut_simd_f64s(&mut out[..S::F64_LANES]).0[0] = self.value;
    }

    /// Return the token.
    #[inline(always)]
    pub fn simd(self) -> S {
        self.simd
    }

    /// Return self * factor + addend, fused where the hardware has it.
    #[inline(always)]
    pub fn mul_add(self, factor: Self, addend: Self) -> Self {
        self.with(self.simd.mul_add_e_f64s(self.value, factor.value, addend.value))
    }

    /// Sum the lanes by halving, the same order for every vector of one width.
    #[inline(always)]
    pub fn sum(self) -> f64 {
        let mut v = [0.0; MAX_LANES];
        self.store(&mut v);
        let mut width = S::F64_LANES;
        while width > 1 {
            width /= 2;
            for i in 0..width {
                v[i] += v[i + width];
            }
        }
        v[0]
    }

    #[inline(always)]
    fn with(self, value: S::f64s) -> Self {
        Self { value, simd: self.simd }
    }

    #[inline(always)]
    fn all(self, value: f64) -> Self {
        Self::splat(self.simd, value)
    }

    /// Evaluate a polynomial, coefficients from the highest power.
    #[inline(always)]
    fn horner<const N: usize>(self, coefficients: [f64; N]) -> Self {
        let mut sum = self.all(coefficients[0]);
        for i in 1..N {
            sum = sum.mul_add(self, self.all(coefficients[i]));
        }
        sum
    }

    /// Return (sin r, cos r) for |r| <= pi/4 (minimax polynomials of the Cephes library, Moshier).
    #[inline(always)]
    fn sin_cos_kernel(self) -> (Self, Self) {
        let square = self * self;
        let sine = square.horner([
            1.589_623_015_765_465_7e-10,
            -2.505_074_776_285_780_7e-8,
            2.755_731_362_138_572_4e-6,
            -1.984_126_982_958_954e-4,
            8.333_333_333_322_118e-3,
            -1.666_666_666_666_663e-1,
        ]);
        let cosine = square.horner([
            -1.135_853_652_138_768_2e-11,
            2.087_570_084_197_473e-9,
            -2.755_731_417_929_674e-7,
            2.480_158_728_885_17e-5,
            -1.388_888_888_887_305_6e-3,
            4.166_666_666_666_659e-2,
        ]);
        let half = square.mul_add(self.all(-0.5), self.all(1.0));
        ((self * square).mul_add(sine, self), (square * square).mul_add(cosine, half))
    }

    /// Turn (sin r, cos r) by the quarter turns whose count stands in the low bits of `rounded` = count + [`ROUND`].
    #[inline(always)]
    fn turn(rounded: Self, sine: Self, cosine: Self) -> (Self, Self) {
        let s = rounded.simd;
        let count = s.transmute_u64s_f64s(rounded.value);
        let (zero, one, two, sign) = (s.splat_u64s(0), s.splat_u64s(1), s.splat_u64s(2), s.splat_u64s(1 << 63));
        let (sine_bits, cosine_bits) = (s.transmute_u64s_f64s(sine.value), s.transmute_u64s_f64s(cosine.value));
        // Odd quarter turns swap the two; pulp has no 64-bit shift, so 0 - bit spreads a bit over the word.
        let odd = s.sub_u64s(zero, s.and_u64s(count, one));
        let swap = s.and_u64s(s.xor_u64s(sine_bits, cosine_bits), odd);
        let flip_sine = s.and_u64s(sign, s.sub_u64s(zero, s.and_u64s(count, two)));
        let flip_cosine = s.and_u64s(sign, s.sub_u64s(zero, s.and_u64s(s.add_u64s(count, one), two)));
        let sine = s.xor_u64s(s.xor_u64s(sine_bits, swap), flip_sine);
        let cosine = s.xor_u64s(s.xor_u64s(cosine_bits, swap), flip_cosine);
        (rounded.with(s.transmute_f64s_u64s(sine)), rounded.with(s.transmute_f64s_u64s(cosine)))
    }

    /// Apply a function to each lane.
    #[inline(always)]
    fn map_lanes(self, function: impl Fn(f64) -> f64) -> Self {
        let mut v = [0.0; MAX_LANES];
        self.store(&mut v);
        for value in &mut v[..S::F64_LANES] {
            *value = function(*value);
        }
        Self::load(self.simd, &v)
    }
}

macro_rules! lane_operator {
    ($trait:ident, $method:ident, $simd_method:ident) => {
        impl<S: Simd> $trait for Lane<S> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                self.with(self.simd.$simd_method(self.value, other.value))
            }
        }
        impl<S: Simd> $trait<f64> for Lane<S> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: f64) -> Self {
                self.with(self.simd.$simd_method(self.value, self.simd.splat_f64s(other)))
            }
        }
    };
}
lane_operator!(Add, add, add_f64s);
lane_operator!(Sub, sub, sub_f64s);
lane_operator!(Mul, mul, mul_f64s);
lane_operator!(Div, div, div_f64s);

impl<S: Simd> Neg for Lane<S> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        self.with(self.simd.neg_f64s(self.value))
    }
}

impl<S: Simd> Scalar for Lane<S> {
    #[inline(always)]
    fn constant(self, value: f64) -> Self {
        self.all(value)
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        self.with(self.simd.sqrt_f64s(self.value))
    }
    #[inline(always)]
    fn recip(self) -> Self {
        self.all(1.0) / self
    }
    /// At most 2 ulp; overflows to infinity above 709.78, underflows to 0 below -708.4 (no subnormal results); NaN stays.
    #[inline(always)]
    fn exp(self) -> Self {
        let clamped = self.select_less(self.all(-720.0), self.all(-720.0), self);
        let clamped = self.all(720.0).select_less(clamped, self.all(720.0), clamped);
        let count = clamped.mul_add(self.all(LOG2_E), self.all(ROUND)) - ROUND;
        // ln 2 in two parts, the first with 21 trailing zero bits: count * first is exact.
        let r = count.mul_add(self.all(-6.931_471_803_691_238e-1), clamped);
        let r = count.mul_add(self.all(-1.908_214_929_270_587_7e-10), r);
        let tail = r.horner([
            1.605_904_383_682_161_5e-10,
            2.087_675_698_786_81e-9,
            2.505_210_838_544_172e-8,
            2.755_731_922_398_589_3e-7,
            2.755_731_922_398_589e-6,
            2.480_158_730_158_73e-5,
            1.984_126_984_126_984e-4,
            1.388_888_888_888_889e-3,
            8.333_333_333_333_333e-3,
            4.166_666_666_666_666_4e-2,
            1.666_666_666_666_666_6e-1,
            0.5,
        ]);
        let mantissa = (r * r).mul_add(tail, r) + 1.0;
        // 2^count in two factors, so that the extremes neither overflow nor underflow early.
        // n + 1023 + 2^52 has n + 1023 in its low bits: a shift makes it the exponent, without a conversion lane by lane.
        let power = |n: f64| f64::from_bits((n + 4_503_599_627_371_519.0).to_bits() << 52);
        let half = (count * 0.5 + ROUND) - ROUND;
        let value = mantissa * half.map_lanes(power) * (count - half).map_lanes(power);
        let value = self.select_less(self.all(-708.396_418_532_264_1), self.all(0.0), value);
        // Comparisons with NaN are false, so NaN runs through all selections to the end.
        self.all(709.782_712_893_384).select_less(self, self.all(f64::INFINITY), value)
    }
    /// At most 2 ulp of 1 for |x| <= 1e5; beyond, the reduction loses digits in proportion to |x|.
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        if S::F64_LANES == 1 {
            return (self.map_lanes(f64::sin), self.map_lanes(f64::cos));
        }
        let rounded = self.mul_add(self.all(FRAC_2_PI), self.all(ROUND));
        let count = rounded - ROUND;
        // pi/2 in three parts (Cody and Waite, constants of Cephes).
        let r = count.mul_add(self.all(-1.570_796_251_296_997), self);
        let r = count.mul_add(self.all(-7.549_789_415_861_596e-8), r);
        let r = count.mul_add(self.all(-5.390_302_858_158_119e-15), r);
        let (sine, cosine) = r.sin_cos_kernel();
        Self::turn(rounded, sine, cosine)
    }
    /// At most 2 ulp of 1 for |x| <= 2^50; infinities give NaN.
    #[inline(always)]
    fn sin_cos_pi(self) -> (Self, Self) {
        let rounded = self.mul_add(self.all(2.0), self.all(ROUND));
        let count = rounded - ROUND;
        let r = count.mul_add(self.all(-0.5), self);
        let (sine, cosine) = (r * PI).sin_cos_kernel();
        Self::turn(rounded, sine, cosine)
    }
    #[inline(always)]
    fn select_less(self, other: Self, yes: Self, no: Self) -> Self {
        let mask = self.simd.less_than_f64s(self.value, other.value);
        self.with(self.simd.select_f64s(mask, yes.value, no.value))
    }
    #[inline(always)]
    fn abs(self) -> Self {
        self.with(self.simd.abs_f64s(self.value))
    }
}
