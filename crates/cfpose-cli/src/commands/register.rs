//! `cfpose register`: a reference and frames to poses, uncertainties, verdicts and pictures.

mod frames;
mod line;
mod outputs;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use cfpose::free::{Frame, find_columns};
use cfpose::theta::RotationForm;
use cfpose_lab::Lab;
use cfpose_vision::registration::{FrameVerdict, Pattern, Registered, Registrar};
use cfpose_vision::{
    Camera, Filter, Foreground, HueError, Picture, Raster, SegmentOptions, Transfer, guess_transfer, is_design,
    read_design, read_picture, segment,
};

use crate::args::{FrameName, LookArgs, RegisterArgs, Side};
use crate::failure::Failure;
use crate::inputs::read_camera_flag;
use crate::output;
use line::{Line, Units};
use outputs::Outputs;

/// Models whose theta is counted in pixels where there is no camera.
const OF_PIXELS: [&str; 4] = ["homography", "affine2", "similarity2", "rigid2"];

/// A reference and a model made ready.
pub(super) struct Setup {
    pub registrar: Registrar,
    pub pattern: Pattern,
    pub units: Units,
    pub options: SegmentOptions,
    /// How light is written.
    pub transfer: Transfer,
    /// Filter that images are looked at through, where the pattern has a hue.
    pub filter: Option<Filter>,
    pub seed: u64,
}

/// A frame after registration.
pub(super) struct Done {
    pub picture: Picture,
    pub camera: Camera,
    pub found: Registered,
}

/// Run the command.
///
/// # Errors
/// [`Failure`] of arguments and reference; frames that cannot be used are lines of the result, and a failure only if all are, or with
/// `--strict` if one is not `good`.
pub fn run(args: &RegisterArgs, lab: &Lab) -> Result<(), Failure> {
    let names = frames::list(&args.frames)?;
    let inputs: Vec<_> = names.iter().chain([&args.reference]).cloned().collect();
    output::keep_apart(&inputs, &[args.json.as_deref()])?;
    let setup = set_up(args, &names, lab)?;
    let times = frames::times(&names, args.fps);
    let mut outputs = Outputs::open(args.out.as_deref(), args.json.as_deref())?;
    let (mut last, mut usable, mut good): (Option<Vec<f64>>, usize, usize) = (None, 0, 0);
    for (number, name) in names.iter().enumerate() {
        let begun = Instant::now();
        let done = register(&setup, name, last.as_deref());
        let seconds = begun.elapsed().as_secs_f64();
        let line = Line::new(&setup, name, times[number], &done, seconds);
        usable += usize::from(line.verdict().usable());
        good += usize::from(line.is_good());
        last = match &done {
            Ok(done) if line.verdict().usable() => Some(done.found.theta.clone()),
            // A frame that shows nothing does not move the pattern.
            _ => last,
        };
        outputs.frame(&setup, &line, done.as_ref().ok())?;
    }
    outputs.finish(args.json.as_deref())?;
    if usable == 0 {
        return Err(Failure::unusable("no frame shows the pattern; look at what `cfpose segment` finds on a frame"));
    }
    if args.strict && good < names.len() {
        return Err(Failure::unusable(format!(
            "--strict: {} of {} frames are not good",
            names.len() - good,
            names.len()
        )));
    }
    Ok(())
}

/// Read reference, cameras and model.
fn set_up(args: &RegisterArgs, names: &[PathBuf], lab: &Lab) -> Result<Setup, Failure> {
    let camera = args.camera.as_deref().map(|text| read_camera_flag("--camera", text)).transpose()?;
    let reference_camera =
        args.reference_camera.as_deref().map(|text| read_camera_flag("--reference-camera", text)).transpose()?;
    let model =
        args.model.clone().unwrap_or_else(|| if camera.is_some() { "plane-bearing" } else { "homography" }.into());
    let of_pixels = OF_PIXELS.contains(&model.as_str());
    if camera.is_none() && !of_pixels && lab.registry.models.iter().any(|entry| entry.name == model) {
        return Err(Failure::usage(format!(
            "model `{model}` needs the camera: give --camera fx,fy,cx,cy or a camera file, or use --model homography"
        )));
    }
    let plain = Registrar::new(&lab.registry, &model, None, None).map_err(|error| Failure::usage(&error))?;
    let layout = &plain.model().layout;
    let frame = if args.frame == FrameName::Robot { Frame::Robot } else { Frame::Camera };
    let free = match &args.free {
        None => None,
        Some(names) => {
            let names: Vec<&str> = names.iter().map(|name| name.trim()).collect();
            Some(find_columns(layout, &names, frame).map_err(|error| Failure::usage(format!("--free: {error}")))?)
        }
    };
    let start = match &args.start {
        None => None,
        Some(text) => {
            let list = crate::args::numbers(text)
                .ok_or_else(|| Failure::usage(format!("--start is `{text}`; give the numbers of theta")))?;
            let theta = layout.from_list(&list, RotationForm::Vector);
            Some(theta.map_err(|error| Failure::usage(format!("--start: {error}")))?)
        }
    };
    let registrar = Registrar::new(&lab.registry, &model, free, start).map_err(|error| Failure::usage(&error))?;
    let first = names.iter().find_map(|name| read_picture(name).ok());
    let mut setup = match is_design(&args.reference) {
        true => of_design(args, registrar, camera, &model, first.as_ref()),
        false => of_image(args, registrar, [reference_camera, camera], &model, first.as_ref()),
    }?;
    if let Some(text) = &args.start_pose {
        let list = crate::args::numbers(text).and_then(|list| <[f64; 6]>::try_from(list).ok()).ok_or_else(|| {
            Failure::usage(format!("--start-pose is `{text}`; give a rotation vector and a translation, 6 numbers"))
        })?;
        let layout = setup.registrar.model().layout.clone();
        let theta = layout.from_list(&setup.units.theta_of(list), RotationForm::Vector);
        let theta = theta.map_err(|error| Failure::usage(format!("--start-pose: {error}")))?;
        setup.registrar = setup.registrar.starting_at(theta);
    }
    Ok(setup)
}

/// Make an image of the pattern the reference.
fn of_image(
    args: &RegisterArgs,
    registrar: Registrar,
    [reference_camera, camera]: [Option<Camera>; 2],
    model: &str,
    first: Option<&Picture>,
) -> Result<Setup, Failure> {
    let named = |problem: &dyn std::fmt::Display| Failure::input(format!("{}: {problem}", args.reference.display()));
    let picture = read_picture(&args.reference)?;
    let options = look(&args.look);
    // One camera writes them all: the reference and the first frame that can be read tell how.
    let pictures: Vec<&Picture> = std::iter::once(&picture).chain(first).collect();
    let used = args.look.transfer.given().unwrap_or_else(|| guess_transfer(&pictures, &options));
    let filter = filter_of(&args.look, &picture, used).map_err(|error| named(&error))?;
    let light = light_of(&picture, filter.as_ref(), used);
    let segmentation = segment(&light, &options).map_err(|error| named(&error))?;
    let own = camera_for(reference_camera.or(camera), &picture, model).map_err(|problem| named(&problem))?;
    let pattern = Pattern::new(&segmentation, own).map_err(|error| named(&error))?;
    let units = Units::new(model, camera, own, &pattern, args.size);
    Ok(Setup { registrar, pattern, units, options, transfer: used, filter, seed: args.seed })
}

/// Make a design the reference: seen from in front of its centre, half as large as the frames.
fn of_design(
    args: &RegisterArgs,
    registrar: Registrar,
    camera: Option<Camera>,
    model: &str,
    first: Option<&Picture>,
) -> Result<Setup, Failure> {
    let named = |problem: &dyn std::fmt::Display| Failure::input(format!("{}: {problem}", args.reference.display()));
    let design = read_design(&args.reference, args.size)?;
    if args.look.hue.is_some() {
        return Err(Failure::usage("--hue needs an image as the reference: a design has no colours"));
    }
    let side = first.map_or(480, |picture| picture.width().min(picture.height())) as f64;
    let focal = camera.map_or(2.0 * side, Camera::focal);
    let distance = focal * design.extent() / (0.5 * side);
    let (drawn, own) = design.draw(distance).ok_or_else(|| named(&"the design cannot be drawn"))?;
    let pattern = Pattern::drawn(drawn, 0.0, own).map_err(|error| named(&error))?;
    let mut options = look(&args.look);
    if args.look.foreground.is_none() {
        options.foreground = Foreground::Dark;
    }
    let used =
        args.look.transfer.given().unwrap_or_else(|| guess_transfer(&first.into_iter().collect::<Vec<_>>(), &options));
    let [x, y] = design.centre();
    let units = Units::of_design(model, camera, own, [-x, -y, distance]);
    Ok(Setup { registrar, pattern, units, options, transfer: used, filter: None, seed: args.seed })
}

/// Return the camera of an image: the one that was given, fitted to the image's size, or one that only makes pixels numbers of size 1.
fn camera_for(given: Option<Camera>, picture: &Picture, model: &str) -> Result<Camera, String> {
    match given {
        Some(camera) => camera.for_size(picture.width(), picture.height()),
        None if model == "homography" => {
            let [w, h] = [picture.width(), picture.height()].map(|size| size as f64);
            let focal = w.max(h);
            Camera::new(focal, focal, (w - 1.0) / 2.0, (h - 1.0) / 2.0).ok_or_else(|| "the image has no size".into())
        }
        None => Ok(Camera::IDENTITY),
    }
}

/// Read and register one frame; the reason where it shows nothing.
fn register(setup: &Setup, name: &Path, last: Option<&[f64]>) -> Result<Done, String> {
    let picture = read_picture(name).map_err(|error| format!("{}{}", error.at, error.fault))?;
    let camera = camera_for(setup.units.camera, &picture, &setup.units.model)?;
    let light = Arc::new(light_of(&picture, setup.filter.as_ref(), setup.transfer));
    let found = setup.registrar.follow(&setup.pattern, light, &setup.options, camera, last, setup.seed);
    let mut found = found.map_err(|missed| missed.to_string())?;
    if found.verdict == FrameVerdict::Lost {
        let share = 100.0 * found.quality.share;
        return Err(format!("the best of {} poses has edges on {share:.0} % of the contour", found.starts));
    }
    let clipped = clipped_share(setup, &picture, camera, &found.theta);
    if clipped > 0.02 {
        found.warnings.push(format!(
            "{:.0} % of the contour is over-exposed: its edges lie where the light is cut off, up to half a pixel off",
            100.0 * clipped
        ));
    }
    Ok(Done { picture, camera, found })
}

/// Return the share of the contour with over-exposed pixels within 3 pixels.
fn clipped_share(setup: &Setup, picture: &Picture, camera: Camera, theta: &[f64]) -> f64 {
    let places = setup.registrar.outline_in(&setup.pattern, camera, theta);
    let clipped = |p: &&[f64; 2]| {
        let near = |at: f64, most: usize| (at - 3.0).max(0.0) as usize..((at + 4.0).max(0.0) as usize).min(most);
        p.iter().all(|v| v.is_finite())
            && near(p[1], picture.height()).any(|y| near(p[0], picture.width()).any(|x| picture.is_clipped(x, y)))
    };
    places.iter().filter(clipped).count() as f64 / places.len().max(1) as f64
}

/// Find the filter for the hue that was given, on an image.
pub(super) fn filter_of(args: &LookArgs, picture: &Picture, transfer: Transfer) -> Result<Option<Filter>, HueError> {
    args.hue().map(|hue| Filter::for_hue(picture, hue, transfer)).transpose()
}

/// Return the light of an image, through a filter where there is one.
pub(super) fn light_of(picture: &Picture, filter: Option<&Filter>, transfer: Transfer) -> Raster {
    filter.map_or_else(|| picture.light(transfer), |filter| picture.through(filter, transfer))
}

/// Return what the flags of segmentation say.
pub(super) fn look(args: &LookArgs) -> SegmentOptions {
    SegmentOptions {
        foreground: match args.foreground {
            None => Foreground::Auto,
            Some(Side::Dark) => Foreground::Dark,
            Some(Side::Bright) => Foreground::Bright,
        },
        threshold: args.threshold,
        ..SegmentOptions::default()
    }
}
