//! One frame of the result.

use std::path::Path;

use cfpose::Pose;
use cfpose::homography::in_file_units;
use cfpose::theta::RotationForm;
use cfpose_vision::Camera;
use cfpose_vision::registration::{FrameVerdict, Pattern};
use serde_json::{Value, json};

use super::{Done, Setup};

/// In which units a result is told.
pub(crate) struct Units {
    /// Model.
    pub model: String,
    /// The frames' camera as it was given.
    pub camera: Option<Camera>,
    /// The reference's camera.
    pub reference: Camera,
    /// Distance of the pattern from the reference's camera in the unit of `--size`, 1 without it.
    pub depth: f64,
    /// Place of the design's origin in the frame of its camera, the unit of its size; the camera's own origin for an image.
    pub origin: [f64; 3],
}

impl Units {
    /// `size`: extent of the pattern, the larger of width and height, in the unit that translations are wanted in.
    pub fn new(model: &str, camera: Option<Camera>, reference: Camera, pattern: &Pattern, size: Option<f64>) -> Self {
        let places = &pattern.outline.places;
        let extent = (0..2)
            .map(|d| places.iter().map(|p| p[d]).fold((f64::MAX, f64::MIN), |(a, b), x| (a.min(x), b.max(x))))
            .map(|(low, high)| high - low)
            .fold(0.0_f64, f64::max);
        let depth = size.map_or(1.0, |size| size / extent);
        Self { model: model.to_string(), camera, reference, depth, origin: [0.0; 3] }
    }

    /// `origin`: place of the design's origin in the frame of the camera that sees it as the reference.
    pub fn of_design(model: &str, camera: Option<Camera>, reference: Camera, origin: [f64; 3]) -> Self {
        Self { model: model.to_string(), camera, reference, depth: origin[2], origin }
    }

    /// Return the pose of the pattern's frame from that of the reference's camera, the translation in depths.
    fn of_pattern(&self, pose: Pose) -> Pose {
        let r = &pose.rotation;
        let turned = |i: usize| (0..3).map(|k| r[3 * i + k] * self.origin[k]).sum::<f64>();
        let translation = [0, 1, 2].map(|i: usize| pose.translation[i] * self.depth + turned(i));
        Pose { translation, ..pose }
    }

    /// Return theta from the pose of the pattern's frame: rotation vector and translation; the inverse of what is written.
    pub fn theta_of(&self, [a, b, c, x, y, z]: [f64; 6]) -> [f64; 6] {
        let r = cfpose_optim::manifold::rotation_exp(&[a, b, c]);
        let turned = |i: usize| (0..3).map(|k| r[3 * i + k] * self.origin[k]).sum::<f64>();
        [a, b, c, (x - turned(0)) / self.depth, (y - turned(1)) / self.depth, (z - turned(2)) / self.depth]
    }
}

/// One frame of the result.
pub(crate) struct Line {
    verdict: FrameVerdict,
    /// Pose of the pattern's frame in the camera's, where the model has one.
    pub pose: Option<Pose>,
    /// File of the frame, and its time.
    pub name: String,
    /// Seconds, or the number of the frame.
    pub time: f64,
    /// Everything, as JSON.
    pub value: Value,
    /// Median distance of the edges, pixels.
    pub residual: f64,
    /// Share of the contour with an edge.
    pub visible: f64,
}

impl Line {
    /// Put a result into words.
    pub fn new(setup: &Setup, name: &Path, time: f64, done: &Result<Done, String>, seconds: f64) -> Self {
        let name = name.to_string_lossy().into_owned();
        let done = match done {
            Ok(done) => done,
            Err(reason) => {
                let verdict = FrameVerdict::Lost;
                let value = json!({
                    "frame": name, "time": time, "verdict": verdict.name(), "theta": null, "pose": null, "pose_inverse": null,
                    "homography": null, "covariance": null, "residual_px": null, "visible_share": 0.0, "overlap": null,
                    "second_tilt_ratio": null, "alternatives": [], "warnings": [reason], "seconds": seconds,
                });
                return Self { verdict, pose: None, name, time, value, residual: f64::NAN, visible: 0.0 };
            }
        };
        let found = &done.found;
        let pose = setup.pose(&found.theta);
        let m = (found.covariance.len() as f64).sqrt() as usize;
        let quality = &found.quality;
        let visible = quality.share * quality.visible;
        let alternatives: Vec<Value> = found
            .rivals
            .iter()
            .map(|rival| {
                json!({
                    "theta": setup.theta(&rival.theta, done),
                    "pose": setup.pose(&rival.theta).as_ref().map(of_pose),
                    "residual_ratio": rival.ratio,
                })
            })
            .collect();
        let value = json!({
            "frame": name,
            "time": time,
            "verdict": found.verdict.name(),
            "theta": setup.theta(&found.theta, done),
            "pose": pose.as_ref().map(of_pose),
            "pose_inverse": pose.as_ref().map(|pose| of_inverse(&inverse(pose))),
            "homography": setup.homography(&found.theta, done),
            "covariance": if setup.is_of_pixels() { Value::Null } else {
                json!(found.covariance.chunks(m.max(1)).collect::<Vec<_>>())
            },
            "residual_px": quality.median,
            "visible_share": visible,
            "overlap": [quality.frame_explained, quality.reference_explained],
            "second_tilt_ratio": found.rivals.first().map(|rival| rival.ratio),
            "alternatives": alternatives,
            "starts": found.starts,
            "by": found.by,
            "warnings": found.warnings,
            "seconds": seconds,
        });
        Self { verdict: found.verdict, pose, name, time, value, residual: quality.median, visible }
    }

    /// Return the verdict.
    pub fn verdict(&self) -> FrameVerdict {
        self.verdict
    }

    /// Say whether the verdict is the best one.
    pub fn is_good(&self) -> bool {
        self.verdict == FrameVerdict::Good
    }
}

impl Setup {
    /// Say whether theta is counted in pixels while the fit is not.
    fn is_of_pixels(&self) -> bool {
        self.units.model == "homography" && self.units.camera.is_none()
    }

    /// Return the homography between the images, pixels, last entry 1, lenses left out.
    fn homography(&self, theta: &[f64], done: &Done) -> Option<[[f64; 3]; 3]> {
        let h = self.registrar.homography(theta);
        let (source, target) = (self.units.reference.intrinsics(), done.camera.intrinsics());
        let h = in_file_units(&h, Some(&source), Some(&target))?;
        Some([0, 1, 2].map(|i| [h[3 * i], h[3 * i + 1], h[3 * i + 2]]))
    }

    /// Return theta as a list; a homography without a camera in pixels, norm 1.
    fn theta(&self, theta: &[f64], done: &Done) -> Option<Vec<f64>> {
        if self.is_of_pixels() {
            let h = self.homography(theta, done)?;
            let norm = h.iter().flatten().map(|v| v * v).sum::<f64>().sqrt();
            return Some(h.iter().flatten().map(|v| v / norm).collect());
        }
        Some(self.registrar.model().layout.to_list(theta, RotationForm::Vector))
    }

    /// Return the pose, translation in the unit of `--size`.
    fn pose(&self, theta: &[f64]) -> Option<Pose> {
        let pose = Pose::of_theta(&self.registrar.model().layout, theta)?;
        Some(self.units.of_pattern(pose))
    }
}

fn of_pose(pose: &Pose) -> Value {
    named("camera_from_pattern", pose)
}

fn of_inverse(pose: &Pose) -> Value {
    named("pattern_from_camera", pose)
}

fn named(convention: &str, pose: &Pose) -> Value {
    let matrix = pose.matrix();
    let rotation: Vec<&[f64]> = matrix[..3].iter().map(|row| &row[..3]).collect();
    json!({ "convention": convention, "rotation": rotation, "translation": pose.translation, "matrix": matrix })
}

/// Return R' and -R' t.
fn inverse(pose: &Pose) -> Pose {
    let r = &pose.rotation;
    let rotation = [r[0], r[3], r[6], r[1], r[4], r[7], r[2], r[5], r[8]];
    let translation = [0, 1, 2].map(|i: usize| -(0..3).map(|k| rotation[3 * i + k] * pose.translation[k]).sum::<f64>());
    Pose { rotation, translation }
}
