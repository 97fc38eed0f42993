//! What the projective models share: the unit-sphere relation, the image-plane relation, and the area element.

use cfpose_kernel::map::Factored;
use cfpose_kernel::scalar::Scalar;

use crate::entry::{EntryError, ParameterSpec, Parameters};
use crate::geometry::theta::Layout;
use crate::model::{Map, Model, PointKind, Relations, TargetSide, UnitRay, unit3};

/// Depth below which a point has no image.
const MIN_DEPTH: f64 = 1e-9;

/// The linear part y = A(theta) m + b(theta) of a projective model.
pub trait Linear: Copy + Send + Sync + 'static {
    /// Write A (3 x 3, row by row) and b; both arrive filled with zeros.
    fn affine<S: Scalar>(&self, theta: &[S], a: &mut [S], b: &mut [S]);
}

/// The relation y / norm(y), the paper's.
struct OnSphere<L> {
    linear: L,
    area: bool,
}

/// The relation (y_1, y_2) / y_3; points behind the camera get weight 0.
struct OnPlane<L> {
    linear: L,
    area: bool,
}

/// Return 1 / depth^3, the area element of a plane and of any homography up to a factor, and 0 behind the camera.
#[inline(always)]
pub fn area_element<S: Scalar>(depth: S) -> S {
    let (limit, one) = (depth.constant(MIN_DEPTH), depth.constant(1.0));
    let inverse = depth.select_less(limit, one, depth).recip();
    depth.select_less(limit, depth.constant(0.0), inverse * inverse * inverse)
}

impl<L: Linear> Map<3, 3, 3> for OnSphere<L> {
    fn affine<S: Scalar>(&self, theta: &[S], a: &mut [S], b: &mut [S]) {
        self.linear.affine(theta, a, b);
    }
    #[inline(always)]
    fn project<S: Scalar>(&self, y: [S; 3]) -> [S; 3] {
        unit3(y)
    }
    #[inline(always)]
    fn density<S: Scalar>(&self, y: [S; 3]) -> Option<S> {
        if self.area { Some(area_element(y[2])) } else { None }
    }
}

impl<L: Linear> Map<3, 3, 2> for OnPlane<L> {
    fn affine<S: Scalar>(&self, theta: &[S], a: &mut [S], b: &mut [S]) {
        self.linear.affine(theta, a, b);
    }
    #[inline(always)]
    fn project<S: Scalar>(&self, y: [S; 3]) -> [S; 2] {
        perspective(y)
    }
    #[inline(always)]
    fn density<S: Scalar>(&self, y: [S; 3]) -> Option<S> {
        if self.area {
            return Some(area_element(y[2]));
        }
        let (zero, one) = (y[2].constant(0.0), y[2].constant(1.0));
        Some(y[2].select_less(y[2].constant(MIN_DEPTH), zero, one))
    }
}

/// Divide by the depth; behind the camera the numbers are finite and mean nothing.
#[inline(always)]
pub fn perspective<S: Scalar>(y: [S; 3]) -> [S; 2] {
    let (limit, one) = (y[2].constant(MIN_DEPTH), y[2].constant(1.0));
    let inverse = y[2].select_less(limit, one, y[2]).recip();
    [y[0] * inverse, y[1] * inverse]
}

/// The identity, as the target side of the image-plane relation.
#[derive(Clone, Copy)]
struct Unmoved;

impl Linear for Unmoved {
    fn affine<S: Scalar>(&self, theta: &[S], a: &mut [S], _b: &mut [S]) {
        for i in 0..3 {
            a[4 * i] = theta[0].constant(1.0);
        }
    }
}

/// Which relation the model matches.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Relation {
    Sphere,
    Plane,
}

/// The parameter `relation`.
pub const RELATION: ParameterSpec = ParameterSpec {
    name: "relation",
    default: "sphere",
    meaning: "sphere: unit rays, the paper's; plane: image points (perspective division, points behind the camera get weight 0)",
};

/// The parameter `area` of plane scenes.
pub const AREA: ParameterSpec = ParameterSpec {
    name: "area",
    default: "off",
    meaning: "on: weight source points by the area element 1/z^3, for both sides filled uniformly (masks); off: as they are",
};

/// Return whether the parameter `area` is on.
pub fn area_of(parameters: &Parameters) -> Result<bool, EntryError> {
    parameters.choice("area", &[("off", false), ("on", true)])
}

/// Build the projective model `name` from its linear part and the parameters `relation` and, where declared, `area`.
pub fn projective<L: Linear>(
    name: &str,
    layout: Layout,
    linear: L,
    parameters: &Parameters,
    area: bool,
    source: PointKind,
) -> Result<Model, EntryError> {
    let choices = [("sphere", Relation::Sphere), ("plane", Relation::Plane)];
    let model = match parameters.choice("relation", &choices)? {
        Relation::Sphere => Model::new(layout, OnSphere { linear, area }).with_target(UnitRay),
        Relation::Plane => {
            let target = OnPlane { linear: Unmoved, area: false };
            let source = Box::new(Factored::new(OnPlane { linear, area }));
            Model::from_sides(layout, source, TargetSide::Fixed(Box::new(Factored::new(target))))
        }
    };
    let variant = |relation: &str| match area {
        true => format!("{name}[relation={relation},area=on]"),
        false => format!("{name}[relation={relation}]"),
    };
    let mut model = model.with_points(source, PointKind::Homogeneous);
    model.relations = Some(Relations { sphere: variant("sphere"), plane: variant("plane") });
    Ok(model)
}
