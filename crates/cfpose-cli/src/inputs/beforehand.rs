//! What is known of theta beforehand: `--bounds NAME=LOW..HIGH[deg],..` and `--prior FILE.json`.

use cfpose::bounds::{Bound, Bounds};
use cfpose::free::{Frame, find_columns};
use cfpose::theta::Layout;
use cfpose::{BuildError, Prior};
use serde_json::Value;

use crate::args::ProblemArgs;
use crate::failure::Failure;
use crate::starts;

/// Read `--bounds`; none without the flag.
///
/// # Errors
/// Usage for what is no interval, unknown names, and bounds without a value between them.
pub fn bounds(args: &ProblemArgs, layout: &Layout) -> Result<Vec<Bound>, Failure> {
    let mut all = Vec::new();
    for text in args.bounds.iter().flatten() {
        let usage = |problem: &str| Failure::usage(format!("--bounds `{text}`: {problem}"));
        let shape = "expected NAME=LOW..HIGH, such as tz=0.5..3 or rz=-30deg..30deg; one end may be left out";
        let (name, interval) = text.split_once('=').ok_or_else(|| usage(shape))?;
        let (low, high) = interval.split_once("..").ok_or_else(|| usage(shape))?;
        if low.trim().is_empty() && high.trim().is_empty() {
            return Err(usage(shape));
        }
        // A unit after the last number counts for both.
        let both = high.trim().ends_with("deg");
        let end = |text: &str, open: f64| match text.trim() {
            "" => Ok(open),
            text => {
                let (number, unit) = match text.strip_suffix("deg") {
                    Some(number) => (number, std::f64::consts::PI / 180.0),
                    None if both => (text, std::f64::consts::PI / 180.0),
                    None => (text, 1.0),
                };
                number
                    .trim()
                    .parse::<f64>()
                    .ok()
                    .filter(|v| v.is_finite())
                    .map(|v| v * unit)
                    .ok_or_else(|| usage(shape))
            }
        };
        let (low, high) = (end(low, f64::NEG_INFINITY)?, end(high, f64::INFINITY)?);
        let words = |error: BuildError| match error {
            BuildError::Data { problem, .. } => usage(&problem),
            other => usage(&other.to_string()),
        };
        let columns = find_columns(layout, &[name.trim()], Frame::Camera).map_err(words)?;
        let mine: Vec<Bound> = columns.into_iter().map(|column| Bound { column, low, high }).collect();
        if interval.contains("deg") && !mine.iter().all(|bound| Bounds::is_angle(layout, bound.column)) {
            return Err(usage("only angles have degrees"));
        }
        Bounds::new(layout, &mine).map_err(words)?;
        all.extend(mine);
    }
    Ok(all)
}

/// Read `--prior`: the theta and the covariance of a file of its own, or of a result of `estimate --json`.
///
/// # Errors
/// Input, with the name of the file.
pub fn prior(args: &ProblemArgs, context: &starts::Context<'_>) -> Result<Option<Prior>, Failure> {
    let Some(path) = &args.prior else { return Ok(None) };
    let fail = |problem: &dyn std::fmt::Display| Failure::input(format!("{}: {problem}", path.display()));
    let text = std::fs::read_to_string(path).map_err(|error| fail(&error))?;
    let value: Value = serde_json::from_str(&text).map_err(|error| fail(&format!("this is no JSON: {error}")))?;
    if value.get("theta").is_none() {
        return Err(fail(&"there is no \"theta\" in it"));
    }
    let covariance = rows(&value).map_err(|problem| fail(&problem))?;
    let theta = starts::from_file(path, context)?.into_iter().next().unwrap_or_default();
    let prior = Prior { theta, covariance };
    prior.check(context.layout).map_err(|error| match error {
        BuildError::Data { problem, .. } => fail(&problem),
        other => fail(&other),
    })?;
    Ok(Some(prior))
}

/// Return the entries of "covariance", row by row.
fn rows(value: &Value) -> Result<Vec<f64>, String> {
    let shape = "\"covariance\" has to be a list of rows of numbers";
    let rows = value.get("covariance").and_then(Value::as_array).ok_or(shape)?;
    let mut all = Vec::new();
    for row in rows {
        let row = row.as_array().ok_or(shape)?;
        if row.len() != rows.len() {
            return Err(format!("a row of \"covariance\" has {} numbers, there are {} rows", row.len(), rows.len()));
        }
        for entry in row {
            let null =
                "\"covariance\" holds null: a direction that was not determined is no prior; give it a large variance";
            all.push(entry.as_f64().ok_or(if entry.is_null() { null } else { shape })?);
        }
    }
    Ok(all)
}
