//! One SIMD vector of `f64` that carries its instruction-set token, so no code of ours needs `unsafe`.

use std::ops::{Add, Div, Mul, Neg, Sub};

use pulp::Simd;

use crate::scalar::Scalar;

mod exponential;
mod trigonometric;

pub use exponential::exp_below;

/// The widest vector of any supported instruction set, in `f64`.
pub const MAX_LANES: usize = 8;

/// Adding and subtracting 1.5 * 2^52 rounds to the nearest integer and leaves it in the low bits of the mantissa.
const ROUND: f64 = 6_755_399_441_055_744.0;

/// 2^54, which takes every subnormal number into the normal range.
const UP: f64 = 18_014_398_509_481_984.0;

/// The sign bit.
const SIGN: u64 = 1 << 63;

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

    // pulp's own selection, absolute value, sign and transmutation of f64 are functions by themselves, compiled without the
    // instruction set of their caller where they are not inlined: its operations on bits are always inlined.
    #[inline(always)]
    fn bits(self) -> S::u64s {
        pulp::cast(self.value)
    }

    #[inline(always)]
    fn of_bits(self, bits: S::u64s) -> Self {
        self.with(pulp::cast(bits))
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

    /// Apply a function to each lane of two vectors.
    #[inline(always)]
    fn zip_lanes(self, other: Self, function: impl Fn(f64, f64) -> f64) -> Self {
        let (mut v, mut w) = ([0.0; MAX_LANES], [0.0; MAX_LANES]);
        self.store(&mut v);
        other.store(&mut w);
        for k in 0..S::F64_LANES {
            v[k] = function(v[k], w[k]);
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
        self.of_bits(self.simd.xor_u64s(self.bits(), self.simd.splat_u64s(SIGN)))
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
        self.exp_of()
    }
    /// At most 1 ulp for every positive number, subnormal ones included; -infinity at 0, NaN below.
    #[inline(always)]
    fn ln(self) -> Self {
        if S::F64_LANES == 1 { self.map_lanes(f64::ln) } else { self.ln_of() }
    }
    /// At most 2 ulp where the result is a normal number, for every exponent; below, 0 (no subnormal results). Zeros,
    /// infinities, NaN and negative numbers as `f64::powf` has them.
    #[inline(always)]
    fn powf(self, exponent: f64) -> Self {
        if S::F64_LANES == 1 { self.map_lanes(|x| x.powf(exponent)) } else { self.powf_of(exponent) }
    }
    /// At most 2 ulp of 1 for |x| <= 1e5; beyond, the reduction loses digits in proportion to |x|.
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        if S::F64_LANES == 1 { (self.map_lanes(f64::sin), self.map_lanes(f64::cos)) } else { self.sin_cos_of() }
    }
    /// At most 2 ulp of 1 for |x| <= 2^50; infinities give NaN.
    #[inline(always)]
    fn sin_cos_pi(self) -> (Self, Self) {
        self.sin_cos_pi_of()
    }
    /// At most 2 ulp for all y and x, subnormal ones included; zeros and infinities, their signs and NaN as `f64::atan2` has them.
    #[inline(always)]
    fn atan2(self, x: Self) -> Self {
        if S::F64_LANES == 1 { self.zip_lanes(x, f64::atan2) } else { self.atan2_of(x) }
    }
    /// At most 3 ulp everywhere; infinite above 710.47.
    #[inline(always)]
    fn sinh(self) -> Self {
        if S::F64_LANES == 1 { self.map_lanes(f64::sinh) } else { self.sinh_cosh_of().0 }
    }
    /// At most 3 ulp everywhere; infinite above 710.47.
    #[inline(always)]
    fn cosh(self) -> Self {
        if S::F64_LANES == 1 { self.map_lanes(f64::cosh) } else { self.sinh_cosh_of().1 }
    }
    /// At most 3 ulp everywhere.
    #[inline(always)]
    fn tanh(self) -> Self {
        if S::F64_LANES == 1 { self.map_lanes(f64::tanh) } else { self.tanh_of() }
    }
    #[inline(always)]
    fn select_less(self, other: Self, yes: Self, no: Self) -> Self {
        let mask = self.simd.less_than_f64s(self.value, other.value);
        self.of_bits(self.simd.select_u64s(mask, yes.bits(), no.bits()))
    }
    #[inline(always)]
    fn abs(self) -> Self {
        self.of_bits(self.simd.and_u64s(self.bits(), self.simd.splat_u64s(!SIGN)))
    }
}
