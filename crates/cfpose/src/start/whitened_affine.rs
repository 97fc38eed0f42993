//! Starts for affine maps: between whitened sets only a rotation is left, and rotations can be tried.

use std::f64::consts::PI;

use super::{Moments, Proposal, REFLECTIONS, StartContext, StartEntry, StartStrategy};
use super::{reflections_of, rotations, screened};
use crate::entry::ParameterSpec;
use crate::error::{Error, Side};
use crate::geometry::linalg::symmetric_eigen;
use crate::model::LinearKind;

struct WhitenedAffine {
    count: usize,
    keep: usize,
    reflections: bool,
}

/// Return the symmetric matrix with the eigenvectors of `covariance` and its eigenvalues to a power (dim x dim).
fn power(covariance: &[[f64; 3]; 3], dim: usize, exponent: f64) -> Option<Vec<f64>> {
    let (values, vectors) = symmetric_eigen(covariance, dim);
    if values[dim - 1].is_nan() || values[dim - 1] <= 1e-12 * values[0] {
        return None;
    }
    let entry = |i: usize, k: usize| {
        (0..dim).map(|axis| values[axis].powf(exponent) * vectors[axis][i] * vectors[axis][k]).sum::<f64>()
    };
    Some((0..dim * dim).map(|at| entry(at / dim, at % dim)).collect())
}

fn product(a: &[f64], b: &[f64], dim: usize) -> Vec<f64> {
    (0..dim * dim).map(|at| (0..dim).map(|k| a[at / dim * dim + k] * b[k * dim + at % dim]).sum()).collect()
}

impl StartStrategy for WhitenedAffine {
    fn name(&self) -> &'static str {
        "whitened-affine"
    }

    /// A = C_q^(1/2) R C_p^(-1/2), b = mean_q - A mean_p for a grid of R, the best of them by cost.
    fn starts(&self, context: &StartContext<'_>) -> Result<Vec<Vec<f64>>, Error> {
        let Some(group) = context.model.linear.as_ref().filter(|group| group.kind == LinearKind::General) else {
            let problem = "start `whitened-affine` needs a model that contains the affine maps; use pca or grid";
            return Err(Error::Unsupported(problem.to_string()));
        };
        let dim = group.dim;
        let moments = Moments::new(context, dim)?;
        let problem = "start `whitened-affine` needs points with extent in every direction";
        let flat = |side| move || Error::Data { side, problem: problem.to_string() };
        let unwhiten = power(&moments.target_covariance, dim, 0.5).ok_or_else(flat(Side::Target))?;
        let whiten = power(&moments.source_covariance, dim, -0.5).ok_or_else(flat(Side::Source))?;
        let mut proposals = Vec::new();
        for mirrored in [false, true] {
            if mirrored && !self.reflections {
                continue;
            }
            for mut rotation in rotations(dim, self.count, context.freedom) {
                if mirrored {
                    // Turn the last column round: R diag(1, .., -1).
                    (0..dim).for_each(|i| rotation[i * dim + dim - 1] *= -1.0);
                }
                let a = product(&product(&unwhiten, &rotation, dim), &whiten, dim);
                let theta = (group.theta)(&a, &moments.offset(&a));
                proposals.push(Proposal { rotation, theta });
            }
        }
        // Twice the spacing of the grid in the plane; a third of a right angle in space.
        let separation = if dim == 2 { (4.0 * PI / self.count as f64).min(PI / 6.0) } else { PI / 6.0 };
        Ok(screened(context, proposals, self.keep, separation))
    }
}

pub(super) const ENTRY: StartEntry = StartEntry {
    name: "whitened-affine",
    summary: "affine maps: both sets whitened, a grid of rotations between them, the best by cost",
    parameters: &[
        ParameterSpec { name: "count", default: "72", meaning: "number of rotations, 1 to 100000" },
        ParameterSpec {
            name: "keep",
            default: "6",
            meaning: "number of rotations to solve from, those of least cost; 0: all",
        },
        REFLECTIONS,
    ],
    source: "whitening reduces an affine map to a rotation; see Domokos and Kato 2010",
    build: |parameters| {
        Ok(Box::new(WhitenedAffine {
            count: parameters.count("count", 1, 100_000)?,
            keep: parameters.count("keep", 0, 100_000)?,
            reflections: reflections_of(parameters)?,
        }))
    },
};
