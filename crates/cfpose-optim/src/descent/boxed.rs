//! Bounds in the loop of the own solvers: an active set around any step rule.
//!
//! Source: Kanzow, Yamashita and Fukushima, Levenberg-Marquardt methods with strong local convergence properties for solving
//! nonlinear equations with convex constraints, J. Comput. Appl. Math. 172 (2004); the active set within a step is ours.

use crate::constraint::Bounds;
use crate::descent::{Model, Proposal, StepRule};
use crate::manifold::Manifold;
use crate::outcome::Status;
use crate::session::End;

/// Bounds seen along tangent coordinates; only coordinates of Euclidean factors may be bounded.
#[derive(Debug, Clone)]
pub struct TangentBox {
    lower: Vec<f64>,
    upper: Vec<f64>,
    /// Ambient coordinate that each tangent coordinate moves alone, if it does.
    ambient: Vec<Option<usize>>,
    fixed: Vec<Option<f64>>,
    work: Model,
}

impl TangentBox {
    /// Translate bounds; the reason when a curved coordinate is bounded or a bound is not a number.
    pub fn new(bounds: &Bounds, manifold: &dyn Manifold, theta: &[f64], rows: usize) -> Result<Self, End> {
        let (n, m) = (manifold.ambient(), manifold.tangent());
        let unsupported = |why: String| Err(End::new(Status::Unsupported, why));
        if bounds.lower.len() != n || bounds.upper.len() != n {
            return unsupported(format!("the bounds must have {n} entries each"));
        }
        if let Some(i) =
            (0..n).find(|&i| bounds.lower[i].is_nan() || bounds.upper[i].is_nan() || bounds.lower[i] > bounds.upper[i])
        {
            return unsupported(format!("bounds {i} are {} and {}", bounds.lower[i], bounds.upper[i]));
        }
        let mut basis = vec![0.0; n * m];
        manifold.basis(theta, &mut basis);
        let mut ambient = vec![None; m];
        for i in 0..n {
            if bounds.lower[i] == f64::NEG_INFINITY && bounds.upper[i] == f64::INFINITY {
                continue;
            }
            let row = &basis[i * m..(i + 1) * m];
            let Some(j) = row.iter().position(|b| *b != 0.0) else { continue };
            let alone = row[j] == 1.0
                && row[j + 1..].iter().all(|b| *b == 0.0)
                && (0..n).all(|other| other == i || basis[other * m + j] == 0.0);
            if !alone {
                return unsupported(format!(
                    "ambient coordinate {i} is bounded and lies on a curved factor; use `clarabel` or `penalty`"
                ));
            }
            ambient[j] = Some(i);
        }
        let (lower, upper) = (bounds.lower.clone(), bounds.upper.clone());
        Ok(Self { lower, upper, ambient, fixed: vec![None; m], work: Model::new(rows, m) })
    }

    /// Move a point onto the box.
    pub fn clamp(&self, theta: &mut [f64]) {
        for i in self.ambient.iter().flatten() {
            theta[*i] = theta[*i].clamp(self.lower[*i], self.upper[*i]);
        }
    }

    /// Say whether a tangent coordinate may move downhill from `theta`: not when it is at a bound that the descent leaves.
    pub fn is_free(&self, model: &Model, theta: &[f64], j: usize) -> bool {
        let Some(i) = self.ambient[j] else { return true };
        let outward = if model.gradient[j] > 0.0 { theta[i] <= self.lower[i] } else { theta[i] >= self.upper[i] };
        !outward || model.gradient[j] == 0.0
    }

    /// Write the step of a rule with the active coordinates held: solve, move what leaves the box to its bound, solve again
    /// for the others, until nothing leaves it.
    pub fn step(
        &mut self,
        rule: &mut dyn StepRule,
        model: &Model,
        theta: &[f64],
        control: f64,
        step: &mut [f64],
    ) -> Option<Proposal> {
        for j in 0..model.cols {
            self.fixed[j] = if self.is_free(model, theta, j) { None } else { Some(0.0) };
        }
        let mut full = false;
        for _ in 0..=model.cols {
            self.reduce(model);
            rule.prepare(&self.work);
            full = rule.step(&self.work, control, step)?.full;
            let mut left_the_box = false;
            for j in 0..model.cols {
                if let Some(displacement) = self.fixed[j] {
                    step[j] = displacement;
                } else if let Some(i) = self.ambient[j] {
                    let target = theta[i] + step[j];
                    let clamped = target.clamp(self.lower[i], self.upper[i]);
                    if target != clamped {
                        step[j] = clamped - theta[i];
                        self.fixed[j] = Some(step[j]);
                        left_the_box = true;
                    }
                }
            }
            if !left_the_box {
                break;
            }
        }
        Some(Proposal { predicted: model.predicted(step), scaled_norm: model.scaled_norm(step), full })
    }

    /// Copy the model with the fixed coordinates moved and their columns emptied.
    fn reduce(&mut self, model: &Model) {
        self.work.clone_from(model);
        let m = model.cols;
        for j in 0..m {
            let Some(displacement) = self.fixed[j] else { continue };
            for (k, row) in self.work.jacobian.chunks_exact_mut(m).enumerate() {
                self.work.residual[k] += row[j] * displacement;
                row[j] = 0.0;
            }
        }
        self.work.update_gradient();
        if self.work.curvature.is_empty() {
            return;
        }
        for j in 0..m {
            let Some(displacement) = self.fixed[j] else { continue };
            for l in 0..m {
                if self.fixed[l].is_none() {
                    self.work.gradient[l] += model.curvature[l * m + j] * displacement;
                }
                self.work.curvature[l * m + j] = 0.0;
                self.work.curvature[j * m + l] = 0.0;
            }
        }
    }
}
