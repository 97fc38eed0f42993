//! First-order dual numbers over lanes: the small dual that survives the dispatch to an instruction set.

use std::f64::consts::PI;
use std::ops::{Add, Div, Mul, Neg, Sub};

use pulp::Simd;

use crate::lane::Lane;
use crate::scalar::Scalar;

/// A value with M directional derivatives, one SIMD vector each.
///
/// It does not implement num-dual's `DualNum`, so both families of numbers are [`Scalar`] without overlap.
#[derive(Clone, Copy)]
pub struct Jet<S: Simd, const M: usize> {
    /// Value.
    pub re: Lane<S>,
    /// Derivatives along the M directions.
    pub eps: [Lane<S>; M],
}

impl<S: Simd, const M: usize> Jet<S, M> {
    /// Make a constant: all derivatives 0.
    #[inline(always)]
    pub fn fixed(re: Lane<S>) -> Self {
        Self { re, eps: [re.constant(0.0); M] }
    }

    /// Make the variable of direction `index`.
    #[inline(always)]
    pub fn variable(re: Lane<S>, index: usize) -> Self {
        let mut jet = Self::fixed(re);
        jet.eps[index] = re.constant(1.0);
        jet
    }

    /// Apply the chain rule: value `re`, outer derivative `slope`.
    #[inline(always)]
    fn chain(self, re: Lane<S>, slope: Lane<S>) -> Self {
        let mut eps = self.eps;
        for e in &mut eps {
            *e = *e * slope;
        }
        Self { re, eps }
    }
}

impl<S: Simd, const M: usize> Add for Jet<S, M> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        let mut eps = self.eps;
        for j in 0..M {
            eps[j] = eps[j] + other.eps[j];
        }
        Self { re: self.re + other.re, eps }
    }
}

impl<S: Simd, const M: usize> Sub for Jet<S, M> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        let mut eps = self.eps;
        for j in 0..M {
            eps[j] = eps[j] - other.eps[j];
        }
        Self { re: self.re - other.re, eps }
    }
}

impl<S: Simd, const M: usize> Mul for Jet<S, M> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        let mut eps = self.eps;
        for j in 0..M {
            eps[j] = self.re.mul_add(other.eps[j], eps[j] * other.re);
        }
        Self { re: self.re * other.re, eps }
    }
}

impl<S: Simd, const M: usize> Div for Jet<S, M> {
    type Output = Self;
    #[inline(always)]
    #[allow(clippy::suspicious_arithmetic_impl)] // one division instead of 1 + 2 M
    fn div(self, other: Self) -> Self {
        self * other.recip()
    }
}

impl<S: Simd, const M: usize> Neg for Jet<S, M> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        let mut eps = self.eps;
        for e in &mut eps {
            *e = -*e;
        }
        Self { re: -self.re, eps }
    }
}

impl<S: Simd, const M: usize> Add<f64> for Jet<S, M> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: f64) -> Self {
        Self { re: self.re + other, eps: self.eps }
    }
}

impl<S: Simd, const M: usize> Sub<f64> for Jet<S, M> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: f64) -> Self {
        Self { re: self.re - other, eps: self.eps }
    }
}

impl<S: Simd, const M: usize> Mul<f64> for Jet<S, M> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: f64) -> Self {
        let factor = self.re.constant(other);
        self.chain(self.re * factor, factor)
    }
}

impl<S: Simd, const M: usize> Scalar for Jet<S, M> {
    #[inline(always)]
    fn constant(self, value: f64) -> Self {
        Self::fixed(self.re.constant(value))
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        let root = self.re.sqrt();
        self.chain(root, root.constant(0.5) / root)
    }
    #[inline(always)]
    fn recip(self) -> Self {
        let inverse = self.re.recip();
        self.chain(inverse, -(inverse * inverse))
    }
    #[inline(always)]
    fn exp(self) -> Self {
        let value = self.re.exp();
        self.chain(value, value)
    }
    #[inline(always)]
    fn ln(self) -> Self {
        self.chain(self.re.ln(), self.re.recip())
    }
    #[inline(always)]
    fn powf(self, exponent: f64) -> Self {
        if exponent == 0.0 {
            return self.constant(1.0);
        }
        self.chain(self.re.powf(exponent), self.re.powf(exponent - 1.0) * exponent)
    }
    #[inline(always)]
    fn atan2(self, x: Self) -> Self {
        // (x dy - y dx) / (x^2 + y^2), divided in two steps that neither overflow nor underflow early.
        let (y, one) = (self.re, self.re.constant(1.0));
        let largest = y.abs().select_less(x.re.abs(), x.re.abs(), y.abs());
        let inverse = one / largest;
        let (u, v) = (x.re * inverse, y * inverse);
        let scale = inverse / (u * u + v * v);
        let (u, v) = (u * scale, v * scale);
        let mut eps = self.eps;
        for j in 0..M {
            eps[j] = u.mul_add(self.eps[j], -(v * x.eps[j]));
        }
        Self { re: y.atan2(x.re), eps }
    }
    #[inline(always)]
    fn sinh(self) -> Self {
        self.chain(self.re.sinh(), self.re.cosh())
    }
    #[inline(always)]
    fn cosh(self) -> Self {
        self.chain(self.re.cosh(), self.re.sinh())
    }
    #[inline(always)]
    fn tanh(self) -> Self {
        // 1 / cosh^2 keeps its digits where 1 - tanh^2 has none left.
        let inverse = self.re.cosh().recip();
        self.chain(self.re.tanh(), inverse * inverse)
    }
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        let (sine, cosine) = self.re.sin_cos();
        (self.chain(sine, cosine), self.chain(cosine, -sine))
    }
    #[inline(always)]
    fn sin_cos_pi(self) -> (Self, Self) {
        let (sine, cosine) = self.re.sin_cos_pi();
        (self.chain(sine, cosine * PI), self.chain(cosine, -(sine * PI)))
    }
    #[inline(always)]
    fn select_less(self, other: Self, yes: Self, no: Self) -> Self {
        let mut eps = yes.eps;
        for j in 0..M {
            eps[j] = self.re.select_less(other.re, yes.eps[j], no.eps[j]);
        }
        Self { re: self.re.select_less(other.re, yes.re, no.re), eps }
    }
}
