//! Exponentials, logarithms, powers and hyperbolic functions on lanes.

use std::f64::consts::LOG2_E;

use pulp::{Simd, bytemuck};

use super::{Lane, ROUND, UP};
use crate::scalar::Scalar;

/// ln 2 in two parts, the first with 21 trailing zero bits: whole multiples of it are exact.
const LN_2: [f64; 2] = [6.931_471_803_691_238e-1, 1.908_214_929_270_587_7e-10];

/// 1 / n! from n = 13 down to 2.
const FACTORIALS: [f64; 12] = [
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
];

/// 2/3 in two parts.
const TWO_THIRDS: [f64; 2] = [6.666_666_666_666_666e-1, 3.700_743_415_417_188e-17];

/// Return e^x for x up to 0, at least e^-700 (for NaN, too), within 2 ulp: 2^n e^r with n whole and r at most ln 2 / 2 in size.
///
/// No branch, no table and no fused product: a loop over it has vectors on every instruction set, and the same bits on all of them.
///
/// ```
/// use cfpose_kernel::lane::exp_below;
/// assert!(exp_below(0.0) == 1.0 && (exp_below(-2.5) / (-2.5_f64).exp() - 1.0).abs() < 4e-16);
/// assert!(exp_below(f64::NEG_INFINITY) < 1e-300);
/// ```
#[inline(always)]
pub fn exp_below(x: f64) -> f64 {
    let x = if x > -700.0 { x } else { -700.0 };
    let n = (x * LOG2_E + ROUND) - ROUND;
    let r = (x - n * LN_2[0]) - n * LN_2[1];
    let mut series = FACTORIALS[0];
    for coefficient in &FACTORIALS[1..] {
        series = series * r + coefficient;
    }
    // n + 1023 + 2^52 has the exponent field of 2^n in its low bits.
    let power = f64::from_bits((n + 4_503_599_627_371_519.0).to_bits() << 52);
    (r + r * r * series + 1.0) * power
}

impl<S: Simd> Lane<S> {
    /// Return (m, n) with e^(self + tail) = m 2^n for |self| up to 720 (beyond, that of 720) and a small tail.
    #[inline(always)]
    fn exp_parts(self, tail: Option<Self>) -> (Self, Self) {
        let clamped = self.select_less(self.all(-720.0), self.all(-720.0), self);
        let clamped = self.all(720.0).select_less(clamped, self.all(720.0), clamped);
        let count = clamped.mul_add(self.all(LOG2_E), self.all(ROUND)) - ROUND;
        let r = count.mul_add(self.all(-LN_2[0]), clamped);
        let mut r = count.mul_add(self.all(-LN_2[1]), r);
        if let Some(tail) = tail {
            r = r + tail;
        }
        let series = r.horner(FACTORIALS);
        ((r * r).mul_add(series, r) + 1.0, count)
    }

    /// Return self * 2^count.
    #[inline(always)]
    fn scaled(self, count: Self) -> Self {
        // In two factors, so that the extremes neither overflow nor underflow early.
        let half = (count * 0.5 + ROUND) - ROUND;
        self * half.power_of_two() * (count - half).power_of_two()
    }

    /// Return 2^self for whole numbers below 1023 in size.
    #[inline(always)]
    fn power_of_two(self) -> Self {
        if S::F64_LANES == 1 {
            return self.map_lanes(|n| f64::from_bits((n + 4_503_599_627_371_519.0).to_bits() << 52));
        }
        // n + 1023 + 1.5 * 2^20 has n + 1023 in the low bits of its upper half: a shift of halves (pulp has none of 64 bits)
        // makes it the exponent.
        let (s, sum) = (self.simd, self + 1_573_887.0);
        self.with(bytemuck::cast(s.wrapping_dyn_shl_u32s(bytemuck::cast(sum.value), s.splat_u32s(20))))
    }

    /// Return e^(exponent + tail) with 0 and infinity where the exponent, `self`, leaves the range of normal numbers.
    #[inline(always)]
    fn exp_with(self, tail: Option<Self>) -> Self {
        let (mantissa, count) = self.exp_parts(tail);
        let value = mantissa.scaled(count);
        let value = self.select_less(self.all(-708.396_418_532_264_1), self.all(0.0), value);
        // Comparisons with NaN are false, so NaN runs through all selections to the end.
        self.all(709.782_712_893_384).select_less(self, self.all(f64::INFINITY), value)
    }

    /// See [`Scalar::exp`].
    #[inline(always)]
    pub(super) fn exp_of(self) -> Self {
        self.exp_with(None)
    }

    /// Return e^abs(self) / 2, which overflows where cosh does.
    #[inline(always)]
    fn half_exp(self) -> Self {
        let (mantissa, count) = self.abs().exp_parts(None);
        mantissa.scaled(count - 1.0)
    }

    /// Split a positive number into (m, n), m 2^n, with m between sqrt(1/2) and sqrt 2.
    #[inline(always)]
    fn split(self) -> (Self, Self) {
        // Bits of sqrt(1/2), and what lifts them to those of 1.
        const ROOT: u64 = 0x3fe6_a09e_667f_3bcd;
        const LIFT: u64 = 0x3ff0_0000_0000_0000 - ROOT;
        let least = self.all(f64::MIN_POSITIVE);
        let number = self.select_less(least, self * UP, self);
        let s = self.simd;
        let lifted = s.add_u64s(number.bits(), s.splat_u64s(LIFT));
        let fraction = s.and_u64s(lifted, s.splat_u64s((1 << 52) - 1));
        let mantissa = self.of_bits(s.add_u64s(fraction, s.splat_u64s(ROOT)));
        // The exponent, moved to the low bits of the upper half, is 2^20 + exponent under the exponent field of 2^20.
        let moved = s.wrapping_dyn_shr_u32s(bytemuck::cast(lifted), s.splat_u32s(20));
        let upper = s.and_u64s(bytemuck::cast(moved), s.splat_u64s(0xffff_ffff_0000_0000));
        let count = self.of_bits(s.xor_u64s(upper, s.splat_u64s(0x4130_0000_0000_0000))) - 1_049_599.0;
        (mantissa, self.select_less(least, count - 54.0, count))
    }

    /// Put right what a logarithm's reduction cannot: 0, negative numbers, infinity, NaN.
    #[inline(always)]
    fn log_edges(self, value: Self) -> Self {
        // 0 for finite numbers, NaN for NaN and infinity.
        let value = value + self * 0.0;
        let value = self.all(f64::MAX).select_less(self, self, value);
        let value = self.select_less(self.all(f64::from_bits(1)), self.all(f64::NEG_INFINITY), value);
        self.select_less(self.all(0.0), self.all(f64::NAN), value)
    }

    /// See [`Scalar::ln`] (the reduction and the series of FreeBSD's `e_log.c`, Sun Microsystems).
    #[inline(always)]
    pub(super) fn ln_of(self) -> Self {
        let (mantissa, count) = self.split();
        let f = mantissa - 1.0;
        let s = f / (f + 2.0);
        let z = s * s;
        let series = z * z.horner([
            1.479_819_860_511_658_6e-1,
            1.531_383_769_920_937_3e-1,
            1.818_357_216_161_805e-1,
            2.222_219_843_214_978_4e-1,
            2.857_142_874_366_239e-1,
            3.999_999_999_940_942e-1,
            6.666_666_666_666_735e-1,
        ]);
        // ln(1 + f) = f - f^2/2 + s (f^2/2 + series).
        let half = f * f * 0.5;
        let tail = s.mul_add(half + series, count * LN_2[1]);
        self.log_edges(count.mul_add(self.all(LN_2[0]), f - (half - tail)))
    }

    /// Return ln of a positive number as a sum of two, the second small: about 63 bits.
    #[inline(always)]
    fn ln_pair(self) -> (Self, Self) {
        let (mantissa, count) = self.split();
        let f = mantissa - 1.0;
        // s = f / (2 + f) with what its rounding left over.
        let sum = f + 2.0;
        let s = f / sum;
        let rest = (-s).mul_add(sum, f) - s * (f - (sum - 2.0));
        let s_tail = rest / sum;
        // z = s^2; q = 2/3 + z (2/5 + z (2/7 + ..)); ln(1 + f) = 2 s + s z q.
        let z = s * s;
        let z_tail = s.mul_add(s, -z) + s * s_tail * 2.0;
        let more = z * z.horner([
            2.0 / 23.0,
            2.0 / 21.0,
            2.0 / 19.0,
            2.0 / 17.0,
            2.0 / 15.0,
            2.0 / 13.0,
            2.0 / 11.0,
            2.0 / 9.0,
            2.0 / 7.0,
            2.0 / 5.0,
        ]);
        let q = more + TWO_THIRDS[0];
        let q_tail = (self.all(TWO_THIRDS[0]) - q) + more + TWO_THIRDS[1];
        let p = z * q;
        let p_tail = z.mul_add(q, -p) + (z * q_tail + z_tail * q);
        let cubic = s * p;
        let cubic_tail = s.mul_add(p, -cubic) + (s * p_tail + s_tail * p);
        // n ln 2 + 2 s + cubic, the largest first.
        let (whole, double) = (count * LN_2[0], s * 2.0);
        let first = whole + double;
        let first_tail = (whole - first) + double;
        let high = first + cubic;
        let high_tail = (first - high) + cubic;
        (high, high_tail + (first_tail + (s_tail * 2.0 + cubic_tail + count * LN_2[1])))
    }

    /// See [`Scalar::powf`].
    #[inline(always)]
    pub(super) fn powf_of(self, exponent: f64) -> Self {
        if exponent == 0.0 {
            return self.all(1.0);
        }
        if exponent == 1.0 {
            return self;
        }
        if exponent == 2.0 {
            return self * self;
        }
        if !exponent.is_finite() {
            return self.map_lanes(|x| x.powf(exponent));
        }
        let (zero, size) = (self.all(0.0), self.abs());
        let (log, log_tail) = size.ln_pair();
        let factor = self.all(exponent);
        let product = log * factor;
        let tail = log.mul_add(factor, -product) + log_tail * factor;
        // Beyond the range of the exponential the tail means nothing and may be NaN.
        let inside = product.abs().select_less(self.all(740.0), tail, zero);
        // size * 0: 0 for finite numbers, NaN for NaN and infinity.
        let value = product.exp_with(Some(inside)) + size * 0.0;
        let (small, large) = if exponent > 0.0 { (0.0, f64::INFINITY) } else { (f64::INFINITY, 0.0) };
        let value = size.select_less(self.all(f64::from_bits(1)), self.all(small), value);
        let value = self.all(f64::MAX).select_less(size, self.all(large), value);
        if exponent % 2.0 == 0.0 {
            value
        } else if exponent.trunc() == exponent {
            self.sign_of(value)
        } else {
            let lowest = self.all(-f64::MAX);
            let value = self.select_less(zero, self.all(f64::NAN), value);
            self.select_less(lowest, self.all(large), value)
        }
    }

    /// Return (sinh, cosh).
    #[inline(always)]
    pub(super) fn sinh_cosh_of(self) -> (Self, Self) {
        let (size, half) = (self.abs(), self.half_exp());
        let inverse = self.all(0.25) / half;
        // For abs(x) < 1 the difference would cancel (rational function of the Cephes library, Moshier).
        let square = self * self;
        let above = square.horner([
            -7.894_744_439_635_37e-1,
            -1.637_258_575_259_838_3e2,
            -1.156_144_357_650_052_2e4,
            -3.517_549_648_081_514e5,
        ]);
        let below = square.horner([1.0, -2.777_110_814_206_028e2, 3.615_782_798_344_32e4, -2.110_529_788_848_909e6]);
        let near = (size * square).mul_add(above / below, size);
        let sinh = size.select_less(self.all(1.0), near, half - inverse);
        (self.sign_of(sinh), half + inverse)
    }

    /// See [`Scalar::tanh`].
    #[inline(always)]
    pub(super) fn tanh_of(self) -> Self {
        let size = self.abs();
        // For abs(x) < 0.625 the difference would cancel (rational function of the Cephes library, Moshier).
        let square = self * self;
        let above = square.horner([-9.643_991_794_250_523e-1, -9.928_772_310_019_186e1, -1.614_687_684_417_084_5e3]);
        let below = square.horner([1.0, 1.128_116_784_916_329_3e2, 2.235_488_390_601_004_5e3, 4.844_063_053_251_255e3]);
        let near = (size * square).mul_add(above / below, size);
        let far = self.all(1.0) - self.all(2.0) / ((size + size).exp_of() + 1.0);
        self.sign_of(size.select_less(self.all(0.625), near, far))
    }
}
