//! A small table of figures: for people as text, for programs as JSON.

use serde::{Serialize, Serializer};

/// One figure of a table.
#[derive(Debug, Clone, PartialEq)]
pub enum TableCell {
    /// Words.
    Text(String),
    /// A count.
    Count(usize),
    /// A number; not finite where there is none.
    Number(f64),
    /// A fraction, printed in percent.
    Share(f64),
    /// A 95 % interval of a number.
    Interval([f64; 2]),
    /// A 95 % interval of a fraction, printed in percent.
    ShareInterval([f64; 2]),
    /// A probability under the hypothesis that nothing differs.
    Probability(f64),
}

impl TableCell {
    /// Write the figure for people.
    ///
    /// ```
    /// use cfpose_lab::statistics::TableCell;
    /// assert_eq!(TableCell::ShareInterval([0.25, 0.5]).text(), "25.0 .. 50.0");
    /// assert_eq!(TableCell::Number(f64::INFINITY).text(), "-");
    /// ```
    pub fn text(&self) -> String {
        match self {
            Self::Text(text) => text.clone(),
            Self::Count(count) => count.to_string(),
            Self::Number(value) => number(*value),
            Self::Share(share) if share.is_finite() => format!("{:.1}", 100.0 * share),
            Self::Share(_) => "-".to_string(),
            Self::Interval([low, high]) => format!("{} .. {}", number(*low), number(*high)),
            Self::ShareInterval([low, high]) => format!("{:.1} .. {:.1}", 100.0 * low, 100.0 * high),
            Self::Probability(p) if *p >= 0.001 => format!("{p:.3}"),
            Self::Probability(p) if *p < 1e-99 => "< 1e-99".to_string(),
            Self::Probability(p) if p.is_finite() => format!("{p:.1e}"),
            Self::Probability(_) => "-".to_string(),
        }
    }
}

fn number(value: f64) -> String {
    match value {
        v if !v.is_finite() => "-".to_string(),
        v if v != 0.0 && !(1e-3..1e5).contains(&v.abs()) => format!("{v:.2e}"),
        v if v.abs() >= 100.0 || v == v.trunc() => format!("{v:.0}"),
        v if v.abs() >= 10.0 => format!("{v:.2}"),
        v => format!("{v:.4}"),
    }
}

impl Serialize for TableCell {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        // What is not finite becomes null in JSON.
        match self {
            Self::Text(text) => text.serialize(serializer),
            Self::Count(count) => count.serialize(serializer),
            Self::Number(value) | Self::Share(value) | Self::Probability(value) => value.serialize(serializer),
            Self::Interval(interval) | Self::ShareInterval(interval) => interval.serialize(serializer),
        }
    }
}

/// What a statistic says about a group.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Table {
    /// Headings.
    pub columns: Vec<&'static str>,
    /// Rows, as long as the headings.
    pub rows: Vec<Vec<TableCell>>,
}
