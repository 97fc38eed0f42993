//! What is known of theta beforehand: `--bounds NAME=LOW..HIGH[deg],..` and `--prior FILE.json`.

use cfpose::bounds::{Bound, Bounds};
use cfpose::free::{Frame, find_columns};
use cfpose::theta::Layout;
use cfpose::{BuildError, Prior};
use cfpose_lab::method::known::PriorFile;
use cfpose_vision::Fault;

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
    let text = std::fs::read_to_string(path).map_err(|error| fail(&Fault::from(error)))?;
    let prior = PriorFile::read(&text).map_err(|problem| fail(&problem))?;
    prior.resolve(context.layout, context.model, context.form).map(Some).map_err(|problem| fail(&problem))
}
