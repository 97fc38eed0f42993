//! Round numbers along an axis.

use super::{Axis, Scale};

/// An axis with its range.
pub(super) struct Ruler<'a> {
    pub axis: &'a Axis,
    pub low: f64,
    pub high: f64,
}

impl<'a> Ruler<'a> {
    /// Lay out an axis over values; those that it cannot show are left out.
    pub fn over(axis: &'a Axis, values: impl Iterator<Item = f64>) -> Self {
        let fits = |v: &f64| v.is_finite() && (axis.scale != Scale::Log || *v > 0.0);
        let (low, high) =
            values.filter(fits).fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
        let (low, high) = if low <= high { (low, high) } else { (1.0, 1.0) };
        let (low, high) = match axis.scale {
            Scale::Names => (-0.5, axis.names.len().max(1) as f64 - 0.5),
            Scale::Share if low >= 0.0 => (0.0, 1.0),
            Scale::Log if high < 1.5 * low => (0.5 * low, 2.0 * high),
            Scale::Log => (low, high),
            _ if high == low => (low - 0.5, high + 0.5),
            _ => (low - 0.04 * (high - low), high + 0.04 * (high - low)),
        };
        Self { axis, low, high }
    }

    /// Return the place of a value, 0 at the lower end and 1 at the upper; values beyond the ends stay at them.
    pub fn place(&self, value: f64) -> f64 {
        let share = match self.axis.scale {
            Scale::Log => (value.max(f64::MIN_POSITIVE) / self.low).ln() / (self.high / self.low).ln(),
            _ => (value - self.low) / (self.high - self.low),
        };
        share.clamp(0.0, 1.0)
    }

    /// Return values to mark, with their texts.
    pub fn marks(&self) -> Vec<(f64, String)> {
        match self.axis.scale {
            Scale::Names => {
                let step = self.axis.names.len().div_ceil(24).max(1);
                let named = self.axis.names.iter().enumerate().step_by(step);
                named.map(|(index, name)| (index as f64, name.clone())).collect()
            }
            // Less than a factor of four: equal steps say more than powers.
            Scale::Log if self.high >= 4.0 * self.low => self.powers(),
            _ => {
                let step = round_step((self.high - self.low) / 5.0);
                let first = (self.low / step).ceil() as i64;
                let last = (self.high / step + 1e-9).floor() as i64;
                (first..=last).map(|k| k as f64 * step).map(|v| (v, self.text(v))).collect()
            }
        }
    }

    fn text(&self, value: f64) -> String {
        if self.axis.scale == Scale::Share { format!("{:.0} %", 100.0 * value) } else { plain(value) }
    }

    fn powers(&self) -> Vec<(f64, String)> {
        let decades = (self.high / self.low).log10();
        let digits: &[f64] = if decades < 1.5 { &[1.0, 2.0, 5.0] } else { &[1.0] };
        let every = (decades / 6.0).ceil().max(1.0) as i32;
        let (first, last) = (self.low.log10().floor() as i32, self.high.log10().ceil() as i32);
        let values = (first..=last)
            .filter(|power| power % every == 0)
            .flat_map(|power| digits.iter().map(move |digit| digit * 10_f64.powi(power)));
        let inside = |v: &f64| *v >= self.low * (1.0 - 1e-9) && *v <= self.high * (1.0 + 1e-9);
        values.filter(inside).map(|v| (v, plain(v))).collect()
    }
}

/// Return 1, 2 or 5 times a power of ten, near a step.
fn round_step(step: f64) -> f64 {
    let power = 10_f64.powf(step.log10().floor());
    let digit = [1.0, 2.0, 5.0, 10.0].into_iter().find(|digit| digit * power >= step).unwrap_or(10.0);
    digit * power
}

/// Write a number in its shortest form of four digits.
pub(super) fn plain(value: f64) -> String {
    let value = super::short(value);
    if value != 0.0 && !(1e-3..1e5).contains(&value.abs()) { format!("{value:e}") } else { format!("{value}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_are_round_and_inside() {
        let axis = Axis::new("x", Scale::Linear);
        let texts = |ruler: Ruler<'_>| ruler.marks().into_iter().map(|(_, text)| text).collect::<Vec<_>>();
        assert_eq!(texts(Ruler { axis: &axis, low: 0.0, high: 1.0 }), ["0", "0.2", "0.4", "0.6", "0.8", "1"]);
        let log = Axis::new("x", Scale::Log);
        assert_eq!(texts(Ruler::over(&log, [0.01, 100.0, -1.0].into_iter())), ["0.01", "0.1", "1", "10", "100"]);
        assert_eq!(texts(Ruler::over(&log, [1.0, 6.0].into_iter())), ["1", "2", "5"]);
        let share = Axis::new("x", Scale::Share);
        assert_eq!(texts(Ruler::over(&share, [0.3].into_iter())).last().unwrap(), "100 %");
    }
}
