//! 2D-to-2D of a plane scene, unstructured: H m / norm(H m) against m' / norm(m'), norm(H) = 1.

use cfpose_kernel::scalar::Scalar;
use cfpose_optim::manifold::determinant3;

use super::shared::projective::{AREA, Linear, RELATION, area_of, projective};
use super::shared::scene;
use crate::geometry::theta::{BlockKind, Layout};
use crate::model::{Findings, LinearGroup, LinearKind, ModelEntry, PointKind, Scene};

#[derive(Clone, Copy)]
struct Homography;

impl Linear for Homography {
    fn affine<S: Scalar>(&self, theta: &[S], a: &mut [S], _b: &mut [S]) {
        a.copy_from_slice(&theta[..9]);
    }
}

/// Return the norm-1 homography of a plane affine map.
fn of_affine(a: &[f64], b: &[f64]) -> Vec<f64> {
    let mut h = vec![a[0], a[1], b[0], a[2], a[3], b[1], 0.0, 0.0, 1.0];
    let norm = h.iter().map(|value| value * value).sum::<f64>().sqrt();
    h.iter_mut().for_each(|value| *value /= norm);
    h
}

fn examine(scene: &Scene<'_>) -> Findings {
    let h = scene.theta;
    let mut findings = Findings::default();
    let (warnings, implausible) = scene::depth_warnings(scene.source, |m| h[6] * m[0] + h[7] * m[1] + h[8] * m[2]);
    findings.warnings = warnings;
    findings.implausible = implausible;
    // Image points (x, y, 1) lie in a plane of R^3 by construction: two directions of spread are all there are.
    if scene::spread_rank(scene.source) < 2 {
        findings.warnings.push("the source lies on a line: what the homography does across it is undetermined".into());
    }
    if determinant3(h) < 0.0 {
        findings.warnings.push("det H < 0: a mirror image, which no camera in front of the plane sees".into());
    }
    findings
}

pub(super) const ENTRY: ModelEntry = ModelEntry {
    name: "homography",
    summary: "two images of a plane, unstructured: H m / norm against m' / norm, norm(H) = 1",
    parameters: &[RELATION, AREA],
    source: "eq. plane, unstructured",
    details: "h(m, theta) = H m / norm(H m) against m' / norm(m') (relation `sphere`), or the image points after perspective division (relation `plane`). theta: H row by row on S^8, positive depth at the source mean. Decomposed into R, T/d, n by `homography::decompose`, both solutions with the plane in front. Degenerate when the points lie on a line, when the shape is unchanged by a homography (a conic), or when the horizon crosses the points. Converges from 0.1 (tangent of S^8, image coordinates of unit size); `whitened-affine` proposes starts.",
    build: |parameters, _| {
        let layout = Layout::new(&[("homography", "1", BlockKind::Direction(9))]);
        let area = area_of(parameters)?;
        let mut model = projective("homography", layout, Homography, parameters, area, PointKind::Homogeneous)?;
        model.identity = of_affine(&[1.0, 0.0, 0.0, 1.0], &[0.0, 0.0]);
        model.typical = model.identity.clone();
        model.examine = Box::new(examine);
        model.linear = Some(LinearGroup { kind: LinearKind::General, dim: 2, theta: Box::new(of_affine) });
        model.homography = Some(|theta| {
            let mut h = [0.0; 9];
            h.copy_from_slice(&theta[..9]);
            h
        });
        Ok(model)
    },
};
