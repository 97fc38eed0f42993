//! Principal axes of both sets, matched in order, with every choice of signs.

use super::{Moments, REFLECTIONS, StartContext, StartEntry, StartStrategy, reflections_of};
use crate::error::{Error, Side};
use crate::geometry::linalg::symmetric_eigen;
use crate::model::LinearKind;

struct Pca {
    reflections: bool,
}

/// Return the determinant of a 2 x 2 or 3 x 3 matrix, row by row.
fn determinant(a: &[f64]) -> f64 {
    if a.len() == 4 { a[0] * a[3] - a[1] * a[2] } else { cfpose_optim::manifold::determinant3(a) }
}

impl StartStrategy for Pca {
    fn name(&self) -> &'static str {
        "pca"
    }

    /// A = V_q S D V_p' for the sign matrices S with det A > 0; D is 1, the ratio of spreads, or the ratio for each axis.
    fn starts(&self, context: &StartContext<'_>) -> Result<Vec<Vec<f64>>, Error> {
        let Some(group) = &context.model.linear else {
            return Err(Error::Unsupported(
                "start `pca` needs a rigid motion, similarity or affine map; use identity, grid or a theta".into(),
            ));
        };
        let dim = group.dim;
        let moments = Moments::new(context, dim)?;
        let (spread_p, axes_p) = symmetric_eigen(&moments.source_covariance, dim);
        let (spread_q, axes_q) = symmetric_eigen(&moments.target_covariance, dim);
        let stretch = |axis: usize| match group.kind {
            LinearKind::Rotation => 1.0,
            LinearKind::Similarity => moments.scale(),
            LinearKind::General => (spread_q[axis].max(0.0) / spread_p[axis]).sqrt(),
        };
        if !(0..dim).all(|axis| stretch(axis).is_finite() && stretch(axis) > 0.0) {
            let problem = "start `pca` needs points with extent in every direction that the model scales";
            let flat = |spread: &[f64]| spread[..dim].iter().any(|s| !(s.is_finite() && *s > 0.0));
            let side = if flat(&spread_p) { Side::Source } else { Side::Target };
            return Err(Error::Data { side, problem: problem.to_string() });
        }
        let mut starts = Vec::new();
        for choice in 0..1_u8 << dim {
            let mut a = vec![0.0; dim * dim];
            for axis in 0..dim {
                let factor = if choice >> axis & 1 == 0 { stretch(axis) } else { -stretch(axis) };
                for i in 0..dim {
                    for k in 0..dim {
                        a[dim * i + k] += factor * axes_q[axis][i] * axes_p[axis][k];
                    }
                }
            }
            if determinant(&a) > 0.0 || self.reflections && group.kind == LinearKind::General {
                starts.push((group.theta)(&a, &moments.offset(&a)));
            }
        }
        Ok(starts)
    }
}

pub(super) const ENTRY: StartEntry = StartEntry {
    name: "pca",
    summary: "principal axes matched in order, all sign choices (4 starts in 3-D, 2 in 2-D)",
    parameters: &[REFLECTIONS],
    source: "principal component analysis",
    build: |parameters| Ok(Box::new(Pca { reflections: reflections_of(parameters)? })),
};
