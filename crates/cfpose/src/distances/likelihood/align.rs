//! Coarse alignment: many starts, few points, nearest neighbours mostly along normals, a reach that shrinks.

use super::PointsLikelihood;
use crate::distances::neighbours::Neighbours;
use crate::geometry::linalg::{add_outer, solve_normal, symmetrise};

/// Share of a distance that counts in every direction; the rest counts along the normal alone.
const ISOTROPIC: f64 = 0.1;
/// Damping of the steps.
const DAMPING: f64 = 1e-3;
/// Root mean square displacement of a step, in sizes of the target, at most.
const LONGEST: f64 = 0.3;

impl PointsLikelihood<'_> {
    /// Move theta by `iterations` robust Gauss-Newton steps at each reach (in sizes of the target); weight of a distance r: (1 + (r / 2 reach)^2)^-2.
    /// Returns the sum of the weights before the last step, and theta.
    pub fn align(&self, theta: &[f64], reaches: &[f64], iterations: usize) -> Option<(f64, Vec<f64>)> {
        if self.interrupt.is_raised() {
            return None;
        }
        let (mut theta, mut fitted) = (theta.to_vec(), 0.0);
        for reach in reaches {
            for _ in 0..iterations {
                (fitted, theta) = self.gauss_newton(&theta, reach * self.size)?;
            }
        }
        Some((fitted, theta))
    }

    fn gauss_newton(&self, theta: &[f64], reach: f64) -> Option<(f64, Vec<f64>)> {
        let mapped = self.mover.map(theta, true);
        if mapped.x.iter().flatten().any(|x| !x.is_finite()) {
            return None;
        }
        let (dim, n) = (mapped.dim, mapped.tangent);
        let tree = Neighbours::new(mapped.x.clone(), dim);
        let (mut h, mut g) = (vec![0.0; n * n], vec![0.0; n]);
        let mut nearest = Vec::with_capacity(self.target.len());
        let mut row = vec![0.0; n];
        let mut fitted = 0.0;
        for q in &self.target {
            let found = tree.nearest(q);
            let k = found.index;
            nearest.push(k);
            let weight = (1.0 + found.squared / (4.0 * reach * reach)).powi(-2);
            fitted += weight;
            let v: [f64; 3] = std::array::from_fn(|d| q[d] - mapped.x[k][d]);
            // Where there is no normal, all directions count.
            let normal = self.shape.normal(k, &mapped);
            let everywhere = if normal.is_some() { ISOTROPIC } else { 1.0 };
            for d in 0..dim {
                let slope = mapped.slope(k, d);
                add_outer(&mut h, slope, weight * everywhere);
                g.iter_mut().zip(slope).for_each(|(g, s)| *g += weight * everywhere * v[d] * s);
            }
            if let Some(axis) = normal {
                row.fill(0.0);
                for d in 0..dim {
                    row.iter_mut().zip(mapped.slope(k, d)).for_each(|(r, s)| *r += axis[d] * s);
                }
                let along: f64 = (0..dim).map(|d| axis[d] * v[d]).sum();
                add_outer(&mut h, &row, weight * (1.0 - ISOTROPIC));
                g.iter_mut().zip(&row).for_each(|(g, r)| *g += weight * (1.0 - ISOTROPIC) * along * r);
            }
        }
        symmetrise(n, &mut h);
        let mut step = solve_normal(n, &h, &g, DAMPING)?;
        let displaced: f64 = nearest.iter().map(|k| mapped.displacement(*k, &step)).sum();
        let moved = (displaced / self.target.len() as f64).sqrt();
        if moved > LONGEST * self.size {
            step.iter_mut().for_each(|s| *s *= LONGEST * self.size / moved);
        }
        let moved = self.mover.retract(theta, &step);
        moved.iter().all(|x| x.is_finite()).then_some((fitted, moved))
    }
}
