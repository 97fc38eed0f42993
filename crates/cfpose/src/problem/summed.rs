//! Problems on moments alone: polynomial features of maps without projection need no point.

use std::sync::Arc;

use cfpose_kernel::family::DynFamily;
use cfpose_kernel::map::{DynMap, LiftedPoints, Transform};
use cfpose_kernel::means::Execution;
use cfpose_kernel::moments::{MomentPath, Moments, mapped_means, monomials};
use cfpose_kernel::points::Points;
use num_dual::HyperDual64;

use super::{Group, MomentProblem};
use crate::error::Error;
use crate::model::Model;

impl MomentProblem {
    /// Set up the problem of two sets of which the moments are known, at least up to the degree of the family.
    ///
    /// # Errors
    /// [`Error::Unsupported`], with the reason, for models with a projection, a lift or a moving target, families that are no polynomials
    /// of a bounded degree, and moments of a lower degree.
    pub fn of_moments(
        model: Arc<Model>,
        family: Arc<dyn DynFamily>,
        transform: Transform,
        [source, target]: [&Moments; 2],
        execution: Execution,
    ) -> Result<Self, Error> {
        let refuse = |problem: &str| Error::Unsupported(problem.to_string());
        if model.target.is_moving() {
            return Err(refuse("the target side of this model moves with theta: its means need the points"));
        }
        let (maps, dim) = ([model.source.as_ref(), model.target.map()], model.dim());
        if !maps.iter().all(|map| is_plain(*map)) {
            return Err(refuse("this model is no affine map of the points themselves: its means need the points"));
        }
        let polynomial = "these features are no polynomials of the coordinates: their means need the points";
        let exponents = family.monomials(dim).ok_or_else(|| refuse(polynomial))?;
        let degree = exponents.iter().map(|e| e.iter().sum::<usize>()).max().unwrap_or(0);
        if degree > source.degree().min(target.degree()) {
            let held = source.degree().min(target.degree());
            return Err(refuse(&format!("the features have degree {degree}, the moments end at degree {held}")));
        }
        let path = |map: &dyn DynMap, moments: &Moments| {
            let path = MomentPath::of_moments(map, exponents, moments);
            path.ok_or_else(|| refuse("the moments have another number of coordinates than the model"))
        };
        let (source_path, target_path) = (path(maps[0], source)?, path(maps[1], target)?);
        let prepared = maps[1].prepare(&model.layout.neutral(), &[], 0);
        let fixed_target = Some(Arc::new(target_path.means(&prepared, &transform, execution.isa).values));
        let nothing =
            |columns: usize| Arc::new(LiftedPoints { len: 0, columns: vec![Vec::new(); columns], weights: Vec::new() });
        let group = Group {
            source: nothing(source.dim()),
            target: nothing(target.dim()),
            moments: Some(Arc::new(source_path)),
            fixed_target,
            summed: Some(Arc::new(source.up_to(degree))),
        };
        let mut problem = Self::without_points(model, family, transform, execution);
        problem.groups.push(group);
        Ok(problem)
    }

    /// Return the means of the basis over the source over second-order duals.
    pub(super) fn hyper_of_moments(&self, moments: &Moments, theta: &[HyperDual64]) -> Vec<HyperDual64> {
        let zero = HyperDual64::from(0.0);
        let (map, dim, len) = (self.model.source.as_ref(), self.model.dim(), moments.dim());
        // The map is affine: what it does to the origin and to the unit vectors says everything.
        let image = |point: &[f64]| {
            let mut x = vec![zero; dim];
            map.hyper(theta, point, &mut x);
            x
        };
        let origin = image(&vec![0.0; len]);
        let columns: Vec<Vec<HyperDual64>> = (0..len)
            .map(|k| {
                let unit: Vec<f64> = (0..len).map(|j| f64::from(u8::from(j == k))).collect();
                image(&unit).iter().zip(&origin).map(|(x, o)| *x - *o).collect()
            })
            .collect();
        let (mean, matrix) = (self.transform.mean(), self.transform.matrix());
        let (mut a, mut b) = (vec![zero; dim * len], vec![zero; dim]);
        for q in 0..dim {
            for c in 0..dim {
                b[q] += (origin[c] - mean[c]) * matrix[q][c];
                (0..len).for_each(|k| a[q * len + k] += columns[k][c] * matrix[q][c]);
            }
        }
        let means = mapped_means(moments, &a, &b);
        let all = monomials(dim, moments.degree());
        let place = |e: &[usize; 3]| all.iter().position(|other| other == e).map_or(zero, |at| means[at]);
        self.family.monomials(dim).unwrap_or_default().iter().map(place).collect()
    }
}

/// Say whether a map takes the points as they are through A p + b.
fn is_plain(map: &dyn DynMap) -> bool {
    let Some(facts) = map.factored() else { return false };
    let dim = map.point_dim();
    let probe: Vec<Vec<f64>> = (0..dim).map(|d| vec![0.75 + d as f64, -1.5]).collect();
    let is_same = |probe: &Points| {
        let lifted = map.lift(probe);
        lifted.columns.len() == dim && (0..dim).all(|d| lifted.columns[d][..2] == *probe.column(d))
    };
    facts.identity_projection
        && !facts.has_density
        && facts.lift_len == dim
        && facts.rows == map.dim()
        && Points::from_columns(probe).is_ok_and(|probe| is_same(&probe))
}
