//! Cameras of the two files: `--camera`, `--source-camera`, `--target-camera`.

use std::path::Path;

use cfpose::{Points, PointsError};
use cfpose_vision::{Camera, Lens, read_camera};

use crate::args::{ProblemArgs, numbers};
use crate::failure::Failure;

/// Read the cameras of source and target; `None` where a file holds points of the plane z = 1 or of space.
///
/// # Errors
/// Usage for numbers that are no camera and for a flag that the others leave nothing to; input for a file.
pub fn read(args: &ProblemArgs) -> Result<[Option<Camera>; 2], Failure> {
    let own = [&args.source_camera, &args.target_camera];
    if args.camera.is_some() && own.iter().all(|side| side.is_some()) {
        let all = "--camera beside --source-camera and --target-camera has no effect; leave it out";
        return Err(Failure::usage(all));
    }
    let flags = ["--source-camera", "--target-camera"];
    let side = |k: usize| match (own[k], &args.camera) {
        (Some(text), _) => camera(flags[k], text).map(Some),
        (None, Some(text)) => camera("--camera", text).map(Some),
        (None, None) => Ok(None),
    };
    Ok([side(0)?, side(1)?])
}

/// Return the files that the flags name.
pub fn files(args: &ProblemArgs) -> Vec<&Path> {
    let given = [&args.camera, &args.source_camera, &args.target_camera].into_iter().flatten();
    given.filter(|text| numbers(text).is_none()).map(|text| split(text).0).collect()
}

/// Split `FILE#NAME`; a file with that whole name wins.
fn split(text: &str) -> (&Path, Option<&str>) {
    match text.rsplit_once('#') {
        Some((file, name)) if !Path::new(text).exists() => (Path::new(file), Some(name)),
        _ => (Path::new(text), None),
    }
}

/// Read the camera that a flag names: numbers, or a file.
///
/// # Errors
/// Usage for numbers that are no camera, input for a file.
pub fn camera(flag: &str, text: &str) -> Result<Camera, Failure> {
    let complain = |more: &str| {
        Failure::usage(format!("{flag} is `{text}`; give fx,fy,cx,cy in pixels, focal lengths above 0{more}"))
    };
    if let Some(list) = numbers(text) {
        let camera = if let [fx, fy, cx, cy] = list[..] { Camera::new(fx, fy, cx, cy) } else { None };
        return camera.ok_or_else(|| complain(""));
    }
    let (path, name) = split(text);
    // A word without dot or slash that names no file is no missing file.
    if !path.exists() && !text.contains(['.', '/']) {
        return Err(complain(", or a camera file"));
    }
    Ok(read_camera(path, name)?)
}

/// Refuse cameras that no file of pixels is there for.
///
/// # Errors
/// Usage, naming the flag.
pub fn check(args: &ProblemArgs, dims: [usize; 2]) -> Result<(), Failure> {
    let own = [&args.source_camera, &args.target_camera];
    for ((flag, given), dim) in ["--source-camera", "--target-camera"].iter().zip(own).zip(dims) {
        if given.is_some() && dim != 2 {
            return Err(Failure::usage(format!(
                "{flag} has no effect, the file has {dim} columns and no pixels; leave it out"
            )));
        }
    }
    let for_all = (0..2).any(|k| own[k].is_none() && dims[k] == 2);
    if args.camera.is_some() && !for_all {
        let problem = "--camera has no effect, no other file has 2 columns of pixels; leave it out";
        return Err(Failure::usage(problem.replace("other ", if own == [&None, &None] { "" } else { "other " })));
    }
    Ok(())
}

/// Return image points of pixels; other points as they are.
///
/// # Errors
/// Input, with file and point, for a pixel that the camera cannot see anything in.
pub fn to_image(points: Points, camera: Option<Camera>, path: &Path) -> Result<Points, Failure> {
    match camera {
        Some(camera) if points.dim() == 2 => camera.normalise(&points).map_err(|error| {
            let problem = match error {
                PointsError::NotFinite { row, .. } if camera.lens() != Lens::None => format!(
                    "point {row}: the camera's lens shows nothing at this pixel, its distortion folds before; check the camera or remove the point"
                ),
                other => other.to_string(),
            };
            Failure::input(format!("{}: {problem}", path.display()))
        }),
        _ => Ok(points),
    }
}
