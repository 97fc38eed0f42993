//! The outline of a silhouette in a file: MPEG-7 shapes, or any picture of one object.

use std::path::{Path, PathBuf};

use cfpose::entry::{EntryError, ParameterSpec, find};
use cfpose_vision::{Transfer, contours_of, read_picture};

use super::{ALL, CurveEntry, NUM_POINTS, STEP, along, place};

/// Distance of two places along the contour, pixels.
const SPACING: f64 = 0.5;

pub(super) const ENTRY: CurveEntry = CurveEntry {
    name: "outline",
    summary: "outline of the largest region of a silhouette, evenly along its length",
    parameters: &[ParameterSpec {
        name: "file",
        default: "none",
        meaning: "a png or jpeg, in the experiment's folder or that of real data",
    }],
    source: "such as MPEG-7 CE-Shape-1",
    build: |parameters| Err(parameters.bad("file", "an outline is read where an experiment runs")),
};

/// Return the file that a curve is read from, `None` for curves that are formulas.
///
/// # Errors
/// [`EntryError`] for an unknown name or bad parameters.
///
/// ```
/// use cfpose_lab::curves::file_of;
/// assert_eq!(file_of("outline[file=bat.png]").unwrap().unwrap().to_str(), Some("bat.png"));
/// assert_eq!(file_of("heart").unwrap(), None);
/// ```
pub fn file_of(spec: &str) -> Result<Option<PathBuf>, EntryError> {
    let (entry, parameters) = find("curve", ALL, spec)?;
    if entry.name != ENTRY.name {
        return Ok(None);
    }
    match parameters.text("file") {
        "none" => Err(parameters.bad("file", "expected a picture, such as outline[file=bat.png]")),
        file => Ok(Some(PathBuf::from(file))),
    }
}

/// Read the outline of the largest region of a picture: 3142 points evenly along it, largest absolute coordinate `scale`.
///
/// # Errors
/// A message that names the file.
pub fn of_picture(path: &Path, scale: f64) -> Result<Vec<[f64; 2]>, String> {
    let picture = read_picture(path).map_err(|error| error.to_string())?;
    let light = picture.light(Transfer::Linear);
    let contours = contours_of(&light, 0.5);
    let area = |contour: &&cfpose_vision::Contour| contour.signed_area().abs();
    let largest = contours.iter().filter(|contour| contour.closed).max_by(|a, b| area(a).total_cmp(&area(b)));
    let largest =
        largest.ok_or_else(|| format!("{}: no region with a closed outline; give a silhouette", path.display()))?;
    let corners: Vec<[f64; 2]> =
        largest.resampled(SPACING).into_iter().map(|(place, _)| [place[0], -place[1]]).collect();
    let curve = along(&corners);
    let raw: Vec<[f64; 2]> = (0..NUM_POINTS).map(|k| curve(k as f64 * STEP)).collect();
    let place = place(&raw, scale);
    Ok(raw.into_iter().map(place).collect())
}
