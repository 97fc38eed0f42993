//! Rows of numbers as text, both ways.

use cfpose::Points;

use crate::error::{Fault, excerpt};
use crate::scalar::Scalar;

/// Parse one field.
pub(crate) fn number(field: &str, column: &str) -> Result<f64, Fault> {
    field.parse().map_err(|_| {
        let hint = if field.is_empty() {
            "; fill it in or remove the row"
        } else if field.contains(',') {
            "; write decimals with a point"
        } else {
            "; a comment starts with #"
        };
        Fault::NotANumber { column: column.to_string(), text: excerpt(field), hint }
    })
}

/// Parse one field of a type that a header gives.
pub(crate) fn typed(field: &str, column: &str, scalar: Scalar) -> Result<f64, Fault> {
    let value = number(field, column)?;
    let outside = || Fault::OutsideType { column: column.to_string(), text: excerpt(field), kind: scalar.name() };
    if scalar.holds(value) { Ok(value) } else { Err(outside()) }
}

/// Return the names of the columns to write: the coordinates, then `w` if the weights differ from 1.
pub(crate) fn column_names(points: &Points) -> Vec<&'static str> {
    let mut names = vec!["x", "y", "z"];
    names.truncate(points.dim());
    if !points.is_uniform() {
        names.push("w");
    }
    names
}

/// Write one row a line, the columns of [`column_names`] with a separator between them, in the shortest decimal that
/// reads back to the same bits.
pub(crate) fn rows(points: &Points, separator: &str, prefix: &str) -> String {
    let mut text = String::new();
    for k in 0..points.len() {
        let mut values: Vec<f64> = points.point(k)[..points.dim()].to_vec();
        if !points.is_uniform() {
            values.push(points.weights()[k]);
        }
        let fields: Vec<String> = values.iter().map(|value| format!("{value:?}")).collect();
        text.push_str(prefix);
        text.push_str(&fields.join(separator));
        text.push('\n');
    }
    text
}
