//! What `--start` and `--at` may hold: a strategy, numbers, or a file of either thetas or poses.

use std::path::Path;

use cfpose::entry::{NamedEntry, find, parse_spec, suggest};
use cfpose::theta::{Layout, RotationForm};
use cfpose::{Registry, Start};
use cfpose_vision::Fault;

use crate::args::numbers;
use crate::failure::Failure;

/// What a theta in a file has to fit.
pub struct Context<'a> {
    /// Model as the user wrote it.
    pub model: &'a str,
    /// Layout of its theta.
    pub layout: &'a Layout,
    /// How rotations stand in lists of numbers where a file does not say.
    pub form: RotationForm,
    /// Depth of the plane.
    pub depth: Option<f64>,
}

/// Read `--start`; `None` for the word that leaves it to the preset.
///
/// # Errors
/// Usage for what is neither a strategy nor numbers nor a file, and for numbers that are no theta; input for a file that
/// holds none.
pub fn parse(text: &str, context: &Context<'_>, registry: &Registry) -> Result<Option<Start>, Failure> {
    let text = text.trim();
    if text == "auto" {
        return Ok(None);
    }
    if let Some(list) = numbers(text) {
        return Ok(Some(Start::Given(vec![theta(&list, "--start", context.layout, context.form)?])));
    }
    let name = parse_spec(text).map(|(name, _)| name).unwrap_or_default();
    if registry.starts.iter().any(|entry| entry.name() == name) {
        find("start", &registry.starts, text)?;
        registry.start(text)?;
        return Ok(Some(Start::Named(text.to_string())));
    }
    let path = Path::new(text);
    // A word without dot or slash that names no file is a mistyped strategy, not a missing file.
    if path.exists() || text.contains(['.', '/']) {
        return Ok(Some(Start::Given(from_file(path, context)?)));
    }
    let known = registry.starts.iter().map(|entry| entry.name()).chain(["auto"]);
    let near = suggest(text, known);
    let hint = if near.is_empty() { String::new() } else { format!("; did you mean {}?", near.join(" or ")) };
    Err(Failure::usage(format!(
        "--start `{text}` is no strategy (`cfpose list starts`), no list of numbers and no file{hint}"
    )))
}

/// Read the numbers of one theta.
///
/// # Errors
/// Usage, for what is no list of numbers or no theta of this layout.
pub fn theta(list: &[f64], flag: &str, layout: &Layout, form: RotationForm) -> Result<Vec<f64>, Failure> {
    layout.from_list(list, form).map_err(|error| Failure::usage(format!("{flag}: {error}")))
}

/// Read thetas from a file: a result of `estimate`, poses in any form of `pose convert`, one theta a line, or one theta.
///
/// # Errors
/// Input for a file that holds none.
pub fn from_file(path: &Path, context: &Context<'_>) -> Result<Vec<Vec<f64>>, Failure> {
    let Context { layout, form, depth, .. } = *context;
    let text = std::fs::read_to_string(path).map_err(|error| fail(path, &Fault::from(error)))?;
    let text = text.strip_prefix('\u{feff}').unwrap_or(&text);
    if let Ok(value) = serde_json::from_str::<serde_json::Value>(text)
        && let Some(theta) = value.get("theta")
    {
        let form = form_of_result(&value, context).map_err(|problem| fail(path, &problem))?;
        let list: Vec<f64> =
            serde_json::from_value(theta.clone()).map_err(|_| fail(path, &"\"theta\" is no list of numbers"))?;
        return Ok(vec![layout.from_list(&list, form).map_err(|error| fail(path, &error))?]);
    }
    let expected = layout.list_len(form);
    let content = |line: &str| line.split('#').next().unwrap_or("").trim().to_string();
    let lines: Vec<String> = text.lines().map(content).filter(|line| !line.is_empty()).collect();
    let rows: Option<Vec<Vec<f64>>> = lines.iter().map(|line| numbers(line)).collect();
    if let Some(rows) = rows {
        if !rows.is_empty() && rows.iter().all(|row| row.len() == expected) {
            return rows.iter().map(|row| layout.from_list(row, form).map_err(|error| fail(path, &error))).collect();
        }
        let all: Vec<f64> = rows.concat();
        let is_pose = lines.len() > 2 || [8, 12, 16].contains(&all.len());
        if all.len() == expected || !is_pose || layout.range("rotation").is_none() {
            return Ok(vec![layout.from_list(&all, form).map_err(|error| fail(path, &error))?]);
        }
    }
    let poses = cfpose_vision::read_poses(path)?;
    let scale = depth.map_or(1.0, f64::recip);
    let theta = |pose: &cfpose_vision::StampedPose| pose.theta(layout, scale);
    let thetas: Option<Vec<Vec<f64>>> = poses.iter().map(theta).collect();
    thetas.ok_or_else(|| fail(path, &format!("a pose is no start of this model; give {}", layout.describe(form))))
}

/// Check that a result is one of this model and return the form of its rotations.
fn form_of_result(result: &serde_json::Value, context: &Context<'_>) -> Result<RotationForm, String> {
    let name = |spec: &str| parse_spec(spec).map_or_else(|_| spec.to_string(), |(name, _)| name);
    if let Some(model) = result.get("model").and_then(serde_json::Value::as_str)
        && name(model) != name(context.model)
    {
        return Err(format!("this is a result of model `{model}`, not of `{}`; give numbers or a pose", context.model));
    }
    match result.get("rotation_form") {
        None => Ok(context.form),
        Some(form) => {
            let parsed = form.as_str().and_then(|text| text.parse().ok());
            parsed.ok_or_else(|| format!("\"rotation_form\" is {form}; it is vector, euler, euler-ORDER or quaternion"))
        }
    }
}

fn fail(path: &Path, problem: &dyn std::fmt::Display) -> Failure {
    Failure::input(format!("{}: {problem}", path.display()))
}
