//! The paper's simulation: as `bearing3` with the source on the plane z = 1 and T_bar = T / lambda.

use super::shared::pose3::{Posed, half_turned, mirrored_tilt};
use super::shared::projective::{AREA, RELATION, area_of, projective};
use super::shared::scene;
use crate::geometry::theta::{BlockKind, Layout};
use crate::model::{Findings, ModelEntry, PointKind, Scene};

/// Return how far the camera stands before the plane z = 1: 1 + e3' R' T_bar, negative behind it.
fn front(theta: &[f64]) -> f64 {
    1.0 + theta[2] * theta[9] + theta[5] * theta[10] + theta[8] * theta[11]
}

fn examine(scene: &Scene<'_>) -> Findings {
    let theta = scene.theta;
    let depth = |p: [f64; 3]| theta[6] * p[0] + theta[7] * p[1] + theta[8] * p[2] + theta[11];
    let (mut warnings, mut implausible) = scene::depth_warnings(scene.source, depth);
    if scene::spread_rank(scene.source) < 2 {
        warnings.push("the source lies on a line: the rotation about it is undetermined".to_string());
    }
    if front(theta) <= 0.0 {
        warnings
            .push("the camera sees the plane from behind; a mirror-symmetric pattern has such a pose too".to_string());
        implausible = true;
    }
    let mut candidates = half_turned(theta, 1.0, scene.source);
    candidates.extend(mirrored_tilt(theta, scene.source.mean(), [0.0, 0.0, 1.0]));
    Findings { candidates, warnings, implausible, ..Findings::default() }
}

pub(super) const ENTRY: ModelEntry = ModelEntry {
    name: "plane-bearing",
    summary: "image of a plane seen frontally, to rays: (R P + T_bar) / norm with P = (x, y, 1), T_bar = T / depth",
    parameters: &[RELATION, AREA],
    source: "section IV.A, eqs. Relative, Relative1, Relative2",
    details: "h(P, theta) = (R P + T_bar) / norm(R P + T_bar), P = (x, y, 1), against Q / norm(Q), Q = (x', y', 1) (relation `sphere`), or the image points after perspective division (relation `plane`). theta: rotation vector (rad), T_bar = T / depth. Degenerate when the pattern is mirror-symmetric (an exact back-side pose exists and is listed; a pose in front is preferred) or R P + T_bar passes through 0. Converges from b_i = 0.1 in about 98 of 100 trials, from 0.2 in about 73 (docs/results.md).",
    build: |parameters, _| {
        let layout =
            Layout::new(&[("rotation", "rad", BlockKind::Rotation), ("translation", "depths", BlockKind::Vector(3))]);
        let area = area_of(parameters)?;
        let mut model = projective("plane-bearing", layout, Posed, parameters, area, PointKind::Homogeneous)?;
        model.examine = Box::new(examine);
        model.homography = Some(|theta| {
            // P = (x, y, 1), so R P + T_bar = (R + T_bar e3') P.
            let mut h = [0.0; 9];
            h.copy_from_slice(&theta[..9]);
            (0..3).for_each(|i| h[3 * i + 2] += theta[9 + i]);
            h
        });
        Ok(model)
    },
};
