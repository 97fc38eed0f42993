//! Sums of doubles without any rounding: a number wide enough for every double, so that the order of the terms cannot matter.
//!
//! Source: the small superaccumulator of R. M. Neal, *Fast exact summation using small and large superaccumulators*, 2015.

/// Bits of a limb.
const LIMB: u32 = 32;

/// Limbs: doubles end at 2^-1074 and below 2^1024, and 2^64 of them may be added.
pub(super) const LIMBS: usize = 68;

/// Terms between two passes of carries: each changes a limb by less than 2^52.
const MOST_PENDING: u32 = 1000;

/// The exact sum of the doubles that were added: sum_i limbs_i 2^(32 i - 1074).
#[derive(Debug, Clone)]
pub(super) struct ExactSum {
    limbs: [i64; LIMBS],
    pending: u32,
}

/// The one way to write a sum: sign, the first limb that is not 0, and the limbs from there to the last that is not 0.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Canonical {
    pub negative: bool,
    pub first: usize,
    pub limbs: Vec<u32>,
}

impl ExactSum {
    pub(super) const ZERO: Self = Self { limbs: [0; LIMBS], pending: 0 };

    /// Add one finite number.
    #[inline]
    pub(super) fn add(&mut self, x: f64) {
        let bits = x.to_bits();
        let exponent = (bits >> 52 & 0x7ff) as usize;
        let fraction = bits & ((1 << 52) - 1);
        // x = mantissa 2^(place - 1074); numbers without a leading bit share the least exponent.
        let (mantissa, place) = if exponent == 0 { (fraction, 0) } else { (fraction | 1 << 52, exponent - 1) };
        let (limb, shift) = (place / LIMB as usize, place as u32 % LIMB);
        let sign = bits as i64 >> 63;
        let signed = |part: u64| (part as i64 ^ sign) - sign;
        self.limbs[limb] += signed(mantissa << shift & 0xffff_ffff);
        self.limbs[limb + 1] += signed(mantissa >> (LIMB - shift));
        self.pending += 1;
        if self.pending >= MOST_PENDING {
            self.carry();
        }
    }

    /// Add the terms of another sum.
    pub(super) fn merge(&mut self, other: &Self) {
        let mut other = other.clone();
        other.carry();
        self.carry();
        self.limbs.iter_mut().zip(&other.limbs).for_each(|(a, b)| *a += b);
        self.carry();
    }

    /// Bring every limb but the last into 0 .. 2^32.
    fn carry(&mut self) {
        let mut carry = 0;
        for limb in &mut self.limbs[..LIMBS - 1] {
            let value = *limb + carry;
            *limb = value & 0xffff_ffff;
            carry = value >> LIMB;
        }
        self.limbs[LIMBS - 1] += carry;
        self.pending = 0;
    }

    /// Return the sum in the one way to write it.
    pub(super) fn canonical(&self) -> Canonical {
        let mut sum = self.clone();
        sum.carry();
        let negative = sum.limbs[LIMBS - 1] < 0;
        if negative {
            sum.limbs.iter_mut().for_each(|limb| *limb = -*limb);
            sum.carry();
        }
        let first = sum.limbs.iter().position(|limb| *limb != 0).unwrap_or(LIMBS);
        let end = sum.limbs.iter().rposition(|limb| *limb != 0).map_or(first, |last| last + 1);
        let limbs: Vec<u32> = sum.limbs[first..end].iter().map(|limb| *limb as u32).collect();
        Canonical { negative, first: if limbs.is_empty() { 0 } else { first }, limbs }
    }

    /// Return the sum that is written so, `None` where it is not the one way to write it.
    pub(super) fn from_canonical(written: &Canonical) -> Option<Self> {
        let Canonical { negative, first, limbs } = written;
        let (Some(low), Some(high)) = (limbs.first(), limbs.last()) else {
            return (!negative && *first == 0).then_some(Self::ZERO);
        };
        if *low == 0 || *high == 0 || first + limbs.len() > LIMBS {
            return None;
        }
        let mut sum = Self::ZERO;
        for (to, from) in sum.limbs[*first..].iter_mut().zip(limbs) {
            *to = if *negative { -i64::from(*from) } else { i64::from(*from) };
        }
        sum.carry();
        Some(sum)
    }

    /// Return the double nearest to the sum.
    pub(super) fn value(&self) -> f64 {
        let Canonical { negative, first, limbs } = self.canonical();
        // Four limbs hold at least 97 bits; what lies below them only decides ties.
        let top = limbs.iter().rev().take(4).fold(0_u128, |sum, limb| sum << LIMB | u128::from(*limb));
        let below = &limbs[..limbs.len().saturating_sub(4)];
        let sticky = u128::from(below.iter().any(|limb| *limb != 0));
        let exponent = LIMB as i32 * (first + below.len()) as i32 - 1074;
        // In two steps: 2^exponent alone may be no double.
        let half = exponent / 2;
        let magnitude = (top | sticky) as f64 * power_of_two(half) * power_of_two(exponent - half);
        if negative { -magnitude } else { magnitude }
    }

    /// Return the sum as two doubles, the nearest and the nearest to what is left.
    pub(super) fn pair(&self) -> (f64, f64) {
        let high = self.value();
        if !high.is_finite() {
            return (high, 0.0);
        }
        let mut rest = self.clone();
        rest.add(-high);
        (high, rest.value())
    }
}

/// Return 2^k for -1022 <= k <= 1023.
fn power_of_two(k: i32) -> f64 {
    f64::from_bits(((k + 1023) as u64) << 52)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sum(terms: &[f64]) -> ExactSum {
        let mut sum = ExactSum::ZERO;
        terms.iter().for_each(|x| sum.add(*x));
        sum
    }

    #[test]
    fn nothing_is_lost_between_the_largest_and_the_smallest_double() {
        let terms = [f64::MAX, 5e-324, 1.0, -f64::MAX, f64::MAX, -1.0, -f64::MAX, 3.5, 1e-30];
        assert_eq!(sum(&terms).pair(), (3.5, 1e-30));
        assert_eq!(sum(&[f64::MAX, 5e-324, -f64::MAX]).value(), 5e-324);
        assert_eq!(sum(&[1.0, 2_f64.powi(-53), 5e-324]).value(), 1.0 + f64::EPSILON);
        assert_eq!(sum(&[1.0, 2_f64.powi(-53)]).value(), 1.0);
        assert_eq!(sum(&[-1.0, 1.0]).canonical(), sum(&[]).canonical());
    }

    #[test]
    fn any_order_and_any_parts_give_the_same_limbs() {
        let mut x = 0.3_f64;
        let terms: Vec<f64> = (0..5000)
            .map(|k| {
                x = 3.9 * x * (1.0 - x);
                (x - 0.5) * 2_f64.powi(k % 600 - 300)
            })
            .collect();
        let whole = sum(&terms).canonical();
        let backwards: Vec<f64> = terms.iter().rev().copied().collect();
        assert_eq!(sum(&backwards).canonical(), whole);
        let mut merged = ExactSum::ZERO;
        for part in terms.chunks(77).rev() {
            merged.merge(&ExactSum::from_canonical(&sum(part).canonical()).unwrap());
        }
        assert_eq!(merged.canonical(), whole);
    }

    #[test]
    fn carries_keep_millions_of_equal_terms() {
        let mut many = ExactSum::ZERO;
        (0..3_000_000).for_each(|_| many.add(-0.1));
        // 0.1 is 3602879701896397 / 2^55.
        assert_eq!(many.value(), -(3_602_879_701_896_397.0 * 3e6) / 2_f64.powi(55));
    }
}
