//! `cfpose estimate --source-moments P.cfm --target-moments Q.cfm`.

use std::time::Instant;

use cfpose::Supervision;
use cfpose_lab::Lab;

use crate::args::EstimateArgs;
use crate::failure::Failure;
use crate::inputs;
use crate::output;
use crate::progress::Watch;
use crate::report::{Asked, PoseReport, Report};
use crate::signals::Signals;

/// Run the command on moments.
///
/// # Errors
/// [`Failure`], as of point files.
pub(super) fn run(args: &EstimateArgs, lab: &Lab, begun: Instant) -> Result<(), Failure> {
    refuse_points(args)?;
    let loaded = inputs::load_moments(&args.problem, &lab.registry)?;
    let layout = &loaded.estimator.model().layout;
    if args.pose_out.is_some() && PoseReport::of(layout, &loaded.estimator.model().identity, None).is_none() {
        return Err(Failure::usage(format!("--pose-out: model `{}` has no pose; use --json", args.problem.model)));
    }
    output::check_writable(args.pose_out.as_deref())?;
    let signals = Signals::watch();
    let mut watch = Watch::new(args.verbose);
    let supervision = Supervision { observer: Some(&mut watch), cancel: Some(signals.flag()), deadline: args.deadline };
    let estimate = loaded.estimator.solve(supervision)?;
    drop(watch);
    let asked = Asked {
        settings: loaded.estimator.settings(),
        layout,
        form: args.problem.rotation,
        isa: loaded.isa.name(),
        num_source: loaded.counts[0],
        num_target: loaded.counts[1],
        free: &loaded.free,
        target_unit: 1.0,
        homography: None,
    };
    let report = Report::new(&args.problem, &asked, &estimate, None, begun.elapsed().as_secs_f64());
    let json = args.problem.json.as_deref();
    output::show(&report.table(&asked, &estimate), json)?;
    output::write_json(&report, json)?;
    if let Some(path) = args.pose_out.as_deref().filter(|_| estimate.usable())
        && let Some(pose) = inputs::pose(layout, &estimate.theta, args.problem.depth)
    {
        super::write_pose(path, pose)?;
    }
    super::ended(&signals, &estimate)
}

/// Refuse what asks for points.
fn refuse_points(args: &EstimateArgs) -> Result<(), Failure> {
    let (problem, reading) = (&args.problem, &args.problem.reading);
    let read = !reading.columns.is_empty()
        || reading.weight_column.is_some()
        || reading.format.is_some()
        || reading.invalid.is_some()
        || reading.max_points.is_some()
        || reading.thin.is_some()
        || reading.weights.is_some()
        || reading.threshold.is_some()
        || reading.foreground.is_some();
    let asks = [
        (args.plot.is_some(), "--plot"),
        (args.transformed_out.is_some(), "--transformed-out"),
        (args.correspondence.is_some(), "--correspondence"),
        (problem.camera.is_some(), "--camera"),
        (problem.source_camera.is_some(), "--source-camera"),
        (problem.target_camera.is_some(), "--target-camera"),
        (problem.depth.is_some(), "--depth"),
        (problem.reflections.is_some(), "--reflections"),
        (read, "a flag of reading point files"),
    ];
    match asks.iter().find(|(given, _)| *given) {
        Some((_, flag)) => {
            Err(Failure::usage(format!("{flag} has no effect on moments, which hold no points; leave it out")))
        }
        None => Ok(()),
    }
}
