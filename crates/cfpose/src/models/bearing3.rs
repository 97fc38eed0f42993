//! 3D-to-2D: (R M + T) / norm(R M + T) against m' / norm(m').

use cfpose_kernel::map::Factored;
use cfpose_kernel::scalar::Scalar;

use super::shared::pose3::{Posed, half_turned, mirrored_tilt};
use super::shared::projective::{RELATION, area_element, area_of, perspective, projective};
use super::shared::scene;
use crate::entry::ParameterSpec;
use crate::geometry::theta::Layout;
use crate::model::{Findings, Map, ModelEntry, PointKind, Relations, Scene, unit3};

/// The pose of a surface with normals: lift(M) = (M, n), y = (R M + T, R n), weights abs(n . X) / z^3.
struct Surface;

/// Return (R M + T, R n) as six rows of A and b.
fn surface_affine<S: Scalar>(theta: &[S], a: &mut [S], b: &mut [S]) {
    for i in 0..3 {
        for k in 0..3 {
            a[6 * i + k] = theta[3 * i + k];
            a[6 * (3 + i) + 3 + k] = theta[3 * i + k];
        }
        b[i] = theta[9 + i];
    }
}

/// Return abs(n . X) / z^3, and 0 behind the camera.
#[inline(always)]
fn surface_element<S: Scalar>(y: [S; 6]) -> S {
    (y[0] * y[3] + y[1] * y[4] + y[2] * y[5]).abs() * area_element(y[2])
}

fn lift_surface(point: [f64; 3], normal: [f64; 3], out: &mut [f64]) {
    out[..3].copy_from_slice(&point);
    out[3..].copy_from_slice(&normal);
}

/// Two relations of the same surface: sphere ([`Map`] into 3 dimensions) and plane (into 2).
macro_rules! surface_map {
    ($dim:literal, $project:expr) => {
        impl Map<3, 6, $dim> for Surface {
            fn lift_len(&self) -> usize {
                6
            }
            fn attribute(&self) -> Option<&'static str> {
                Some("normal")
            }
            fn lift(&self, point: [f64; 3], out: &mut [f64]) {
                lift_surface(point, [0.0; 3], out);
            }
            fn lift_with(&self, point: [f64; 3], normal: [f64; 3], out: &mut [f64]) {
                lift_surface(point, normal, out);
            }
            fn affine<S: Scalar>(&self, theta: &[S], a: &mut [S], b: &mut [S]) {
                surface_affine(theta, a, b);
            }
            #[inline(always)]
            fn project<S: Scalar>(&self, y: [S; 6]) -> [S; $dim] {
                $project([y[0], y[1], y[2]])
            }
            #[inline(always)]
            fn density<S: Scalar>(&self, y: [S; 6]) -> Option<S> {
                Some(surface_element(y))
            }
        }
    };
}
surface_map!(3, unit3);
surface_map!(2, perspective);

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

pub(super) const ENTRY: ModelEntry = ModelEntry {
    name: "bearing3",
    summary: "3-D points to rays of a calibrated camera: (R M + T) / norm",
    parameters: &[
        RELATION,
        ParameterSpec {
            name: "area",
            default: "off",
            meaning: "on: weight source points by abs(n . X) / z^3 with their attribute `normal`, for target masks filled uniformly; off: as they are",
        },
    ],
    source: "eq. 3dto2d",
    details: "h(M, theta) = (R M + T) / norm(R M + T) against m' / norm(m') (relation `sphere`), or the image points after perspective division (relation `plane`). theta: rotation vector (rad), translation (units of the source). The target holds image points (x, y) or rays (x, y, z). Degenerate when the camera centre lies in the cloud, or all rays are equal; a flat source has a mirrored tilt of nearly equal cost where perspective is weak. Converges from 0.1 (radians and source units at depth 2).",
    build: |parameters, _| {
        let mut model = projective("bearing3", Layout::pose3(), Posed, parameters, false, PointKind::Plain(3))?;
        if area_of(parameters)? {
            model.source = match model.dim() {
                3 => Box::new(Factored::<_, 3, 6, 3>::new(Surface)),
                _ => Box::new(Factored::<_, 3, 6, 2>::new(Surface)),
            };
            model.relations = Some(Relations {
                sphere: "bearing3[area=on]".to_string(),
                plane: "bearing3[relation=plane,area=on]".to_string(),
            });
        }
        model.typical[11] = 2.0; // the scene in front of the camera
        model.examine = Box::new(examine);
        Ok(model)
    },
};
