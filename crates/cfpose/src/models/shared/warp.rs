//! What the nonlinear plane maps share: x = sum_i c_i B_i(p) for a basis B that does not depend on theta.

use cfpose_kernel::scalar::Scalar;

use crate::entry::ParameterSpec;
use crate::geometry::theta::{BlockKind, Layout};
use crate::model::{Basin, Findings, LinearGroup, LinearKind, Map, Model, Scene};

use super::scene;

/// The parameter `area` of plane maps.
pub const AREA: ParameterSpec = ParameterSpec {
    name: "area",
    default: "off",
    meaning: "on: weight source points by the area element abs(det dh/dp), for both sides filled uniformly (masks); off: as they are",
};

/// A basis of functions of the plane.
pub trait PlaneBasis: Clone + Send + Sync + 'static {
    /// Return the number of functions.
    fn num_terms(&self) -> usize;

    /// Write the functions at p.
    fn values(&self, p: [f64; 2], out: &mut [f64]);

    /// Write their derivatives along x and along y.
    fn gradients(&self, p: [f64; 2], along_x: &mut [f64], along_y: &mut [f64]);

    /// Return the coefficients of c_0 + c_1 x + c_2 y.
    fn of_linear(&self, constant: f64, slopes: [f64; 2]) -> Vec<f64>;
}

/// Write the coefficients of both coordinates, each into its row of A.
fn coefficient_rows<S: Scalar>(theta: &[S], k: usize, width: usize, a: &mut [S]) {
    for row in 0..2 {
        a[row * width..row * width + k].copy_from_slice(&theta[row * k..(row + 1) * k]);
    }
}

/// The map alone.
struct Warp<B>(B);

impl<B: PlaneBasis> Map<2, 2, 2> for Warp<B> {
    const PROJECTION_IS_IDENTITY: bool = true;
    fn lift_len(&self) -> usize {
        self.0.num_terms()
    }
    fn lift(&self, p: [f64; 2], out: &mut [f64]) {
        self.0.values(p, out);
    }
    fn affine<S: Scalar>(&self, theta: &[S], a: &mut [S], _b: &mut [S]) {
        let k = self.0.num_terms();
        coefficient_rows(theta, k, k, a);
    }
    #[inline(always)]
    fn project<S: Scalar>(&self, y: [S; 2]) -> [S; 2] {
        y
    }
}

/// The map and its derivatives: lift(p) = (B, dB/dx, dB/dy), y = (x', y', dx'/dx, dx'/dy, dy'/dx, dy'/dy).
struct AreaWarp<B>(B);

impl<B: PlaneBasis> Map<2, 6, 2> for AreaWarp<B> {
    fn lift_len(&self) -> usize {
        3 * self.0.num_terms()
    }
    fn lift(&self, p: [f64; 2], out: &mut [f64]) {
        let (values, gradients) = out.split_at_mut(self.0.num_terms());
        let (along_x, along_y) = gradients.split_at_mut(self.0.num_terms());
        self.0.values(p, values);
        self.0.gradients(p, along_x, along_y);
    }
    fn affine<S: Scalar>(&self, theta: &[S], a: &mut [S], _b: &mut [S]) {
        let k = self.0.num_terms();
        coefficient_rows(theta, k, 3 * k, a);
        for coordinate in 0..2 {
            for derivative in 0..2 {
                let start = (2 + 2 * coordinate + derivative) * 3 * k + (1 + derivative) * k;
                a[start..start + k].copy_from_slice(&theta[coordinate * k..(coordinate + 1) * k]);
            }
        }
    }
    #[inline(always)]
    fn project<S: Scalar>(&self, y: [S; 6]) -> [S; 2] {
        [y[0], y[1]]
    }
    #[inline(always)]
    fn density<S: Scalar>(&self, y: [S; 6]) -> Option<S> {
        Some((y[2] * y[5] - y[3] * y[4]).abs())
    }
}

/// Report where the map turns the plane over.
fn folds<B: PlaneBasis>(basis: &B, scene: &Scene<'_>) -> Option<String> {
    let k = basis.num_terms();
    let (mut along_x, mut along_y) = (vec![0.0; k], vec![0.0; k]);
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
    let mut negative = 0;
    for index in 0..scene.source.len() {
        let p = scene.source.point(index);
        basis.gradients([p[0], p[1]], &mut along_x, &mut along_y);
        let (x, y) = (&scene.theta[..k], &scene.theta[k..]);
        let determinant = dot(x, &along_x) * dot(y, &along_y) - dot(x, &along_y) * dot(y, &along_x);
        negative += usize::from(determinant <= 0.0);
    }
    let count = scene.source.len();
    match negative {
        0 => None,
        _ if negative == count => Some("the map reverses orientation everywhere: a mirror image".to_string()),
        _ => Some(format!("the map folds: it reverses orientation at {negative} of {count} points")),
    }
}

/// Build the model of a basis; theta holds the coefficients of x, then those of y.
pub fn warp<B: PlaneBasis>(basis: B, area: bool, basin: Basin) -> Model {
    let k = basis.num_terms();
    let layout = Layout::new(&[("coefficients", "target units", BlockKind::Vector(2 * k))]);
    let mut model =
        if area { Model::new(layout, AreaWarp(basis.clone())) } else { Model::new(layout, Warp(basis.clone())) };
    let of_affine = {
        let basis = basis.clone();
        move |a: &[f64], b: &[f64]| [basis.of_linear(b[0], [a[0], a[1]]), basis.of_linear(b[1], [a[2], a[3]])].concat()
    };
    model.identity = of_affine(&[1.0, 0.0, 0.0, 1.0], &[0.0, 0.0]);
    model.typical = of_affine(&[1.1, -0.2, 0.3, 0.9], &[0.1, -0.2]);
    model.basin = basin;
    model.linear = Some(LinearGroup { kind: LinearKind::General, dim: 2, theta: Box::new(of_affine) });
    model.examine = Box::new(move |scene| {
        let mut warnings = scene::spread_warnings(scene.source, 2, 2);
        warnings.extend(folds(&basis, scene));
        Findings { warnings, ..Findings::default() }
    });
    model
}
