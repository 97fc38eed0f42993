//! `cfpose evaluate`: residual, Jacobian and feature means at one theta.

use cfpose_lab::Lab;
use serde::Serialize;

use crate::args::{EvaluateArgs, numbers};
use crate::failure::Failure;
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
}

/// Run the command.
///
/// # Errors
/// [`Failure`]; a residual that is not finite is no usable result.
pub fn run(args: &EvaluateArgs, lab: &Lab) -> Result<(), Failure> {
    let no_list = || Failure::usage(format!("--at `{}` is no list of numbers", args.at));
    let list = numbers(&args.at).ok_or_else(no_list)?;
    let loaded = inputs::load(&args.problem, &lab.registry)?;
    let theta = starts::theta(&list, "--at", &loaded.prepared.model.layout, loaded.form)?;
    let evaluation = loaded.prepared.evaluate(&theta);
    let width = loaded.prepared.num_unknowns();
    let report = Report {
        theta: loaded.prepared.model.layout.to_list(&theta, loaded.form),
        residual: &evaluation.residual,
        jacobian: evaluation.jacobian.chunks(width.max(1)).collect(),
        source_means: &evaluation.source_means,
        target_means: &evaluation.target_means,
        cost: evaluation.cost,
    };
    let json = args.problem.json.as_deref();
    if !output::is_standard(json) {
        output::print(&table(&report, &loaded.free))?;
    }
    output::write_json(&report, json)?;
    if evaluation.cost.is_finite() {
        return Ok(());
    }
    Err(Failure::unusable("the residual at this theta is not finite; some point is mapped to infinity"))
}

/// Write one row a feature.
fn table(report: &Report<'_>, free: &[String]) -> String {
    let mut header = vec!["feature", "source mean", "target mean", "residual"];
    header.extend(free.iter().map(String::as_str));
    let mut rows = Vec::new();
    for (i, residual) in report.residual.iter().enumerate() {
        let mean = |means: &[f64]| means.get(i).map_or_else(|| "-".to_string(), |value| number(*value));
        let mut row =
            vec![(i + 1).to_string(), mean(report.source_means), mean(report.target_means), number(*residual)];
        row.extend(report.jacobian.get(i).into_iter().flat_map(|line| line.iter().map(|value| number(*value))));
        rows.push(row);
    }
    format!("{}\ncost {}", output::table(&header, &rows), number(report.cost))
}
