//! What an author of a map writes: one side of the equation, over [`Scalar`].

use crate::scalar::Scalar;

/// One side of the equation in factored form, `x = project(A(theta) * lift(p) + b(theta))`.
///
/// `POINT` is the dimension of the points, `ROWS` the number of rows of A, `DIM` the dimension of the feature space (1 to 3).
/// Nothing else is needed: Jacobians and Hessians come from automatic differentiation through these functions.
/// Mark `project` and `density` `#[inline(always)]` and write plain index loops there: they run once per point on lanes.
pub trait Map<const POINT: usize, const ROWS: usize, const DIM: usize>: Send + Sync + 'static {
    /// Whether `project` returns the first `DIM` of its `ROWS` arguments unchanged: data for the fast paths.
    const PROJECTION_IS_IDENTITY: bool = false;

    /// Return the length of a lifted point.
    fn lift_len(&self) -> usize {
        POINT
    }

    /// Write the lifted point: independent of theta, run once per point set. Identity by default.
    fn lift(&self, point: [f64; POINT], out: &mut [f64]) {
        out.copy_from_slice(&point);
    }

    /// Name of the vector attribute (3 numbers a point) that [`Map::lift_with`] reads; none by default.
    fn attribute(&self) -> Option<&'static str> {
        None
    }

    /// Write the lifted point of a map that reads an attribute; [`Map::lift`] by default.
    fn lift_with(&self, point: [f64; POINT], _attribute: [f64; 3], out: &mut [f64]) {
        self.lift(point, out);
    }

    /// Write A (`ROWS` x lift_len, row by row) and b (`ROWS`) from ambient theta; both arrive filled with zeros.
    fn affine<S: Scalar>(&self, theta: &[S], a: &mut [S], b: &mut [S]);

    /// Project into the feature space.
    fn project<S: Scalar>(&self, y: [S; ROWS]) -> [S; DIM];

    /// Return the area element that multiplies a point's weight (docs/adding/model.md, *What else a model can say*), `None` where it is constant.
    fn density<S: Scalar>(&self, _y: [S; ROWS]) -> Option<S> {
        None
    }
}

/// One side of the equation in fully general form: any function of theta and the point.
///
/// About four times slower than a [`Map`], since theta's derivatives run through every point.
pub trait PointMap<const POINT: usize, const DIM: usize>: Send + Sync + 'static {
    /// Map a point into the feature space.
    fn map<S: Scalar>(&self, theta: &[S], point: [S; POINT]) -> [S; DIM];

    /// Return the area element that multiplies a point's weight, `None` where it is constant.
    fn density<S: Scalar>(&self, _theta: &[S], _point: [S; POINT]) -> Option<S> {
        None
    }
}

/// The identity map of dimension D: the target side of most models.
#[derive(Debug, Clone, Copy)]
pub struct Identity;

impl<const D: usize> Map<D, D, D> for Identity {
    const PROJECTION_IS_IDENTITY: bool = true;
    fn affine<S: Scalar>(&self, theta: &[S], a: &mut [S], _b: &mut [S]) {
        for i in 0..D {
            a[i * D + i] = theta[0].constant(1.0);
        }
    }
    #[inline(always)]
    fn project<S: Scalar>(&self, y: [S; D]) -> [S; D] {
        y
    }
}

/// Normalise rays to unit norm: the target side m' / norm(m') of eq. `3dto2d`.
#[derive(Debug, Clone, Copy)]
pub struct UnitRay;

impl Map<3, 3, 3> for UnitRay {
    fn affine<S: Scalar>(&self, theta: &[S], a: &mut [S], b: &mut [S]) {
        Map::<3, 3, 3>::affine(&Identity, theta, a, b);
    }
    #[inline(always)]
    fn project<S: Scalar>(&self, y: [S; 3]) -> [S; 3] {
        unit3(y)
    }
}

/// Return y / norm(y).
#[inline(always)]
pub fn unit3<S: Scalar>(y: [S; 3]) -> [S; 3] {
    let scale = (y[0] * y[0] + y[1] * y[1] + y[2] * y[2]).sqrt().recip();
    [y[0] * scale, y[1] * scale, y[2] * scale]
}
