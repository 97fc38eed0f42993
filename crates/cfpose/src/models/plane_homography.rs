//! 2D-to-2D of a plane scene: (R + T n'/d) m / norm against m' / norm(m'), eq. `plane`.

use cfpose_kernel::scalar::Scalar;

use super::shared::projective::{AREA, Linear, RELATION, area_of, projective};
use super::shared::scene;
use crate::geometry::homography::{PlaneMotion, decompose};
use crate::geometry::theta::{BlockKind, Layout};
use crate::model::{Findings, ModelEntry, PointKind, Scene};

/// A = R + (T/d) n' from theta = (R, T/d, n).
#[derive(Clone, Copy)]
struct PlaneInduced;

impl Linear for PlaneInduced {
    fn affine<S: Scalar>(&self, theta: &[S], a: &mut [S], _b: &mut [S]) {
        for i in 0..3 {
            for k in 0..3 {
                a[3 * i + k] = theta[3 * i + k] + theta[9 + i] * theta[12 + k];
            }
        }
    }
}

/// Return R + (T/d) n', row by row.
fn matrix(theta: &[f64]) -> [f64; 9] {
    let mut h = [0.0; 9];
    for i in 0..3 {
        for k in 0..3 {
            h[3 * i + k] = theta[3 * i + k] + theta[9 + i] * theta[12 + k];
        }
    }
    h
}

fn flat(motion: &PlaneMotion) -> Vec<f64> {
    [&motion.rotation[..], &motion.translation[..], &motion.normal[..]].concat()
}

/// Turn (T, n) into (-T, -n) where the plane would lie behind, name the other decomposition, and say when there is no plane.
fn examine(scene: &Scene<'_>) -> Findings {
    let (theta, mean) = (scene.theta, scene.source.mean());
    let mut findings = Findings::default();
    let h = matrix(theta);
    let (warnings, implausible) = scene::depth_warnings(scene.source, |m| h[6] * m[0] + h[7] * m[1] + h[8] * m[2]);
    findings.warnings = warnings;
    findings.implausible = implausible;
    if scene::spread_rank(scene.source) < 2 {
        findings.warnings.push("the source lies on a line: what the homography does across it is undetermined".into());
    }
    if (0..3).map(|i| theta[12 + i] * mean[i]).sum::<f64>() < 0.0 {
        let opposite = theta[9..].iter().map(|value| -value);
        findings.theta = Some(theta[..9].iter().copied().chain(opposite).collect());
    }
    let size = theta[9..12].iter().map(|value| value * value).sum::<f64>().sqrt();
    if size < 1e-6 {
        findings.warnings.push(format!("T/d is {size:.1e}: the camera only turned, the plane normal is undetermined"));
        return findings;
    }
    findings.candidates = decompose(&h, &mean).solutions.iter().map(flat).collect();
    findings
}

pub(super) const ENTRY: ModelEntry = ModelEntry {
    name: "plane-homography",
    summary: "two images of a plane: (R + T n'/d) m / norm against m' / norm, n a unit normal",
    parameters: &[RELATION, AREA],
    source: "eq. plane",
    details: "h(m, theta) = (R + (T/d) n') m / norm against m' / norm(m') (relation `sphere`), or the image points after perspective division (relation `plane`). theta: rotation vector (rad), T/d (plane distances), unit normal n in the frame of the first camera, n'm > 0. A second (R, T/d, n) of the same homography always exists for T/d not parallel to n and is listed as an alternative. Degenerate when T = 0: n is undetermined. Converges from 0.1 (radians, plane distances).",
    build: |parameters, _| {
        let layout = Layout::new(&[
            ("rotation", "rad", BlockKind::Rotation),
            ("translation", "plane distances", BlockKind::Vector(3)),
            ("normal", "1", BlockKind::Direction(3)),
        ]);
        let area = area_of(parameters)?;
        let mut model = projective("plane-homography", layout, PlaneInduced, parameters, area, PointKind::Homogeneous)?;
        // The plane z = d, seen frontally.
        model.identity[12..].copy_from_slice(&[0.0, 0.0, 1.0]);
        model.typical = model.identity.clone();
        model.typical[9..].copy_from_slice(&[0.6, -0.4, 0.3, 0.36, 0.48, 0.8]);
        model.examine = Box::new(examine);
        model.homography = Some(matrix);
        Ok(model)
    },
};
