//! 3D-to-2D in pixels: a pose, then known intrinsics with lens distortion, in the general per-point form.

use cfpose_kernel::scalar::Scalar;

use super::shared::pose3::{half_turned, mirrored_tilt};
use super::shared::projective::perspective;
use super::shared::scene;
use crate::entry::{EntryError, ParameterSpec, Parameters};
use crate::geometry::theta::Layout;
use crate::model::{Basin, Findings, Model, ModelEntry, PointMap, Scene};

/// A known camera: OpenCV's pinhole model with radial and tangential distortion.
#[derive(Clone, Copy)]
struct Camera {
    focal: [f64; 2],
    centre: [f64; 2],
    radial: [f64; 3],
    tangential: [f64; 2],
}

/// Return R M + T.
#[inline(always)]
fn posed<S: Scalar>(theta: &[S], m: [S; 3]) -> [S; 3] {
    let mut y = [theta[9], theta[10], theta[11]];
    for i in 0..3 {
        for k in 0..3 {
            y[i] = y[i] + theta[3 * i + k] * m[k];
        }
    }
    y
}

impl PointMap<3, 2> for Camera {
    #[inline(always)]
    fn map<S: Scalar>(&self, theta: &[S], point: [S; 3]) -> [S; 2] {
        let [u, v] = perspective(posed(theta, point));
        let (uu, uv, vv) = (u * u, u * v, v * v);
        let square = uu + vv;
        let radial = ((square * self.radial[2] + self.radial[1]) * square + self.radial[0]) * square + 1.0;
        let x = u * radial + uv * (2.0 * self.tangential[0]) + (square + uu * 2.0) * self.tangential[1];
        let y = v * radial + (square + vv * 2.0) * self.tangential[0] + uv * (2.0 * self.tangential[1]);
        [x * self.focal[0] + self.centre[0], y * self.focal[1] + self.centre[1]]
    }

    /// Points behind the camera get weight 0.
    #[inline(always)]
    fn density<S: Scalar>(&self, theta: &[S], point: [S; 3]) -> Option<S> {
        let depth = posed(theta, point)[2];
        Some(depth.select_less(depth.constant(1e-9), depth.constant(0.0), depth.constant(1.0)))
    }
}

fn camera_of(parameters: &Parameters) -> Result<Camera, EntryError> {
    let number = |key: &str| parameters.number(key, "a finite number", f64::is_finite);
    Ok(Camera {
        focal: [number("fx")?, number("fy")?],
        centre: [number("cx")?, number("cy")?],
        radial: [number("k1")?, number("k2")?, number("k3")?],
        tangential: [number("p1")?, number("p2")?],
    })
}

fn examine(scene: &Scene<'_>) -> Findings {
    let theta = scene.theta;
    let depth = |m: [f64; 3]| theta[6] * m[0] + theta[7] * m[1] + theta[8] * m[2] + theta[11];
    let (mut warnings, implausible) = scene::depth_warnings(scene.source, depth);
    warnings.extend(scene::spread_warnings(scene.source, 3, 2));
    let mut candidates = half_turned(theta, 1.0, scene.source);
    if let (normal, true) = scene::normal(scene.source) {
        candidates.extend(mirrored_tilt(theta, scene.source.mean(), normal));
    }
    Findings { candidates, warnings, implausible, ..Findings::default() }
}

const fn parameter(name: &'static str, default: &'static str, meaning: &'static str) -> ParameterSpec {
    ParameterSpec { name, default, meaning }
}

pub(super) const ENTRY: ModelEntry = ModelEntry {
    name: "camera3",
    summary: "3-D points to pixels of a known camera with lens distortion",
    parameters: &[
        parameter("fx", "1", "focal length along x, pixels"),
        parameter("fy", "1", "focal length along y, pixels"),
        parameter("cx", "0", "principal point, x, pixels"),
        parameter("cy", "0", "principal point, y, pixels"),
        parameter("k1", "0", "radial distortion, factor of r^2"),
        parameter("k2", "0", "radial distortion, factor of r^4"),
        parameter("p1", "0", "tangential distortion, first"),
        parameter("p2", "0", "tangential distortion, second"),
        parameter("k3", "0", "radial distortion, factor of r^6"),
    ],
    source: "eq. 3dto2d composed with the camera model of OpenCV's calibration (Brown 1971)",
    details: "(u, v) = (X, Y) / Z of R M + T; r^2 = u^2 + v^2; x = u (1 + k1 r^2 + k2 r^4 + k3 r^6) + 2 p1 u v + p2 (r^2 + 2 u^2), y = v (...) + p1 (r^2 + 2 v^2) + 2 p2 u v; h = (fx x + cx, fy y + cy). theta: rotation vector (rad), translation (units of the source). The target holds pixels. Points behind the camera get weight 0. The general per-point form, about four times slower than `bearing3`. Degenerate as `bearing3`, and where the distortion is not monotonic within the image. Converges from 0.1 (radians and source units at depth 2).",
    build: |parameters, _| {
        let camera = camera_of(parameters)?;
        let mut model = Model::general(Layout::pose3(), camera);
        model.identity[11] = 1.0; // the origin of the source in front of the camera
        model.typical[11] = 2.0;
        model.basin = Basin { features: "hermite[degree=4]", distance: 0.1 };
        model.examine = Box::new(examine);
        Ok(model)
    },
};
