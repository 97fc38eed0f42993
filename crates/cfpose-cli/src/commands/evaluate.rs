//! `cfpose evaluate`: residual, Jacobian and feature means at one theta.

use std::path::Path;

use cfpose::estimator::{Minimised, NoiseModel};
use cfpose::problem::Evaluation;
use cfpose_lab::Lab;
use cfpose_vision::Fault;
use serde::Serialize;
use serde_json::Value;

use crate::args::{EvaluateArgs, numbers};
use crate::failure::Failure;
use crate::inputs::Loaded;
use crate::output::{self, number};
use crate::{inputs, starts};

/// The JSON object of the contract.
#[derive(Serialize)]
struct Report<'a> {
    theta: Vec<f64>,
    residual: &'a [f64],
    jacobian: Vec<&'a [f64]>,
    source_means: &'a [f64],
    target_means: &'a [f64],
    cost: f64,
    /// What was evaluated.
    model: &'a str,
    features: &'a str,
    normalise: &'a str,
    weighting: &'a str,
    noise: NoiseModel,
    /// Nuisance parameters behind theta: variances of the noise, squared units of the feature space.
    nuisance: &'a [f64],
}

/// Run the command.
///
/// # Errors
/// [`Failure`]; a residual that is not finite is no usable result.
pub fn run(args: &EvaluateArgs, lab: &Lab) -> Result<(), Failure> {
    let mut files = inputs::named(&args.problem);
    files.push(args.at.clone().into());
    output::keep_apart(&files, &[args.problem.json.as_deref()])?;
    for (flag, given) in [("--bounds", args.problem.bounds.is_some()), ("--prior", args.problem.prior.is_some())] {
        if given {
            return Err(Failure::usage(format!("{flag} does not change what is evaluated; leave it out")));
        }
    }
    let result = match numbers(&args.at) {
        Some(_) => None,
        None => Some(read_result(args)?),
    };
    let loaded = inputs::load(&args.problem, &lab.registry)?;
    let (minimised, evaluation) = match (&result, numbers(&args.at)) {
        (Some(value), _) => of_result(args, value, &loaded)?,
        (None, list) => {
            let layout = &loaded.estimator.model().layout;
            let theta = starts::theta(&list.unwrap_or_default(), "--at", layout, loaded.form)?;
            loaded.estimator.evaluate(&theta)?
        }
    };
    show(args, &loaded, &minimised, &evaluation)
}

/// Read the result of an estimate; the parts of its method are its own, so flags that name others are refused.
fn read_result(args: &EvaluateArgs) -> Result<Value, Failure> {
    let path = Path::new(&args.at);
    if !path.exists() {
        let (at, is_path) = (&args.at, args.at.contains(['.', '/']));
        let hint = if is_path { " and no file; give theta, or a result of estimate" } else { "" };
        return Err(Failure::usage(format!("--at `{at}` is no list of numbers{hint}")));
    }
    let problem = &args.problem;
    let named = [
        ("--features", problem.features.is_some()),
        ("--weighting", problem.weighting.is_some()),
        ("--normalise", problem.normalise.is_some()),
        ("--pipeline", problem.pipeline.is_some()),
        ("--free", problem.free.is_some()),
    ];
    if let Some((flag, _)) = named.iter().find(|(_, given)| *given) {
        return Err(Failure::usage(format!("{flag} beside a result, which has its own; leave it out or give numbers")));
    }
    let fail = |error: &dyn std::fmt::Display| Failure::input(format!("{}: {error}", path.display()));
    let text = std::fs::read_to_string(path).map_err(|error| fail(&Fault::from(error)))?;
    serde_json::from_str(&text).map_err(|error| fail(&format!("this is no result of estimate: {error}")))
}

/// Evaluate what an estimate minimised last.
fn of_result(args: &EvaluateArgs, value: &Value, loaded: &Loaded) -> Result<(Minimised, Evaluation), Failure> {
    let fail = |problem: String| Failure::input(format!("{}: {problem}", args.at));
    if let Some(model) = value.get("model").and_then(Value::as_str)
        && model != args.problem.model
    {
        let given = &args.problem.model;
        return Err(fail(format!("this is a result of model `{model}`, not of `{given}`; give --model '{model}'")));
    }
    let minimised = value.get("minimised").ok_or_else(|| {
        fail("there is no \"minimised\" in it; give a result that `cfpose estimate --json` wrote".to_string())
    })?;
    let minimised: Minimised =
        serde_json::from_value(minimised.clone()).map_err(|error| fail(format!("\"minimised\": {error}")))?;
    let evaluation = loaded.estimator.evaluate_minimised(&minimised).map_err(|error| fail(error.to_string()))?;
    Ok((minimised, evaluation))
}

/// Print the table, write the JSON, and say whether the residual is finite.
fn show(args: &EvaluateArgs, loaded: &Loaded, minimised: &Minimised, evaluation: &Evaluation) -> Result<(), Failure> {
    let layout = &loaded.estimator.model().layout;
    let own = cfpose_optim::Manifold::ambient(layout.manifold());
    let width = evaluation.jacobian.len() / evaluation.residual.len().max(1);
    let stage = &minimised.stage;
    let report = Report {
        theta: layout.to_list(&minimised.theta[..own], loaded.form),
        residual: &evaluation.residual,
        jacobian: evaluation.jacobian.chunks(width.max(1)).collect(),
        source_means: &evaluation.source_means,
        target_means: &evaluation.target_means,
        cost: evaluation.cost,
        model: stage.model.as_deref().unwrap_or(&args.problem.model),
        features: &stage.features,
        normalise: stage.normaliser.as_deref().unwrap_or("paper"),
        weighting: &stage.weighting,
        noise: stage.noise,
        nuisance: &minimised.theta[own..],
    };
    let json = args.problem.json.as_deref();
    if !output::is_standard(json) {
        output::print(&table(&report, &columns(loaded, minimised, width)))?;
    }
    output::write_json(&report, json)?;
    if evaluation.cost.is_finite() {
        return Ok(());
    }
    Err(Failure::unusable("the residual at this theta is not finite; some point is mapped to infinity"))
}

/// Name the columns of the Jacobian: the free parameters, then the noise.
fn columns(loaded: &Loaded, minimised: &Minimised, width: usize) -> Vec<String> {
    let all = cfpose::free::columns(&loaded.estimator.model().layout);
    let mut names: Vec<String> = match &minimised.free {
        Some(free) => free.iter().filter_map(|j| all.get(*j)).map(|column| column.name.clone()).collect(),
        None => all.into_iter().map(|column| column.name).collect(),
    };
    let own = names.len();
    names.extend((own..width).map(|j| format!("noise_{}", j + 1 - own)));
    names
}

/// Write one row a feature.
fn table(report: &Report<'_>, columns: &[String]) -> String {
    let mut header = vec!["feature", "source mean", "target mean", "residual"];
    header.extend(columns.iter().map(String::as_str));
    let mut rows = Vec::new();
    for (i, residual) in report.residual.iter().enumerate() {
        let mean = |means: &[f64]| means.get(i).map_or_else(|| "-".to_string(), |value| number(*value));
        let mut row =
            vec![(i + 1).to_string(), mean(report.source_means), mean(report.target_means), number(*residual)];
        row.extend(report.jacobian.get(i).into_iter().flat_map(|line| line.iter().map(|value| number(*value))));
        rows.push(row);
    }
    format!(
        "{}\ncost {} ({}, {}, {})",
        output::table(&header, &rows),
        number(report.cost),
        report.model,
        report.features,
        report.weighting
    )
}
