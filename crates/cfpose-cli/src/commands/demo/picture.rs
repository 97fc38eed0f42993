//! The demo's second part: an image of a pattern, a photograph of it from elsewhere with a part hidden, and the pose.

use std::path::Path;
use std::time::Instant;

use cfpose::homography::{apply, in_file_units};
use cfpose_lab::Lab;
use cfpose_lab::rendered::{CELLS, draw};
use cfpose_vision::overlay::{colour_of, draw_line, to_png};
use cfpose_vision::registration::{FrameVerdict, Pattern, Registrar, View};
use cfpose_vision::{SegmentOptions, segment};
use serde_json::{Value, json};

use crate::args::program;
use crate::failure::Failure;

/// Condition of `cfpose cells` that is shown: 20 % of the pattern under something of another grey.
const CELL: &str = "blob20";

/// Files that are written.
pub(super) const FILES: [&str; 3] = ["reference.png", "frame.png", "registered.png"];

/// What came out.
pub(super) struct Shown {
    /// Line of the text.
    pub text: String,
    /// The same as JSON.
    pub value: Value,
    /// Whether the pose is right and said to be.
    pub found: bool,
}

/// Render, register, draw.
///
/// # Errors
/// [`Failure`] where a file cannot be written or the pattern is not found.
pub(super) fn show(out: &Path, seed: u64, lab: &Lab) -> Result<Shown, Failure> {
    let cell = CELLS.iter().find(|cell| cell.name == CELL).ok_or_else(|| Failure::usage("no such condition"))?;
    let trial = draw(cell, seed, 0);
    let [reference_file, frame_file, drawn_file] = FILES.map(|name| out.join(name));
    let write = |path: &Path, image: &image::RgbImage| -> Result<(), Failure> {
        let bytes = to_png(image).map_err(|fault| Failure::input(format!("{}: {fault}", path.display())))?;
        std::fs::write(path, bytes).map_err(|error| Failure::input(format!("{}: {error}", path.display())))
    };
    write(&reference_file, &trial.reference.to_rgb())?;
    write(&frame_file, &trial.frame.to_rgb())?;
    let begun = Instant::now();
    let registrar = Registrar::new(&lab.registry, "plane-bearing", None, None).map_err(|e| Failure::usage(&e))?;
    let transfer = cell.exposure.transfer;
    let of_image = |problem: &dyn std::fmt::Display| Failure::unusable(format!("the rendered image: {problem}"));
    let reference = segment(&trial.reference.light(transfer), &SegmentOptions::default()).map_err(|e| of_image(&e))?;
    let pattern = Pattern::new(&reference, trial.camera).map_err(|e| of_image(&e))?;
    let options = pattern.look(&SegmentOptions::default());
    let frame = segment(&trial.frame.light(transfer), &options).map_err(|e| of_image(&e))?;
    let view = View::new(&frame, trial.camera).map_err(|e| of_image(&e))?;
    let found = registrar.register(&pattern, &view, None, seed);
    let found = found.ok_or_else(|| Failure::unusable("the pattern is not found in the rendered image"))?;
    let seconds = begun.elapsed().as_secs_f64();
    let k = trial.camera.intrinsics();
    let h = in_file_units(&registrar.homography(&found.theta), Some(&k), Some(&k)).unwrap_or([f64::NAN; 9]);
    let off = |p: &[f64; 2]| {
        let (a, b) = (apply(&h, *p), apply(&trial.homography, *p));
        (a[0] - b[0]).hypot(a[1] - b[1])
    };
    let px = trial.test_places.iter().map(off).sum::<f64>() / trial.test_places.len() as f64;
    let before = trial.test_places.iter().map(|p| {
        let q = apply(&trial.homography, *p);
        (p[0] - q[0]).hypot(p[1] - q[1])
    });
    let before = before.sum::<f64>() / trial.test_places.len() as f64;
    let mut drawn = trial.frame.to_rgb();
    let mut outline = registrar.outline_in(&pattern, trial.camera, &found.theta);
    outline.extend(outline.first().copied());
    draw_line(&mut drawn, &outline, 10.0, colour_of(found.verdict));
    write(&drawn_file, &drawn)?;
    let share = 100.0 * trial.hidden;
    let text = format!(
        "image: {share:.0} % of a pattern hidden, {before:.1} pixels off at the start, {px:.3} after registration, {} ({seconds:.2} s)\n\
         look at {}\n\
         try     {} register {} {} --camera 600,600,319.5,239.5 --transfer {}",
        found.verdict.name(),
        drawn_file.display(),
        program(),
        reference_file.display(),
        frame_file.display(),
        transfer.name(),
    );
    let value = json!({ "hidden": trial.hidden, "start_px": before, "px": px, "verdict": found.verdict.name(), "seconds": seconds });
    Ok(Shown { text, value, found: px < 1.0 && found.verdict != FrameVerdict::Lost })
}
