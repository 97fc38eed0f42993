//! Numbers of about 104 bits: the unevaluated sum of two doubles.
//!
//! Only additions and multiplications that every instruction set rounds alike, no fused ones: the same bits everywhere.
//! Sources: T. J. Dekker, *A floating-point technique for extending the available precision*, 1971; D. E. Knuth, TAOCP 2, 4.2.2.

/// high + low, low at most half a unit in the last place of high.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Twofold {
    pub high: f64,
    pub low: f64,
}

/// 2^27 + 1: cuts a double into two of 26 bits.
const CUT: f64 = 134_217_729.0;

impl Twofold {
    /// Return a double.
    #[inline(always)]
    pub(super) fn of(high: f64) -> Self {
        Self { high, low: 0.0 }
    }

    /// Return a + b without rounding.
    #[inline(always)]
    pub(super) fn sum(a: f64, b: f64) -> Self {
        let high = a + b;
        let part = high - a;
        Self { high, low: (a - (high - part)) + (b - part) }
    }

    /// Return a b without rounding, where nothing underflows.
    #[inline(always)]
    pub(super) fn product(a: f64, b: f64) -> Self {
        let cut = |x: f64| {
            let big = CUT * x;
            let head = big - (big - x);
            (head, x - head)
        };
        let ((a1, a2), (b1, b2)) = (cut(a), cut(b));
        let high = a * b;
        Self { high, low: ((a1 * b1 - high) + a1 * b2 + a2 * b1) + a2 * b2 }
    }

    #[inline(always)]
    pub(super) fn times(self, other: Self) -> Self {
        let Self { high, low } = Self::product(self.high, other.high);
        let low = low + (self.high * other.low + self.low * other.high);
        let sum = high + low;
        Self { high: sum, low: low - (sum - high) }
    }

    #[inline(always)]
    pub(super) fn plus(self, other: Self) -> Self {
        let Self { high, low } = Self::sum(self.high, other.high);
        let low = low + (self.low + other.low);
        let sum = high + low;
        Self { high: sum, low: low - (sum - high) }
    }

    /// Return the nearest double.
    pub(super) fn value(self) -> f64 {
        self.high + self.low
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_and_sums_keep_what_doubles_lose() {
        let tiny = 2_f64.powi(-60);
        let one = Twofold::sum(1.0, tiny);
        // (1 + t)(1 - t) = 1 - t^2, and (1 + t) - 1 = t.
        let square = one.times(Twofold::sum(1.0, -tiny));
        assert!((square.plus(Twofold::of(-1.0)).value()).abs() < 2_f64.powi(-104));
        assert_eq!(one.plus(Twofold::of(-1.0)).value(), tiny);
        // 0.1 * 0.1 exactly, in integers: 0.1 = 3602879701896397 / 2^55.
        let square = Twofold::product(0.1, 0.1);
        let exact = 3_602_879_701_896_397_u128.pow(2);
        let high = (square.high * 2_f64.powi(110)) as u128;
        assert_eq!(square.low * 2_f64.powi(110), (exact as i128 - high as i128) as f64);
    }
}
