//! A figure as data: what the report draws in the browser and [`svg()`] draws for a paper.

mod svg;
mod ticks;

use serde::Serialize;
use serde::ser::{SerializeStruct, Serializer};

pub use svg::svg;

/// How an axis is divided.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Scale {
    /// Equal steps.
    Linear,
    /// Equal factors; values are positive.
    Log,
    /// A fraction from 0 to 1, written in percent.
    Share,
    /// A list of names: values are their indices.
    Names,
}

/// One axis.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Axis {
    /// What is measured, with its unit.
    pub label: String,
    /// How it is divided.
    pub scale: Scale,
    /// Names of the places of a [`Scale::Names`] axis.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub names: Vec<String>,
}

impl Axis {
    /// Make an axis of numbers.
    pub fn new(label: impl Into<String>, scale: Scale) -> Self {
        Self { label: label.into(), scale, names: Vec::new() }
    }

    /// Make an axis of names.
    pub fn of_names(label: impl Into<String>, names: Vec<String>) -> Self {
        Self { label: label.into(), scale: Scale::Names, names }
    }
}

/// How the points of a series are drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Style {
    /// A line with a band between the interval's ends.
    Line,
    /// A staircase that changes at the points, with a band.
    Steps,
    /// Dots with bars between the interval's ends.
    Dots,
    /// Open diamonds: figures from elsewhere.
    Diamonds,
}

/// One point with its 95 % interval.
#[derive(Debug, Clone, PartialEq)]
pub struct Point {
    /// Place on the x axis.
    pub x: f64,
    /// Value; not finite where there is none.
    pub y: f64,
    /// Ends of the interval; infinite where it is open.
    pub interval: Option<[f64; 2]>,
    /// What else is worth reading: counts, p-values.
    pub note: String,
}

/// Points that belong together.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// Indices of the methods that the series is about: it is shown while all of them are.
    pub methods: Vec<usize>,
    /// Name in the legend.
    pub label: String,
    /// How it is drawn.
    pub style: Style,
    /// Points, by x.
    pub points: Vec<Point>,
}

/// Success over two directions: one map a method.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FieldMap {
    /// Index of the method.
    pub method: usize,
    /// Name above the map.
    pub label: String,
    /// Half width of the map along x and y.
    pub half: [f64; 2],
    /// Fields along each axis.
    pub fields: usize,
    /// Successes and trials of every field, row by row from the lowest y.
    pub counts: Vec<(usize, usize)>,
    /// 95 % intervals of the fields' success rates.
    #[serde(serialize_with = "short_pairs")]
    pub intervals: Vec<[f64; 2]>,
}

/// One plot of one group of trials.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Figure {
    /// Name of the plot, as in the table of plots.
    pub plot: &'static str,
    /// Title.
    pub title: String,
    /// Horizontal axis.
    pub x: Axis,
    /// Vertical axis.
    pub y: Axis,
    /// Curves and dots.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub series: Vec<Series>,
    /// Maps; a figure has maps or series.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub maps: Vec<FieldMap>,
    /// What the figure says in words: counts, fitted exponents, what the intervals are.
    pub note: String,
}

impl Figure {
    /// Keep at most so many points of every curve, first and last among them; dots stay.
    #[must_use]
    pub fn thinned(mut self, limit: usize) -> Self {
        for series in self.series.iter_mut().filter(|series| matches!(series.style, Style::Line | Style::Steps)) {
            let (count, limit) = (series.points.len(), limit.max(2));
            if count > limit {
                let kept = (0..limit).map(|k| series.points[k * (count - 1) / (limit - 1)].clone());
                series.points = kept.collect();
            }
        }
        self
    }
}

/// Return a value with four digits; what is not finite becomes null in JSON.
pub fn short(value: f64) -> f64 {
    if value.is_finite() { format!("{value:.3e}").parse().unwrap_or(value) } else { f64::NAN }
}

fn short_pairs<S: Serializer>(pairs: &[[f64; 2]], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(pairs.iter().map(|pair| pair.map(short)))
}

impl Serialize for Series {
    /// Column by column: shorter than point by point.
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let column = |of: &dyn Fn(&Point) -> f64| self.points.iter().map(|p| short(of(p))).collect::<Vec<f64>>();
        let mut object = serializer.serialize_struct("Series", 8)?;
        object.serialize_field("methods", &self.methods)?;
        object.serialize_field("label", &self.label)?;
        object.serialize_field("style", &self.style)?;
        object.serialize_field("x", &column(&|p| p.x))?;
        object.serialize_field("y", &column(&|p| p.y))?;
        if self.points.iter().any(|point| point.interval.is_some()) {
            object.serialize_field("low", &column(&|p| p.interval.map_or(f64::NAN, |i| i[0])))?;
            object.serialize_field("high", &column(&|p| p.interval.map_or(f64::NAN, |i| i[1])))?;
        }
        if self.points.iter().any(|point| !point.note.is_empty()) {
            object.serialize_field("notes", &self.points.iter().map(|p| &p.note).collect::<Vec<_>>())?;
        }
        object.end()
    }
}
