//! `cfpose estimate`: two point files, or the moments of two, to theta.

mod from_moments;

use std::path::Path;
use std::time::Instant;

use cfpose::distances::MAX_ASSIGNED;
use cfpose::{Estimate, Points, Pose, Supervision};
use cfpose_lab::Lab;
use cfpose_lab::plot::{of_estimate, overlay, overlay_png, panels};
use cfpose_vision::{Camera, PoseFormat, StampedPose, write_points};

use crate::args::{EstimateArgs, Matching};
use crate::failure::{Failure, Kind};
use crate::inputs::{self, Loaded};
use crate::output;
use crate::progress::Watch;
use crate::report::{Asked, PoseReport, Report};
use crate::signals::Signals;

/// Source sets smaller than this get their correspondence reported without being asked.
const SMALL: usize = 1000;

/// Run the command.
///
/// # Errors
/// [`Failure`]; a run without a usable result fails after its JSON is written, and writes neither pose nor points.
pub fn run(args: &EstimateArgs, lab: &Lab) -> Result<(), Failure> {
    let begun = Instant::now();
    let outputs = [&args.problem.json, &args.pose_out, &args.transformed_out, &args.plot];
    let outputs = outputs.map(|path| path.as_deref());
    output::keep_apart(&inputs::named(&args.problem), &outputs)?;
    if args.problem.source_moments.is_some() {
        return from_moments::run(args, lab, begun);
    }
    let loaded = inputs::load(&args.problem, &lab.registry)?;
    check_outputs(args, &loaded)?;
    let signals = Signals::watch();
    let mut watch = Watch::new(args.verbose);
    let supervision = Supervision { observer: Some(&mut watch), cancel: Some(signals.flag()), deadline: args.deadline };
    let estimate = loaded
        .estimator
        .solve(supervision)
        .map_err(|error| inputs::name_file(error, &args.problem, loaded.estimator.target()))?;
    drop(watch);
    let correspondence = correspondence(args, &loaded, &estimate);
    let asked = Asked::of(&loaded, &estimate);
    let report = Report::new(&args.problem, &asked, &estimate, correspondence, begun.elapsed().as_secs_f64());
    let json = args.problem.json.as_deref();
    output::show(&report.table(&asked, &estimate), json)?;
    output::write_json(&report, json)?;
    if let Some(path) = &args.plot {
        plot(path, args, &loaded, &estimate)?;
    }
    if estimate.usable() {
        write_outputs(args, &loaded, &estimate)?;
    }
    ended(&signals, &estimate)
}

/// Say how it ended where there is no usable result or a signal stopped it.
fn ended(signals: &Signals, estimate: &Estimate) -> Result<(), Failure> {
    if let Some((code, name)) = signals.caught() {
        let text = format!("stopped by {name}: what is printed is the best so far");
        return Err(Failure { kind: Kind::Stopped(code), ..Failure::unusable(text) });
    }
    if estimate.usable() {
        return Ok(());
    }
    let (status, message) = (estimate.outcome.status.name(), &estimate.outcome.message);
    Err(Failure::unusable(format!("no usable result: {status}: {message}")))
}

/// Read off who corresponds to whom; a theta that maps points to infinity has no correspondence, and its status says so.
fn correspondence(args: &EstimateArgs, loaded: &Loaded, estimate: &Estimate) -> Option<Vec<Option<usize>>> {
    match args.correspondence {
        None if loaded.num_source >= SMALL => None,
        Some(Matching::OneToOne) => {
            loaded.estimator.matches(&estimate.theta, None).ok().map(|matches| matches.target_of_source)
        }
        _ => {
            let nearest = loaded.estimator.correspondence(&estimate.theta).ok()?;
            Some(nearest.into_iter().map(Some).collect())
        }
    }
}

/// Refuse outputs that the model does not have, before any work is done.
fn check_outputs(args: &EstimateArgs, loaded: &Loaded) -> Result<(), Failure> {
    let (model, name) = (loaded.estimator.model(), &args.problem.model);
    let num_points = loaded.num_source.max(loaded.num_target);
    if args.correspondence == Some(Matching::OneToOne) && num_points > MAX_ASSIGNED {
        return Err(Failure::usage(format!(
            "--correspondence=one-to-one takes up to {MAX_ASSIGNED} points, the larger file has {num_points}; use --correspondence"
        )));
    }
    if args.pose_out.is_some() && PoseReport::of(&model.layout, &model.identity, None).is_none() {
        return Err(Failure::usage(format!("--pose-out: model `{name}` has no pose; use --json")));
    }
    if let Some(path) = &args.transformed_out {
        if !inputs::maps_to_target(model) {
            return Err(Failure::usage(format!(
                "--transformed-out: model `{name}` moves both sides, its source has no image among the target points"
            )));
        }
        let format =
            cfpose_vision::format_of(path).map_err(|fault| Failure::usage(format!("--transformed-out: {fault}")))?;
        if format.write.is_none() {
            return Err(Failure::usage(format!("--transformed-out: {} files can only be read; use csv", format.name)));
        }
    }
    if let Some(path) = &args.plot {
        is_png(path)?;
    }
    // A wrong folder must show before minutes of work.
    output::check_writable(args.plot.as_deref())?;
    output::check_writable(args.pose_out.as_deref())?;
    output::check_writable(args.transformed_out.as_deref())
}

fn write_outputs(args: &EstimateArgs, loaded: &Loaded, estimate: &Estimate) -> Result<(), Failure> {
    if let Some(path) = &args.pose_out
        && let Some(pose) = inputs::pose(&loaded.estimator.model().layout, &estimate.theta, args.problem.depth)
    {
        write_pose(path, pose)?;
    }
    if let Some(path) = &args.transformed_out {
        let moved = transformed(loaded, &estimate.theta)
            .map_err(|error| Failure::input(format!("{}: transformed source points: {error}", path.display())))?;
        write_points(path, &moved)?;
    }
    Ok(())
}

/// Say whether a figure is to be a PNG.
fn is_png(path: &Path) -> Result<bool, Failure> {
    let extension = path.extension().map(|extension| extension.to_string_lossy().to_lowercase());
    match extension.as_deref() {
        Some("svg") => Ok(false),
        Some("png") => Ok(true),
        _ => Err(Failure::usage(format!(
            "--plot: {} is no figure; give a name that ends in .svg or .png",
            path.display()
        ))),
    }
}

/// Draw both sets before and after, and the residuals; without a usable result only what is there before.
fn plot(path: &Path, args: &EstimateArgs, loaded: &Loaded, estimate: &Estimate) -> Result<(), Failure> {
    let estimator = &loaded.estimator;
    let start = estimator.settings().given_starts().first().unwrap_or(&estimator.model().identity).clone();
    let covariance = estimate.statistics.as_ref().map(|statistics| statistics.covariance.as_slice());
    let made = if estimate.usable() {
        of_estimate(estimator, &start, &estimate.theta, covariance)
    } else {
        panels(estimator, &[("before; no usable result", start.as_slice())])
    };
    let moved = |error| Failure::unusable(format!("{}: moved points: {error}", path.display()));
    let mut made = made.map_err(moved)?;
    if let (Some(verdict), Some(after)) = (estimate.verdict, made.iter_mut().find(|panel| panel.title == "after")) {
        after.title = format!("after: {}", verdict.name());
    }
    let name = |path: &Path| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let title = format!("{} onto {}, {}", name(args.problem.source()), name(args.problem.target()), args.problem.model);
    let bytes = if is_png(path)? { overlay_png(&title, &made)? } else { overlay(&title, &made)?.into_bytes() };
    std::fs::write(path, bytes).map_err(|error| Failure::input(format!("{}: {error}", path.display())))
}

fn write_pose(path: &Path, pose: Pose) -> Result<(), Failure> {
    output::write_file(path, &PoseFormat::of_path(path).write(&[StampedPose { time: None, pose }]))
}

/// Return the source points at theta in the units of the target file: rays become image points or pixels where the target
/// file holds these.
fn transformed(loaded: &Loaded, theta: &[f64]) -> Result<Points, cfpose::Error> {
    let mapped = loaded.estimator.mapped_source(theta)?;
    if loaded.target_dim != 2 {
        return Ok(mapped);
    }
    let source_error = |problem| cfpose::Error::Points { side: cfpose::Side::Source, problem };
    loaded.cameras[1].unwrap_or(Camera::IDENTITY).project(&mapped).map_err(source_error)
}
