//! `cfpose demo`: simulate, estimate by the printed method and by `auto`, print a table, draw an overlay with error ellipses;
//! offline and from a seed.

mod picture;

use std::path::Path;
use std::time::Instant;

use cfpose::entry::find;
use cfpose::theta::{Layout, RotationForm};
use cfpose::{Error, Estimate, Estimator, Execution, PoseError, Start, Supervision, Verdict};
use cfpose_lab::calibration::expected_error;
use cfpose_lab::method::Method;
use cfpose_lab::plot::{Panel, ellipses, enlargement, overlay, panels};
use cfpose_lab::{Lab, Scenario, Trial, seed};
use cfpose_vision::write_points;
use serde_json::{Value, json};

use crate::args::{DemoArgs, program};
use crate::failure::Failure;
use crate::inputs;
use crate::output::{self, number};

/// Methods that are compared; the last one is the result.
const METHODS: [&str; 2] = ["paper", "auto"];

/// Start strategies of `paper` to try, most specific first, where a scenario gives no start.
const STRATEGIES: [&str; 2] = ["pca", "grid"];

/// One method on the simulated data.
struct Attempt {
    method: &'static str,
    estimator: Estimator,
    estimate: Estimate,
    /// Against the truth.
    error: Option<PoseError>,
    /// What the covariance lets expect, root mean squares; none where the method has no covariance.
    expected: Option<PoseError>,
    seconds: f64,
}

/// Run the command.
///
/// # Errors
/// [`Failure`] of the scenario's name or of the folder; an estimate that is off is a run without a usable result.
pub fn run(args: &DemoArgs, lab: &Lab) -> Result<(), Failure> {
    let begun = Instant::now();
    let own = ["overlay.svg", "source.csv", "target.csv"].into_iter().chain(picture::FILES);
    let own: Vec<_> = own.map(|name| args.out.join(name)).collect();
    output::keep_apart(&own, &[args.json.as_deref()])?;
    let (entry, parameters) = find("scenario", &lab.scenarios, &args.scenario)?;
    let mut scenario = (entry.build)(&parameters)?;
    scenario.load(Path::new("")).map_err(Failure::input)?;
    let drawn = scenario.trial(&mut seed::data_stream(args.seed, 0)).map_err(Failure::usage)?;
    let trial = through_files(&args.out, drawn)?;
    let [paper, auto] = METHODS.map(|method| attempt(lab, scenario.as_ref(), &trial, method, args.seed));
    let attempts = [paper?, auto?];
    let [paper, auto] = &attempts;
    // Of several starts the first stands for all in table and figure; `auto` finds its own where the scenario gives none.
    let start =
        paper.estimator.starts()?.into_iter().next().unwrap_or_else(|| paper.estimator.model().identity.clone());
    write_figure(&args.out, &attempts, &start)?;
    let found = auto.estimate.usable() && auto.error.is_some_and(|error| trial.success.holds(&error));
    let start_error = scenario.error(&paper.estimator.model().layout, &start, &trial.truth);
    let image = picture::show(&args.out, args.seed, lab)?;
    let seconds = begun.elapsed().as_secs_f64();
    let json = args.json.as_deref();
    let points = text(args, &attempts, &trial, (&start, start_error), seconds);
    output::show(&format!("{points}\n\n{}", image.text), json)?;
    let list = |theta: &[f64]| auto.estimator.model().layout.to_list(theta, RotationForm::Vector);
    let value = json!({
        "scenario": args.scenario,
        "model": scenario.model(),
        "seed": args.seed,
        "truth": list(&trial.truth),
        "start": list(&start),
        "theta": list(&auto.estimate.theta),
        "rotation_form": RotationForm::Vector.name(),
        "status": auto.estimate.outcome.status.name(),
        "rotation_error_deg": auto.error.map(|error| error.angle.to_degrees()),
        "translation_error": auto.error.map(|error| error.translation),
        "success": found,
        "verdict": auto.estimate.verdict.map(Verdict::name),
        "methods": attempts.iter().map(Attempt::json).collect::<Vec<_>>(),
        "image": image.value,
        "seconds": seconds,
        "out": args.out,
    });
    output::write_json(&value, json)?;
    if !image.found {
        return Err(Failure::unusable("the pose of the rendered image is not near the truth"));
    }
    if found { Ok(()) } else { Err(Failure::unusable("the estimate is not near the truth; no start was near enough")) }
}

/// Solve by one method.
fn attempt(
    lab: &Lab,
    scenario: &dyn Scenario,
    trial: &Trial,
    method: &'static str,
    seed: u64,
) -> Result<Attempt, Failure> {
    let begun = Instant::now();
    let estimator = prepare(lab, scenario.model(), trial, method, seed)?;
    let estimate = estimator.solve(Supervision::default())?;
    let layout = &estimator.model().layout;
    let error = scenario.error(layout, &estimate.theta, &trial.truth);
    let expected = estimate.statistics.as_ref().and_then(|s| expected_error(layout, &s.covariance));
    Ok(Attempt { method, error, expected, estimate, seconds: begun.elapsed().as_secs_f64(), estimator })
}

/// Build a method's problem; where the scenario gives no start `paper` takes the first strategy that its model has.
fn prepare(lab: &Lab, model: &str, trial: &Trial, method: &str, seed: u64) -> Result<Estimator, Failure> {
    let preset = Method::of_preset(method);
    let attempt = |method: &Method| {
        let settings = method.settings(model, trial.start.as_deref(), seed)?;
        let estimator = Estimator::new(&lab.registry, &settings, &trial.source, &trial.target, &Execution::default())?;
        // A strategy that does not apply says so before any solve.
        estimator.starts()?;
        Ok(estimator)
    };
    if trial.start.is_none() && method == "paper" {
        for name in STRATEGIES {
            match attempt(&Method { start: name.to_string(), ..preset.clone() }) {
                Err(Error::Unsupported(_) | Error::Data { .. }) => {}
                done => return Ok(done?),
            }
        }
    }
    Ok(attempt(&preset)?)
}

impl Attempt {
    /// Describe the attempt as one object of the JSON output.
    fn json(&self) -> Value {
        let statistics = self.estimate.statistics.as_ref();
        json!({
            "method": self.method,
            "theta": self.estimator.model().layout.to_list(&self.estimate.theta, RotationForm::Vector),
            "rotation_error_deg": self.error.map(|error| error.angle.to_degrees()),
            "translation_error": self.error.map(|error| error.translation),
            "rotation_sd_deg": self.expected.map(|error| error.angle.to_degrees()),
            "translation_sd": self.expected.map(|error| error.translation),
            "verdict": self.estimate.verdict.map(Verdict::name),
            "noise_sigma": statistics.and_then(|s| s.noise_sigma),
            "p_value": statistics.map(|s| s.p_value),
            "seconds": self.seconds,
        })
    }

    /// Make the panel of the figure, with error ellipses where there is a covariance.
    fn panel(&self) -> Result<Panel, Failure> {
        let theta = &self.estimate.theta;
        let moved = |error| Failure::unusable(format!("{}: moved points: {error}", self.method));
        let made = panels(&self.estimator, &[(self.method, theta)]).map_err(moved)?;
        let mut panel = made.into_iter().next().unwrap_or_default();
        if let Some(statistics) = &self.estimate.statistics {
            panel.ellipses = ellipses(&self.estimator, theta, &statistics.covariance).map_err(moved)?;
        }
        panel.title = match self.estimate.verdict {
            Some(verdict) => format!("{}: {}", self.method, verdict.name()),
            None => format!("{}: no test of the fit", self.method),
        };
        Ok(panel)
    }
}

/// Write the points and take what stands in the files, so that `estimate` finds the same theta in them: a scenario may know more
/// of its points than a file can hold, such as that they follow a curve.
fn through_files(out: &Path, trial: Trial) -> Result<Trial, Failure> {
    std::fs::create_dir_all(out).map_err(|error| Failure::input(format!("{}: {error}", out.display())))?;
    let (source, target) = (out.join("source.csv"), out.join("target.csv"));
    write_points(&source, &trial.source)?;
    write_points(&target, &trial.target)?;
    Ok(Trial { source: inputs::read(&source)?, target: inputs::read(&target)?, ..trial })
}

/// Draw source and target at the start and after each method.
fn write_figure(out: &Path, attempts: &[Attempt; 2], start: &[f64]) -> Result<(), Failure> {
    let moved = |error| Failure::unusable(format!("at the start: moved points: {error}"));
    let mut all = panels(&attempts[0].estimator, &[("at the start", start)]).map_err(moved)?;
    for attempt in attempts {
        all.push(attempt.panel()?);
    }
    let factor = enlargement(&all);
    if factor > 1.0 {
        let with_ellipses = all.iter_mut().filter(|panel| !panel.ellipses.is_empty());
        with_ellipses.for_each(|panel| panel.title += &format!(", 95 % ellipses enlarged x {factor}"));
    }
    let figure = overlay("Two point sets of one shape, no correspondences", &all)?;
    output::write_file(&out.join("overlay.svg"), &figure)
}

/// Write the table and where to go next.
fn text(
    args: &DemoArgs,
    attempts: &[Attempt; 2],
    trial: &Trial,
    (start, start_error): (&[f64], Option<PoseError>),
    seconds: f64,
) -> String {
    let auto = &attempts[1];
    let (layout, out) = (&auto.estimator.model().layout, args.out.display());
    let names = layout.list_names(RotationForm::Vector);
    let mut header = vec![""];
    header.extend(names.iter().map(String::as_str));
    header.extend(["angle off (deg)", "sd", "translation off", "sd", "verdict", "seconds"]);
    let mut rows = vec![row("truth", layout, &trial.truth), row("start", layout, start)];
    rows[1].extend(parts(start_error, None));
    for attempt in attempts {
        let mut line = row(attempt.method, layout, &attempt.estimate.theta);
        line.extend(parts(attempt.error, attempt.expected));
        let verdict = attempt.estimate.verdict.map_or("-", Verdict::name);
        line.extend([verdict.to_string(), format!("{:.2}", attempt.seconds)]);
        rows.push(line);
    }
    format!(
        "{} against {} points, seed {}, model {}\n\n{}\n\n\
         sd: what the estimate itself expects its error to be (root mean square); paper has none and no test of its fit\n\
         {}\n\
         {seconds:.2} s in all\n\
         look at {}\n\
         try     {} estimate --model {} --source {out}/source.csv --target {out}/target.csv --seed {} {}",
        trial.source.len(),
        trial.target.len(),
        args.seed,
        auto.estimator.settings().model,
        output::table(&header, &rows),
        statistic(auto),
        args.out.join("overlay.svg").display(),
        program(),
        auto.estimator.settings().model,
        args.seed,
        start_flag(&auto.estimator, layout),
    )
}

/// Say in one line what the test of the fit found.
fn statistic(auto: &Attempt) -> String {
    let Some(statistics) = &auto.estimate.statistics else { return "auto: no statistic".to_string() };
    let noise = statistics.noise_sigma.map_or_else(String::new, |sigma| format!("noise {}, ", number(sigma)));
    format!(
        "auto: {noise}J {} with {} degrees of freedom, p = {}",
        number(statistics.j_statistic),
        statistics.degrees_of_freedom,
        number(statistics.p_value)
    )
}

/// Return `--start` as it would be written in a shell.
fn start_flag(estimator: &Estimator, layout: &Layout) -> String {
    match &estimator.settings().start {
        None => String::new(),
        Some(Start::Named(name)) => format!("--start '{name}'"),
        Some(Start::Given(thetas)) => {
            let list = thetas.first().map(|theta| layout.to_list(theta, RotationForm::Vector)).unwrap_or_default();
            let numbers: Vec<String> = list.iter().map(|value| format!("{value:.6}")).collect();
            format!("--start={}", numbers.join(","))
        }
    }
}

fn row(name: &str, layout: &Layout, theta: &[f64]) -> Vec<String> {
    let mut row = vec![name.to_string()];
    row.extend(layout.to_list(theta, RotationForm::Vector).iter().map(|value| format!("{value:.4}")));
    row
}

/// Return error and expected error of the angle in degrees, then of the translation.
fn parts(error: Option<PoseError>, expected: Option<PoseError>) -> [String; 4] {
    let cell = |value: Option<f64>| value.map_or_else(|| "-".to_string(), |value| format!("{value:.4}"));
    let degrees = |error: Option<PoseError>| cell(error.map(|error| error.angle.to_degrees()));
    let length = |error: Option<PoseError>| cell(error.map(|error| error.translation));
    [degrees(error), degrees(expected), length(error), length(expected)]
}
