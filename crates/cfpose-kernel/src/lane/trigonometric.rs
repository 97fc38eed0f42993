//! Sine, cosine and the angle of a vector on lanes.

use std::f64::consts::{FRAC_2_PI, FRAC_PI_4, PI};

use pulp::Simd;

use super::{Lane, ROUND, SIGN, UP};
use crate::scalar::Scalar;

/// pi/4 minus its nearest `f64`.
const PI_4_TAIL: f64 = 3.061_616_997_868_383e-17;

impl<S: Simd> Lane<S> {
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
        let count = rounded.bits();
        let (zero, one, two, sign) = (s.splat_u64s(0), s.splat_u64s(1), s.splat_u64s(2), s.splat_u64s(SIGN));
        let (sine_bits, cosine_bits) = (sine.bits(), cosine.bits());
        // Odd quarter turns swap the two; pulp has no 64-bit shift, so 0 - bit spreads a bit over the word.
        let odd = s.sub_u64s(zero, s.and_u64s(count, one));
        let swap = s.and_u64s(s.xor_u64s(sine_bits, cosine_bits), odd);
        let flip_sine = s.and_u64s(sign, s.sub_u64s(zero, s.and_u64s(count, two)));
        let flip_cosine = s.and_u64s(sign, s.sub_u64s(zero, s.and_u64s(s.add_u64s(count, one), two)));
        let sine = s.xor_u64s(s.xor_u64s(sine_bits, swap), flip_sine);
        let cosine = s.xor_u64s(s.xor_u64s(cosine_bits, swap), flip_cosine);
        (rounded.of_bits(sine), rounded.of_bits(cosine))
    }

    /// See [`Scalar::sin_cos`].
    #[inline(always)]
    pub(super) fn sin_cos_of(self) -> (Self, Self) {
        let rounded = self.mul_add(self.all(FRAC_2_PI), self.all(ROUND));
        let count = rounded - ROUND;
        // pi/2 in three parts (Cody and Waite, constants of Cephes).
        let r = count.mul_add(self.all(-1.570_796_251_296_997), self);
        let r = count.mul_add(self.all(-7.549_789_415_861_596e-8), r);
        let r = count.mul_add(self.all(-5.390_302_858_158_119e-15), r);
        let (sine, cosine) = r.sin_cos_kernel();
        Self::turn(rounded, sine, cosine)
    }

    /// See [`Scalar::sin_cos_pi`].
    #[inline(always)]
    pub(super) fn sin_cos_pi_of(self) -> (Self, Self) {
        let rounded = self.mul_add(self.all(2.0), self.all(ROUND));
        let count = rounded - ROUND;
        let r = count.mul_add(self.all(-0.5), self);
        let (sine, cosine) = (r * PI).sin_cos_kernel();
        Self::turn(rounded, sine, cosine)
    }

    /// Return atan t for |t| <= 0.66 (rational function of the Cephes library, Moshier).
    #[inline(always)]
    fn atan_kernel(self) -> Self {
        let square = self * self;
        let above = square.horner([
            -8.750_608_600_031_904e-1,
            -1.615_753_718_733_365e1,
            -7.500_855_792_314_705e1,
            -1.228_866_684_490_136_1e2,
            -6.485_021_904_942_025e1,
        ]);
        let below = square.horner([
            1.0,
            2.485_846_490_142_306_4e1,
            1.650_270_098_316_988_4e2,
            4.328_810_604_912_903e2,
            4.853_903_996_359_137e2,
            1.945_506_571_482_614e2,
        ]);
        (self * square).mul_add(above / below, self)
    }

    /// See [`Scalar::atan2`]; `self` is y.
    #[inline(always)]
    pub(super) fn atan2_of(self, x: Self) -> Self {
        let (zero, one, largest) = (self.all(0.0), self.all(1.0), self.all(f64::MAX));
        let (a, b) = (self.abs(), x.abs());
        // NaN runs through: a comparison with NaN is false, so each of the two is taken once.
        let (near, far) = (a.select_less(b, a, b), a.select_less(b, b, a));
        // A quarter of huge lengths, so that their sum is finite, and subnormal ones made normal; an infinite one becomes 1 and a
        // finite one beside it 0.
        let scale = self.all(1e300).select_less(far, self.all(0.25), one);
        let scale = far.select_less(self.all(1e-290), self.all(UP), scale);
        let scale = largest.select_less(far, zero, scale);
        let near = largest.select_less(near, one, near * scale);
        let far = largest.select_less(far, one, far * scale);
        // 0 / 0 becomes 0 / 1.
        let far = far.select_less(self.all(f64::from_bits(1)), one, far);
        // atan q = pi/4 + atan((q - 1) / (q + 1)) for q above tan(pi/8) and a little.
        let limit = far * 0.66;
        let t = limit.select_less(near, near - far, near) / limit.select_less(near, near + far, far);
        let quarters = limit.select_less(near, one, zero);
        let angle = t.atan_kernel();
        // Mirror at the diagonal, then at the y axis: the angle is quarters * pi/4 + side * angle.
        let (quarters, side) = (b.select_less(a, -quarters + 2.0, quarters), b.select_less(a, -one, one));
        let left = x.sign_of(one);
        let (quarters, side) = (left.select_less(zero, -quarters + 4.0, quarters), left.select_less(zero, -side, side));
        let base = quarters * FRAC_PI_4;
        let tail = quarters.mul_add(self.all(FRAC_PI_4), -base) + quarters * PI_4_TAIL;
        let angle = base + side.mul_add(angle, tail);
        self.sign_of(angle)
    }

    /// Return `size` with the sign bit of `self`; its own sign bit must be 0.
    #[inline(always)]
    pub(super) fn sign_of(self, size: Self) -> Self {
        let sign = self.simd.and_u64s(self.bits(), self.simd.splat_u64s(SIGN));
        self.of_bits(self.simd.xor_u64s(sign, size.bits()))
    }
}
