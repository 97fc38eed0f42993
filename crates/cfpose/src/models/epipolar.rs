//! 2D-to-2D without a plane: [T]x R m / norm against [T]x m' / norm; both sides move with theta.
//!
//! Both vectors are orthogonal to T, so the feature space is a circle: coordinates are taken in an orthonormal basis
//! (e1, e2) of the plane orthogonal to T, in which [T]x v has the coordinates (-e2'v, e1'v).

use std::sync::Arc;

use cfpose_kernel::points::Points;
use cfpose_kernel::scalar::Scalar;
use cfpose_optim::manifold::norm3;

use crate::entry::ParameterSpec;
use crate::geometry::theta::{BlockKind, Layout};
use crate::model::ResidualRows;
use crate::model::{Basin, Findings, Map, Model, ModelEntry, PointKind, Scene, unit3};

/// h of eq. `2dto2d` (rows times R) or g (rows alone).
struct Epipolar {
    rotate: bool,
    /// Whether norm(T) = 1 by the manifold; else T is divided by its norm here.
    unit: bool,
}

/// norm(T)^2 - 1, for the treatments of norm(T) = 1 other than the manifold.
struct UnitNorm;

impl ResidualRows for UnitNorm {
    fn num_rows(&self) -> usize {
        1
    }
    fn rows<S: Scalar>(&self, theta: &[S], out: &mut [S]) {
        out[0] = theta[9] * theta[9] + theta[10] * theta[10] + theta[11] * theta[11] - 1.0;
    }
}

/// Return the two rows that give the coordinates of [T]x v (basis of Duff et al. 2017, branchless by sign of T_z).
///
/// The sign of T_z chooses one of two charts; both sides of the equation switch together.
fn circle_rows<S: Scalar>(t: &[S]) -> [[S; 3]; 2] {
    let one = t[2].constant(1.0);
    let sign = t[2].select_less(t[2].constant(0.0), -one, one);
    let a = -(sign + t[2]).recip();
    let b = t[0] * t[1] * a;
    let e1 = [sign * t[0] * t[0] * a + 1.0, sign * b, -(sign * t[0])];
    let e2 = [b, sign + t[1] * t[1] * a, -t[1]];
    [[-e2[0], -e2[1], -e2[2]], e1]
}

impl Map<3, 2, 2> for Epipolar {
    fn affine<S: Scalar>(&self, theta: &[S], a: &mut [S], _b: &mut [S]) {
        let mut t = [theta[9], theta[10], theta[11]];
        if !self.unit {
            t = unit3(t);
        }
        let rows = circle_rows(&t);
        for (r, row) in rows.iter().enumerate() {
            for k in 0..3 {
                a[3 * r + k] = if self.rotate {
                    row[0] * theta[k] + row[1] * theta[3 + k] + row[2] * theta[6 + k]
                } else {
                    row[k]
                };
            }
        }
    }
    #[inline(always)]
    fn project<S: Scalar>(&self, y: [S; 2]) -> [S; 2] {
        let scale = (y[0] * y[0] + y[1] * y[1]).sqrt().recip();
        [y[0] * scale, y[1] * scale]
    }
}

/// How norm(T) = 1 is kept.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Norm {
    Manifold,
    Penalty,
    Constraint,
}

/// Return weighted mean and variance of the angle between the rays of a point set and T, R' T for the first camera's rays.
fn angles_to(points: &Points, axis: [f64; 3]) -> (f64, f64) {
    let angle = |k: usize| {
        let m = points.point(k);
        let along: f64 = (0..3).map(|i| m[i] * axis[i]).sum();
        (along / norm3(&m)).clamp(-1.0, 1.0).acos()
    };
    let total: f64 = points.weights().iter().sum();
    let mean =
        |f: &dyn Fn(usize) -> f64| points.weights().iter().enumerate().map(|(k, w)| w * f(k)).sum::<f64>() / total;
    let centre = mean(&angle);
    (centre, mean(&|k| (angle(k) - centre).powi(2)))
}

/// Resolve the sign of T by positive depth, without correspondences.
///
/// lambda' m' = lambda R m + T with positive depths puts m' between R m and T, so each point's angle to T shrinks, and so does
/// the mean over all points. Undetermined where the change is within what the different sizes of the two sets explain.
fn examine(scene: &Scene<'_>) -> Findings {
    let theta = scene.theta;
    let t = [theta[9], theta[10], theta[11]];
    let turned = [0, 1, 2].map(|k| (0..3).map(|i| theta[3 * i + k] * t[i]).sum::<f64>());
    let (before, variance_before) = angles_to(scene.source, turned);
    let (after, variance_after) = angles_to(scene.target, t);
    let (num_source, num_target) = (scene.source.len() as f64, scene.target.len() as f64);
    let thinned = (num_source.recip() - num_target.recip()).abs();
    let limit = 3.0 * (thinned * variance_before.max(variance_after)).sqrt() + 1e-6;
    let opposite: Vec<f64> = theta[..9].iter().copied().chain(t.map(|value| -value)).collect();
    let change = before - after;
    if change > limit {
        Findings::default()
    } else if change < -limit {
        Findings { theta: Some(opposite), ..Findings::default() }
    } else {
        let warning = "the sign of T is undetermined: the points move neither towards T nor away from it";
        Findings { candidates: vec![opposite], warnings: vec![warning.to_string()], ..Findings::default() }
    }
}

pub(super) const ENTRY: ModelEntry = ModelEntry {
    name: "epipolar",
    summary: "two images of a general scene: [T]x R m / norm against [T]x m' / norm, norm(T) = 1",
    parameters: &[ParameterSpec {
        name: "norm",
        default: "manifold",
        meaning: "how norm(T) = 1 is kept: manifold (S^2), penalty (a residual row), constraint (needs a solver with constraints)",
    }],
    source: "eq. 2dto2d",
    details: "h(m, theta) = [T]x R m / norm against g(m', theta) = [T]x m' / norm, as coordinates on the circle orthogonal to T. theta: rotation vector (rad), unit T. The cost does not know the sign of T: positive depth decides (the mean angle to T shrinks), and where it cannot, -T is listed as an alternative. Degenerate for pure rotations (T = 0) and for points of one plane through both centres. Each point gives one angle only: use many angular harmonics. Converges from 0.03 with 32 of them (radians).",
    build: |parameters, _| {
        let choices = [("manifold", Norm::Manifold), ("penalty", Norm::Penalty), ("constraint", Norm::Constraint)];
        let norm = parameters.choice("norm", &choices)?;
        let unit = norm == Norm::Manifold;
        let kind = if unit { BlockKind::Direction(3) } else { BlockKind::Vector(3) };
        let layout = Layout::new(&[("rotation", "rad", BlockKind::Rotation), ("translation", "1", kind)]);
        let mut model = Model::new(layout, Epipolar { rotate: true, unit })
            .with_moving_target(Epipolar { rotate: false, unit })
            .with_points(PointKind::Homogeneous, PointKind::Homogeneous);
        if norm == Norm::Penalty {
            model.regulariser = Some(Arc::new(UnitNorm));
        }
        if norm == Norm::Constraint {
            model.equality = Some(Arc::new(UnitNorm));
        }
        model.identity[9..].copy_from_slice(&[1.0, 0.0, 0.0]);
        model.typical[9..].copy_from_slice(&[1.0, 0.0, 0.0]);
        model.normaliser = Some("none");
        // The valley is curved and narrow: damped first steps leave its floor and crawl back, Gauss-Newton's do not.
        model.solver = Some("levenberg-marquardt[initial-damping=1e-8]");
        model.examine = Box::new(examine);
        model.basin = Basin { features: "angular[harmonics=32]", distance: 0.03 };
        Ok(model)
    },
};
