//! 2D-to-2D: polynomials of bounded degree in both coordinates.

use super::shared::projective::area_of;
use super::shared::warp::{AREA, PlaneBasis, warp};
use crate::entry::ParameterSpec;
use crate::model::{Basin, ModelEntry};

/// Monomials x^u y^v by degree u + v, then by falling power of x: 1, x, y, x^2, x y, y^2, ...
#[derive(Clone)]
struct Monomials {
    degree: usize,
}

impl Monomials {
    fn exponents(&self) -> impl Iterator<Item = (i32, i32)> {
        (0..=self.degree as i32).flat_map(|degree| (0..=degree).map(move |v| (degree - v, v)))
    }
}

impl PlaneBasis for Monomials {
    fn num_terms(&self) -> usize {
        (self.degree + 1) * (self.degree + 2) / 2
    }
    fn values(&self, p: [f64; 2], out: &mut [f64]) {
        for (value, (u, v)) in out.iter_mut().zip(self.exponents()) {
            *value = p[0].powi(u) * p[1].powi(v);
        }
    }
    fn gradients(&self, p: [f64; 2], along_x: &mut [f64], along_y: &mut [f64]) {
        for (i, (u, v)) in self.exponents().enumerate() {
            along_x[i] = if u > 0 { f64::from(u) * p[0].powi(u - 1) * p[1].powi(v) } else { 0.0 };
            along_y[i] = if v > 0 { f64::from(v) * p[0].powi(u) * p[1].powi(v - 1) } else { 0.0 };
        }
    }
    fn of_linear(&self, constant: f64, slopes: [f64; 2]) -> Vec<f64> {
        let mut coefficients = vec![0.0; self.num_terms()];
        coefficients[..3].copy_from_slice(&[constant, slopes[0], slopes[1]]);
        coefficients
    }
}

pub(super) const ENTRY: ModelEntry = ModelEntry {
    name: "polynomial2",
    summary: "2-D to 2-D polynomial map of bounded degree",
    parameters: &[ParameterSpec { name: "degree", default: "2", meaning: "total degree, 1 to 6" }, AREA],
    source: "Domokos, Nemeth and Kato 2012, nonlinear shape registration without correspondences",
    details: "h(p, theta) = sum_i c_i p^e_i. theta: the coefficients of x', then those of y', each in the order 1, x, y, x^2, x y, y^2, ... (by degree, then falling power of x); units: target per source to that power, so bring the points to unit size. Degenerate when the points lie on a curve of that degree; folds (a negative area element) are reported. Needs a family of more functions than unknowns: (degree + 1)(degree + 2). Converges from 0.1 (coefficients, shape of unit size); `whitened-affine` proposes starts.",
    build: |parameters, _| {
        let degree = parameters.count("degree", 1, 6)?;
        // A family of total degree D has (D + 1)(D + 2)/2 - 1 functions: twice the unknowns and more.
        let features = match degree {
            1 | 2 => "hermite[degree=5]",
            3 => "hermite[degree=7]",
            _ => "hermite[degree=8]",
        };
        Ok(warp(Monomials { degree }, area_of(parameters)?, Basin { features, distance: 0.1 }))
    },
};
