//! The number type that models and families are written over.

use std::f64::consts::PI;
use std::ops::{Add, Div, Mul, Neg, Sub};

use num_dual::DualNum;

/// A number that a model or a family computes with.
///
/// Authors write their maps once over `S: Scalar`. The same code then runs on plain `f64`, on every number of num-dual
/// (first and second derivatives), and on SIMD lanes with or without derivatives ([`crate::Lane`], [`crate::Jet`]).
///
/// Constants enter through operations with `f64` or through [`Scalar::constant`]; branches on values go through
/// [`Scalar::select_less`], because the lanes of one vector may disagree.
///
/// ```
/// use cfpose_kernel::Scalar;
/// fn unit<S: Scalar>(y: [S; 2]) -> [S; 2] {
///     let scale = (y[0] * y[0] + y[1] * y[1]).sqrt().recip();
///     [y[0] * scale, y[1] * scale]
/// }
/// assert_eq!(unit([3.0, 4.0]), [0.6000000000000001, 0.8]);
/// ```
pub trait Scalar:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + Add<f64, Output = Self>
    + Sub<f64, Output = Self>
    + Mul<f64, Output = Self>
{
    /// Return a constant of the same kind as `self` (a lane needs a value at hand to know its instruction set).
    fn constant(self, value: f64) -> Self;

    /// Return the square root.
    fn sqrt(self) -> Self;

    /// Return 1 / self.
    fn recip(self) -> Self;

    /// Return e^self.
    fn exp(self) -> Self;

    /// Return the natural logarithm: -infinity at 0, NaN below.
    fn ln(self) -> Self;

    /// Return self^exponent for a constant exponent; NaN for negative numbers unless the exponent is whole.
    ///
    /// num-dual divides by the number to get derivatives: its derivatives are not finite at 0, those of lanes are where they
    /// exist.
    fn powf(self, exponent: f64) -> Self;

    /// Return the angle of the vector (x, y) in radians, -pi to pi, for `self` = y; 0 at the origin, where it has no derivative.
    ///
    /// ```
    /// use cfpose_kernel::Scalar;
    /// assert_eq!(Scalar::atan2(1.0, -1.0), 0.75 * std::f64::consts::PI);
    /// ```
    fn atan2(self, x: Self) -> Self;

    /// Return the hyperbolic sine.
    fn sinh(self) -> Self;

    /// Return the hyperbolic cosine.
    fn cosh(self) -> Self;

    /// Return the hyperbolic tangent.
    fn tanh(self) -> Self;

    /// Return sine and cosine of an angle in radians.
    fn sin_cos(self) -> (Self, Self);

    /// Return sin(pi self) and cos(pi self).
    fn sin_cos_pi(self) -> (Self, Self);

    /// Return `yes` where `self < other`, else `no`: the only branch on values in per-point code.
    fn select_less(self, other: Self, yes: Self, no: Self) -> Self;

    /// Return the absolute value; its derivative at 0 is that of +self.
    #[inline(always)]
    fn abs(self) -> Self {
        self.select_less(self.constant(0.0), -self, self)
    }
}

impl<T: DualNum<Primitive = f64> + Copy> Scalar for T {
    #[inline(always)]
    fn constant(self, value: f64) -> T {
        T::from(value)
    }
    #[inline(always)]
    fn sqrt(self) -> T {
        DualNum::sqrt(&self)
    }
    #[inline(always)]
    fn recip(self) -> T {
        DualNum::recip(&self)
    }
    #[inline(always)]
    fn exp(self) -> T {
        DualNum::exp(&self)
    }
    #[inline(always)]
    fn ln(self) -> T {
        DualNum::ln(&self)
    }
    #[inline(always)]
    fn powf(self, exponent: f64) -> T {
        DualNum::powf(&self, exponent)
    }
    #[inline(always)]
    fn atan2(self, x: T) -> T {
        if T::NDERIV == 0 || self.re().abs() <= x.re().abs() {
            return DualNum::atan2(&self, x);
        }
        // num-dual differentiates atan(y / x), which has no derivative at x = 0: turn by a quarter, keep the value.
        let turned = -DualNum::atan(&(x / self));
        turned + (self.re().atan2(x.re()) - turned.re())
    }
    #[inline(always)]
    fn sinh(self) -> T {
        DualNum::sinh(&self)
    }
    #[inline(always)]
    fn cosh(self) -> T {
        DualNum::cosh(&self)
    }
    #[inline(always)]
    fn tanh(self) -> T {
        // num-dual divides sinh by cosh, which are both infinite further out.
        if T::NDERIV > 0 && self.re().abs() > 350.0 {
            return T::from(self.re().signum());
        }
        DualNum::tanh(&self)
    }
    #[inline(always)]
    fn sin_cos(self) -> (T, T) {
        DualNum::sin_cos(&self)
    }
    #[inline(always)]
    fn sin_cos_pi(self) -> (T, T) {
        DualNum::sin_cos(&(self * PI))
    }
    #[inline(always)]
    fn select_less(self, other: T, yes: T, no: T) -> T {
        if self.re() < other.re() { yes } else { no }
    }
}
