//! Do neighbouring target points miss the shape together? Noise does not; a misplaced or another shape does.

use super::{Kernel, Mixture, Placed, PointsLikelihood, Precision};
use crate::distances::neighbours::Neighbours;

/// Neighbours of a target point that are asked for one with another source point.
const ASKED: usize = 4;

impl PointsLikelihood<'_> {
    /// Return the correlation of the residuals of neighbouring target points along the normals, in standard deviations of
    /// independent residuals: about normal for noise, large where a shape is misplaced. It has power from about 30 points on.
    ///
    /// T = sum r_i . r_j / (sum (r_i . r_j)^2)^(1/2) over pairs of neighbours that lie nearest to different source points.
    pub fn coherence(&self, placed: &Placed, mixture: &Mixture) -> f64 {
        let shares = self.responsibilities(placed, mixture);
        let of_shape = Mixture { kernel: Kernel::Shape, ..*mixture };
        let residual = |j: usize| -> ([f64; 3], u32) {
            let q = &self.target[j];
            let square = |at: usize| {
                let [on, off] = placed.squares[j * placed.each + at];
                let precision = Precision::of(&placed.frames[placed.near_to(j)[at] as usize], &of_shape);
                precision.along * on + precision.across * off
            };
            let best = (0..placed.each).min_by(|a, b| square(*a).total_cmp(&square(*b))).unwrap_or(0);
            let best = placed.near_to(j)[best];
            let (frame, x) = (&placed.frames[best as usize], &placed.mapped.x[best as usize]);
            let v: [f64; 3] = std::array::from_fn(|d| q[d] - x[d]);
            let on: f64 = (0..3).map(|d| frame.axis[d] * v[d]).sum();
            // Along the axis where that is a normal, else across it.
            let normal = frame.along < frame.across;
            (std::array::from_fn(|d| if normal { on * frame.axis[d] } else { v[d] - on * frame.axis[d] }), best)
        };
        let kept: Vec<usize> = (0..self.target.len()).filter(|j| shares[*j] > 0.5).collect();
        if kept.len() < 10 {
            return 0.0;
        }
        let residuals: Vec<([f64; 3], u32)> = kept.iter().map(|j| residual(*j)).collect();
        let tree = Neighbours::new(kept.iter().map(|j| self.target[*j]).collect(), placed.mapped.dim);
        let (mut sum, mut squares) = (0.0, 0.0);
        for (i, (r, best)) in residuals.iter().enumerate() {
            let others = tree.nearest_n(&tree.rows()[i], ASKED + 1);
            let other = others.iter().map(|n| n.index).find(|j| *j != i && residuals[*j].1 != *best);
            // A pair that is mutual is counted once.
            let Some(j) = other else { continue };
            let product: f64 = (0..3).map(|d| r[d] * residuals[j].0[d]).sum();
            let weight = if j < i && self.is_partner(&tree, &residuals, j, i) { 0.0 } else { 1.0 };
            sum += weight * product;
            squares += weight * product * product;
        }
        if squares > 0.0 { sum / squares.sqrt() } else { 0.0 }
    }

    /// Say whether the neighbour that `j` would be paired with is `i`.
    fn is_partner(&self, tree: &Neighbours, residuals: &[([f64; 3], u32)], j: usize, i: usize) -> bool {
        let others = tree.nearest_n(&tree.rows()[j], ASKED + 1);
        others.iter().map(|n| n.index).find(|k| *k != j && residuals[*k].1 != residuals[j].1) == Some(i)
    }
}
