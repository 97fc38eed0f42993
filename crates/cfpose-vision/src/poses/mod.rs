//! Pose files: 4x4 and 3x4 matrices, TUM trajectories, KITTI rows, JSON.
//!
//! Poses read `target_from_source`. A text file is told apart by its rows: rows of 4 numbers are matrices (four rows 4x4,
//! three rows 3x4), a row of 8 is TUM (`time tx ty tz qx qy qz qw`), a row of 12 KITTI (3x4 row by row), a row of 16 a 4x4
//! row by row. `#` starts a comment. A header, or the last comment before the rows, that names qx, qy, qz, qw (also
//! `q_RS_w []`, `orientation.w`) says in which columns the pose stands, and that others do not count.

mod text;

use std::path::Path;

use cfpose::Pose;
use cfpose::theta::{Layout, RotationForm};
use serde_json::{Value, json};

use crate::error::{Fault, FileError, Flaw, Place};
use crate::lines::with_line_feeds;
use text::parse_text;

/// Largest deviation of R'R from the identity: KITTI's files hold 7 digits.
const TOLERANCE: f64 = 1e-3;

/// A pose and, where the file has one, its time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StampedPose {
    /// Time in the unit of the file (TUM: seconds).
    pub time: Option<f64>,
    /// The pose.
    pub pose: Pose,
}

impl StampedPose {
    /// Return ambient theta of a layout of one rotation and one 3-D translation, which is multiplied by `scale`; `None`
    /// for any other layout.
    pub fn theta(&self, layout: &Layout, scale: f64) -> Option<Vec<f64>> {
        if layout.blocks().len() != 2 || layout.range("rotation")? != (0..9) || layout.range("translation")? != (9..12)
        {
            return None;
        }
        let translation = self.pose.translation.map(|value| value * scale);
        Some([self.pose.rotation.as_slice(), &translation].concat())
    }
}

/// A way to write poses.
///
/// ```
/// use cfpose::Pose;
/// use cfpose_vision::{PoseFormat, StampedPose};
/// let pose = Pose { rotation: [0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0], translation: [1.0, 2.0, 3.0] };
/// let text = PoseFormat::Kitti.write(&[StampedPose { time: None, pose }]);
/// assert_eq!(text, "0.0 -1.0 0.0 1.0 1.0 0.0 0.0 2.0 0.0 0.0 1.0 3.0\n");
/// assert!(PoseFormat::Tum.write(&[StampedPose { time: Some(7.5), pose }]).starts_with("7.5 1.0 2.0 3.0 0.0 0.0 0.7071"));
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PoseFormat {
    /// Four rows of four numbers, blocks apart by an empty line.
    Matrix,
    /// `time tx ty tz qx qy qz qw`; the position in the file where there is no time.
    Tum,
    /// 3x4 row by row on one line.
    Kitti,
    /// An object, for several poses a list of objects, as in the results of the program.
    Json,
}

impl PoseFormat {
    /// Choose by a file's extension: json, tum, kitti, else the matrix.
    pub fn of_path(path: &Path) -> Self {
        let extension = path.extension().map(|extension| extension.to_string_lossy().to_lowercase());
        match extension.as_deref() {
            Some("json") => PoseFormat::Json,
            Some("tum") => PoseFormat::Tum,
            Some("kitti") => PoseFormat::Kitti,
            _ => PoseFormat::Matrix,
        }
    }

    /// Write poses as text, numbers so that reading them back gives the same bits.
    pub fn write(self, poses: &[StampedPose]) -> String {
        match self {
            PoseFormat::Matrix => {
                let blocks: Vec<String> = poses.iter().map(|pose| matrix_text(&pose.pose)).collect();
                blocks.join("\n")
            }
            PoseFormat::Tum => poses.iter().enumerate().map(|(index, pose)| tum_text(index, pose)).collect(),
            PoseFormat::Kitti => poses.iter().map(|pose| row_text(pose.pose.matrix()[..3].as_flattened())).collect(),
            PoseFormat::Json => {
                let list: Vec<Value> = poses.iter().map(pose_json).collect();
                let value = if let [one] = list.as_slice() { one.clone() } else { Value::Array(list) };
                format!("{value}\n")
            }
        }
    }
}

fn row_text(values: &[f64]) -> String {
    let fields: Vec<String> = values.iter().map(|value| format!("{value:?}")).collect();
    fields.join(" ") + "\n"
}

fn matrix_text(pose: &Pose) -> String {
    pose.matrix().iter().map(|row| row_text(row)).collect()
}

fn tum_text(index: usize, pose: &StampedPose) -> String {
    let theta = [pose.pose.rotation.as_slice(), &pose.pose.translation].concat();
    let list = Layout::pose3().to_list(&theta, RotationForm::Quaternion);
    let (q, t) = list.split_at(4);
    let time = pose.time.unwrap_or(index as f64);
    row_text(&[time, t[0], t[1], t[2], q[1], q[2], q[3], q[0]])
}

/// Return the JSON object of a pose: convention, rotation, translation, matrix, and the time where there is one.
fn pose_json(pose: &StampedPose) -> Value {
    let matrix = pose.pose.matrix();
    let rotation: Vec<&[f64]> = matrix[..3].iter().map(|row| &row[..3]).collect();
    let mut object = json!({
        "convention": "target_from_source",
        "rotation": rotation,
        "translation": pose.pose.translation,
        "matrix": matrix,
    });
    if let Some(time) = pose.time {
        object["time"] = json!(time);
    }
    object
}

/// Read the poses of a file.
///
/// # Errors
/// [`FileError`] naming the line: what is no number, rows that are no pose, a matrix that is no rotation.
///
/// ```
/// use cfpose_vision::read_poses;
/// let path = std::env::temp_dir().join(format!("cfpose-poses-{}.txt", std::process::id()));
/// std::fs::write(&path, "# time tx ty tz qx qy qz qw\n0.5 1 2 3 0 0 0 1\n")?;
/// let poses = read_poses(&path)?;
/// assert_eq!((poses[0].time, poses[0].pose.translation), (Some(0.5), [1.0, 2.0, 3.0]));
/// # std::fs::remove_file(&path)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn read_poses(path: &Path) -> Result<Vec<StampedPose>, FileError> {
    let fail = |flaw: Flaw| flaw.in_file(path);
    let bytes = crate::bytes::read_bytes(path).map_err(|fault| match fault {
        Fault::Empty => fail(empty()),
        other => fail(other.into()),
    })?;
    parse(&bytes).map_err(fail)
}

/// Read the poses in the content of a file.
pub(crate) fn parse(bytes: &[u8]) -> Result<Vec<StampedPose>, Flaw> {
    let bytes = with_line_feeds(bytes)?;
    let text = String::from_utf8_lossy(bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&bytes));
    match text.trim_start().starts_with(['{', '[']) {
        true => parse_json(&text),
        false => parse_text(&text),
    }
}

fn empty() -> Flaw {
    flaw(Place::Whole, "the file holds no pose")
}

fn flaw(at: Place, what: impl Into<String>) -> Flaw {
    Flaw::new(at, Fault::Pose { what: what.into() })
}

fn of_tum(row: &[f64]) -> Result<(Option<f64>, Pose), String> {
    let norm = row[4..].iter().map(|v| v * v).sum::<f64>().sqrt();
    if (norm - 1.0).abs() > TOLERANCE {
        return Err(format!("the quaternion has norm {norm}, not 1"));
    }
    let list = [row[7], row[4], row[5], row[6], row[1], row[2], row[3]];
    let layout = Layout::pose3();
    let theta = layout.from_list(&list, RotationForm::Quaternion).map_err(|error| error.to_string())?;
    let pose = Pose::of_theta(&layout, &theta).ok_or("this is no pose")?;
    Ok((Some(row[0]), pose))
}

/// Read 12 or 16 numbers row by row.
fn of_matrix(values: &[f64]) -> Result<Pose, String> {
    if values.len() == 16 && values[12..] != [0.0, 0.0, 0.0, 1.0] {
        return Err("the last row of a 4x4 pose is 0 0 0 1".to_string());
    }
    let (mut rotation, mut translation) = ([0.0; 9], [0.0; 3]);
    for i in 0..3 {
        rotation[3 * i..3 * i + 3].copy_from_slice(&values[4 * i..4 * i + 3]);
        translation[i] = values[4 * i + 3];
    }
    checked(rotation, translation)
}

/// Check that R'R = I and det R > 0.
fn checked(r: [f64; 9], translation: [f64; 3]) -> Result<Pose, String> {
    let mut deviation = 0.0_f64;
    for i in 0..3 {
        for j in 0..3 {
            let product: f64 = (0..3).map(|k| r[3 * k + i] * r[3 * k + j]).sum();
            deviation = deviation.max((product - f64::from(u8::from(i == j))).abs());
        }
    }
    let minors = [r[4] * r[8] - r[5] * r[7], r[5] * r[6] - r[3] * r[8], r[3] * r[7] - r[4] * r[6]];
    let determinant = r[0] * minors[0] + r[1] * minors[1] + r[2] * minors[2];
    if deviation > TOLERANCE || determinant < 0.0 {
        return Err("the 3x3 part is no rotation (orthonormal, determinant 1)".to_string());
    }
    Ok(Pose { rotation: r, translation })
}

/// Read a pose object, a result that holds one, a nested matrix, or a list of these.
fn parse_json(text: &str) -> Result<Vec<StampedPose>, Flaw> {
    // A value takes up to 150 bytes of memory and as few as 2 of text; poses have numbers of some digits.
    let values = text.bytes().filter(|byte| b",:[{".contains(byte)).count();
    if values > 200_000 + text.len() / 6 {
        return Err(flaw(Place::Whole, format!("{values} values in {} bytes are no poses", text.len())));
    }
    let value: Value = serde_json::from_str(text).map_err(|error| {
        flaw(Place::Line(error.line()), format!("no JSON: {}", crate::error::one_line(&error.to_string())))
    })?;
    let one = |value: &Value| of_json(value).map_err(|what| flaw(Place::Whole, what));
    match &value {
        Value::Array(list) if list.first().is_some_and(|first| !first[0].is_number()) => list.iter().map(one).collect(),
        _ => Ok(vec![one(&value)?]),
    }
}

fn of_json(value: &Value) -> Result<StampedPose, String> {
    if let Some(pose) = value.get("pose") {
        return of_json(pose);
    }
    if let Some(convention) = value.get("convention").filter(|text| *text != "target_from_source") {
        return Err(format!("the convention is {convention}; only target_from_source can be read"));
    }
    let time = value.get("time").and_then(Value::as_f64);
    let read = |value: &Value| {
        serde_json::from_value::<Vec<Vec<f64>>>(value.clone()).ok().map(|rows| (rows.len(), rows.concat()))
    };
    if let Some((3 | 4, list)) =
        read(value.get("matrix").unwrap_or(value)).filter(|(_, list)| [12, 16].contains(&list.len()))
    {
        return Ok(StampedPose { time, pose: of_matrix(&list)? });
    }
    let rotation = value.get("rotation").and_then(read).and_then(|(_, list)| <[f64; 9]>::try_from(list).ok());
    let translation = value.get("translation").and_then(|t| serde_json::from_value::<[f64; 3]>(t.clone()).ok());
    match (rotation, translation) {
        (Some(rotation), Some(translation)) => Ok(StampedPose { time, pose: checked(rotation, translation)? }),
        _ => Err("no pose: it has neither a matrix nor a rotation (3x3) and a translation (3)".to_string()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_form_reads_back() {
        let rotation = cfpose::theta::rotation_of_euler(&[0.3, -1.2, 2.9]);
        let poses = [0.25, 1.5]
            .map(|time| StampedPose { time: Some(time), pose: Pose { rotation, translation: [time, -2.0, 1e-17] } });
        let folder = tempfile::tempdir().unwrap();
        for (format, name) in [
            (PoseFormat::Matrix, "a.txt"),
            (PoseFormat::Tum, "a.tum"),
            (PoseFormat::Kitti, "a.kitti"),
            (PoseFormat::Json, "a.json"),
        ] {
            let path = folder.path().join(name);
            assert_eq!(PoseFormat::of_path(&path), format);
            for count in [1, 2] {
                std::fs::write(&path, format.write(&poses[..count])).unwrap();
                let back = read_poses(&path).unwrap();
                assert_eq!(back.len(), count, "{name}");
                for (a, b) in back.iter().zip(&poses) {
                    assert_eq!(a.pose.translation, b.pose.translation, "{name}");
                    assert_eq!(a.time, b.time.filter(|_| matches!(format, PoseFormat::Tum | PoseFormat::Json)));
                    assert!(a.pose.rotation.iter().zip(&rotation).all(|(x, y)| (x - y).abs() < 1e-15), "{name}");
                }
            }
        }
    }

    #[test]
    fn what_is_no_pose_says_where_and_why() {
        let reason = |text: &str| {
            let poses = if text.starts_with(['{', '[']) { parse_json(text) } else { parse_text(text) };
            let flaw = poses.unwrap_err();
            format!("{}{}", flaw.at, flaw.fault)
        };
        assert!(reason("1 0 0 0\n0 1 0 x\n").starts_with("line 2: \"x\" is no finite number"));
        assert!(reason("1 0 0\n").starts_with("line 1: 3 numbers in a row are no pose"));
        assert!(reason("1 0 0 0\n0 1 0 0\n").contains("not a whole number of 4x4"));
        assert!(reason("1 0 0 0\n0 1 0 0\n0 0 -1 0\n0 0 0 1\n").starts_with("line 1: the 3x3 part is no rotation"));
        assert!(reason("0 1 2 3 0 0 0 2\n").contains("norm 2, not 1"));
        assert!(reason("{\"matrix\": [[1]]}").contains("neither a matrix nor"));
        assert!(reason("{\"convention\": \"source_from_target\"}").contains("only target_from_source"));
        assert!(reason("[1, 2").starts_with("line 1: no JSON"));
    }
}
