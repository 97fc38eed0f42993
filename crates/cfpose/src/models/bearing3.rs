//! 3D-to-2D: (R M + T) / norm(R M + T) against m' / norm(m').

use super::projective::{Linear, RELATION, area_element, area_of, perspective, projective};
use super::rigid3::{half_turned, pose_affine};
use super::scene;
use crate::block::Factored;
use crate::entry::ParameterSpec;
use crate::model::{Findings, Map, ModelEntry, PointKind, Relations, Scene, unit3};
use crate::scalar::Scalar;
use crate::theta::Layout;

/// y = R M + T.
#[derive(Clone, Copy)]
pub(super) struct Posed;

impl Linear for Posed {
    fn affine<S: Scalar>(&self, theta: &[S], a: &mut [S], b: &mut [S]) {
        pose_affine(theta, a, b);
    }
}

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

/// Return the mirrored tilt of a flat scene, of equal cost where perspective is weak: y - c -> (I - 2 v v')(y - c) along the
/// line of sight v through the mean c, after the reflection I - 2 n n' in the scene's plane, which leaves it as it is.
pub(super) fn mirrored_tilt(theta: &[f64], mean: [f64; 3], normal: [f64; 3]) -> Option<Vec<f64>> {
    let mut centre = [theta[9], theta[10], theta[11]];
    for i in 0..3 {
        centre[i] += (0..3).map(|k| theta[3 * i + k] * mean[k]).sum::<f64>();
    }
    let size = centre.iter().map(|value| value * value).sum::<f64>().sqrt();
    let sight = centre.map(|value| value / size);
    let reflection = |v: [f64; 3]| {
        let mut m = [0.0; 9];
        for i in 0..3 {
            for k in 0..3 {
                m[3 * i + k] = f64::from(u8::from(i == k)) - 2.0 * v[i] * v[k];
            }
        }
        m
    };
    let half = cfpose_optim::manifold::multiply3(&reflection(sight), &theta[..9]);
    let rotation = cfpose_optim::manifold::multiply3(&half, &reflection(normal));
    let mut other = rotation.to_vec();
    other.extend((0..3).map(|i| centre[i] - (0..3).map(|k| rotation[3 * i + k] * mean[k]).sum::<f64>()));
    other.iter().all(|value| value.is_finite()).then_some(other)
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
