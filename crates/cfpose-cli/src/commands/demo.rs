//! `cfpose demo`: simulate, estimate, print a table, draw an overlay; offline and from a seed.

use std::path::Path;
use std::time::Instant;

use cfpose::entry::find;
use cfpose::theta::{Layout, RotationForm};
use cfpose::{Error, Estimate, Execution, PoseError, Prepared, Start, Supervision};
use cfpose_lab::method::Method;
use cfpose_lab::plot::{Panel, image_coordinates, overlay};
use cfpose_lab::{Lab, Scenario, Trial, seed};
use cfpose_vision::write_points;
use serde_json::json;

use crate::args::DemoArgs;
use crate::failure::Failure;
use crate::output;

/// Start strategies to try, most specific first, where a scenario gives no start.
const STRATEGIES: [&str; 2] = ["pca", "grid"];

/// Run the command.
///
/// # Errors
/// [`Failure`] of the scenario's name or of the folder; an estimate that is off is a run without a usable result.
pub fn run(args: &DemoArgs) -> Result<(), Failure> {
    let begun = Instant::now();
    let lab = Lab::default();
    let (entry, parameters) = find("scenario", &lab.scenarios, &args.scenario)?;
    let mut scenario = (entry.build)(&parameters)?;
    scenario.load(Path::new("")).map_err(Failure::input)?;
    let trial = scenario.trial(&mut seed::data_stream(args.seed, 0)).map_err(Failure::usage)?;
    let prepared = prepare(&lab, scenario.model(), &trial, args.seed)?;
    // Of several starts the first stands for all in table and figure.
    let start = prepared.starts.first().unwrap_or(&prepared.model.identity).clone();
    let estimate = prepared.solve(&lab.registry, Supervision::default())?;
    let errors = [&start, &estimate.theta].map(|theta| error(scenario.as_ref(), &prepared, theta, &trial));
    write_folder(&args.out, &prepared, &trial, &start, &estimate)?;
    let found = estimate.usable() && errors[1].is_some_and(|error| trial.success.holds(&error));
    let json = args.json.as_deref();
    output::show(&text(args, &prepared, &trial, &start, &estimate, &errors, begun.elapsed().as_secs_f64()), json)?;
    let list = |theta: &[f64]| prepared.model.layout.to_list(theta, RotationForm::Vector);
    let value = json!({
        "scenario": args.scenario,
        "model": scenario.model(),
        "seed": args.seed,
        "truth": list(&trial.truth),
        "start": list(&start),
        "theta": list(&estimate.theta),
        "rotation_form": RotationForm::Vector.name(),
        "status": estimate.outcome.status.name(),
        "rotation_error_deg": errors[1].map(|error| error.angle.to_degrees()),
        "translation_error": errors[1].map(|error| error.translation),
        "success": found,
        "seconds": begun.elapsed().as_secs_f64(),
        "out": args.out,
    });
    output::write_json(&value, json)?;
    if found { Ok(()) } else { Err(Failure::unusable("the estimate is not near the truth; no start was near enough")) }
}

/// Build the printed method's problem; where the scenario gives no start, with the first strategy that its model has.
fn prepare(lab: &Lab, model: &str, trial: &Trial, seed: u64) -> Result<Prepared, Failure> {
    let paper = Method::of_preset("paper");
    let attempt = |method: &Method| {
        let settings = method.settings(model, trial.start.as_deref(), seed)?;
        Prepared::new(&lab.registry, &settings, &trial.source, &trial.target, &Execution::default())
    };
    if trial.start.is_none() {
        for name in STRATEGIES {
            match attempt(&Method { start: name.to_string(), ..paper.clone() }) {
                Err(Error::Unsupported(_)) => {}
                done => return Ok(done?),
            }
        }
    }
    Ok(attempt(&paper)?)
}

fn error(scenario: &dyn Scenario, prepared: &Prepared, theta: &[f64], trial: &Trial) -> Option<PoseError> {
    scenario.error(&prepared.model.layout, theta, &trial.truth)
}

/// Write the overlay and the points, so that `estimate` can be tried on them.
fn write_folder(
    out: &Path,
    prepared: &Prepared,
    trial: &Trial,
    start: &[f64],
    estimate: &Estimate,
) -> Result<(), Failure> {
    let panel = |title: &str, theta: &[f64]| {
        let moved = prepared.problem.mapped_source(theta);
        let moved = moved.map_err(|error| Failure::unusable(format!("{title}: moved points: {error}")))?;
        Ok::<Panel, Failure>(Panel {
            title: title.to_string(),
            moved: image_coordinates(&moved),
            target: image_coordinates(&trial.target),
        })
    };
    let panels = [panel("at the start", start)?, panel("at the estimate", &estimate.theta)?];
    let figure = overlay("Two point sets of one shape, no correspondences", &panels)?;
    std::fs::create_dir_all(out).map_err(|error| Failure::input(format!("{}: {error}", out.display())))?;
    output::write_file(&out.join("overlay.svg"), &figure)?;
    write_points(&out.join("source.csv"), &trial.source)?;
    Ok(write_points(&out.join("target.csv"), &trial.target)?)
}

fn text(
    args: &DemoArgs,
    prepared: &Prepared,
    trial: &Trial,
    start: &[f64],
    estimate: &Estimate,
    errors: &[Option<PoseError>; 2],
    seconds: f64,
) -> String {
    let layout = &prepared.model.layout;
    let names = layout.list_names(RotationForm::Vector);
    let mut header = vec![""];
    header.extend(names.iter().map(String::as_str));
    header.extend(["angle off (deg)", "translation off"]);
    let rows = [
        row("truth", layout, &trial.truth, None),
        row("start", layout, start, errors[0]),
        row("estimate", layout, &estimate.theta, errors[1]),
    ];
    let out = args.out.display();
    format!(
        "{} against {} points, seed {}, model {}, method paper\n\n{}\n\n\
         {} after {} iterations, {seconds:.2} s in all\n\
         look at {}\n\
         try     cfpose estimate --preset paper --model {} --source {out}/source.csv --target {out}/target.csv {}",
        trial.source.len(),
        trial.target.len(),
        args.seed,
        prepared.settings().model,
        output::table(&header, &rows),
        estimate.outcome.status.name(),
        estimate.iterations,
        args.out.join("overlay.svg").display(),
        prepared.settings().model,
        start_flag(prepared, layout),
    )
}

/// Return `--start` as it would be written in a shell.
fn start_flag(prepared: &Prepared, layout: &Layout) -> String {
    match &prepared.settings().start {
        Start::Named(name) => format!("--start '{name}'"),
        Start::Given(thetas) => {
            let list = thetas.first().map(|theta| layout.to_list(theta, RotationForm::Vector)).unwrap_or_default();
            let numbers: Vec<String> = list.iter().map(|value| format!("{value:.6}")).collect();
            format!("--start={}", numbers.join(","))
        }
    }
}

fn row(name: &str, layout: &Layout, theta: &[f64], error: Option<PoseError>) -> Vec<String> {
    let mut row = vec![name.to_string()];
    row.extend(layout.to_list(theta, RotationForm::Vector).iter().map(|value| format!("{value:.4}")));
    let parts = error.map(|error| [error.angle.to_degrees(), error.translation]);
    row.extend(parts.into_iter().flatten().map(|value| format!("{value:.4}")));
    row
}
