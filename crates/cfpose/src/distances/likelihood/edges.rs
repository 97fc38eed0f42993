//! Where one side ends and the other goes on: target points there are left out of what theta is fitted to.

use super::kernels::Kernels;
use super::{Frame, Mixture, Placed, PointsLikelihood};
use crate::distances::neighbours::{Neighbour, Neighbours};

/// Deviations of a kernel that the neighbourhood of a target point reaches over.
const REACH: f64 = 4.0;
/// Neighbours of a target point among the target, at most.
const LIST: usize = 96;
/// How far the middles of what both sides show around a point may differ, in reaches: .5 where one of them ends.
const DIFFERS: f64 = 0.3;
/// The same in deviations of the difference by chance: offsets along a line are uniform within the reach, so the mean of n of them has
/// the deviation (3 n)^-1/2.
const CHANCE: f64 = 3.0;
/// Share of clutter, or of a hidden source, from which on something is missing.
const MISSING: f64 = 0.03;
/// Share of the inliers that may be left out: more of them say that theta is not near yet.
const MOST: f64 = 0.4;

impl PointsLikelihood<'_> {
    /// Leave the target points out around which one side ends and the other goes on: they take no part in theta and noise, and what they
    /// had of the log likelihood stays as it is.
    ///
    /// In the middle of a shape the source points that may explain a target point lie on both sides of it, and what its noise moves it
    /// along the shape cancels. Where the source ends and the target goes on, they lie on one side: the points behind the end pull it
    /// towards them, by a deviation of the noise each. Leaving out all target points up to where both sides go on again takes nothing
    /// from the others: a choice by where a target point lies does not depend on which source point it comes from.
    pub(super) fn leave_out(&self, placed: &mut Placed, kernels: &Kernels, hidden: f64) {
        let Some(out) = self.beside_edges(placed, &kernels.mixture, hidden) else { return };
        let each = self.explained(placed, kernels);
        let (mut lost, mut inliers, mut value) = (0.0, 0.0, 0.0);
        for ([log, inlier], out) in each.iter().zip(&out) {
            inliers += inlier;
            if *out {
                lost += inlier;
                value += log;
            }
        }
        if lost > 0.0 && lost < MOST * inliers {
            placed.cost -= value;
            placed.left_out = out;
        }
    }

    /// Say which target points lie where one side ends and the other goes on; `None` where that is not asked.
    fn beside_edges(&self, placed: &Placed, mixture: &Mixture, hidden: f64) -> Option<Vec<bool>> {
        let (all, widest) = self.surroundings.as_ref().filter(|_| mixture.clutter.max(hidden) > MISSING)?;
        if REACH * mixture.sigma > widest * self.size {
            return None;
        }
        // A filled image or a solid has no tangent along which a side ends.
        let with_tangent = placed.frames.iter().filter(|frame| tangent(frame, &[0.0; 3]).is_some()).count();
        if 2 * with_tangent < placed.frames.len() {
            return None;
        }
        let reach = REACH * (mixture.sigma * mixture.sigma + placed.tangential_variance()).sqrt();
        let near = self.around.get_or_init(|| self.target.iter().map(|q| all.nearest_n(q, LIST)).collect());
        Some((0..self.target.len()).map(|j| self.is_beside_edge(placed, j, all, &near[j], reach)).collect())
    }

    /// Say whether the middles of the source and of the target around a target point differ along the shape.
    fn is_beside_edge(&self, placed: &Placed, j: usize, all: &Neighbours, of_target: &[Neighbour], reach: f64) -> bool {
        let q = self.target[j];
        let offset = |x: &[f64; 3]| -> [f64; 3] { std::array::from_fn(|d| x[d] - q[d]) };
        let near = placed.near_to(j);
        let is_all = near.len() == placed.mapped.x.len();
        let farthest = near.iter().map(|k| square(&offset(&placed.mapped.x[*k as usize]))).fold(0.0, f64::max);
        let mut within = reach * reach;
        if !is_all {
            within = within.min(farthest);
        }
        if of_target.len() == LIST {
            within = within.min(of_target.last().map_or(within, |last| last.squared));
        }
        let of_source = near.iter().map(|k| {
            let k = *k as usize;
            (offset(&placed.mapped.x[k]), self.log_weights[k].exp())
        });
        // Those of the target stand nearest first.
        let of_target = of_target.iter().take_while(|other| other.squared <= within);
        let of_target = of_target.map(|other| (offset(&all.rows()[other.index]), 1.0));
        ends_alone(of_source, of_target, &placed.frames[near[0] as usize], within)
    }
}

/// Say whether one side ends at a place where the other goes on, from offsets with weights of both and the squared radius that counts:
/// whether their middles differ along the shape, or there is nothing of one side.
fn ends_alone(
    source: impl Iterator<Item = ([f64; 3], f64)>,
    target: impl Iterator<Item = ([f64; 3], f64)>,
    frame: &Frame,
    within: f64,
) -> bool {
    let is_near = |(v, _): &([f64; 3], f64)| square(v) <= within;
    let (source, target) = (middle(source.filter(is_near)), middle(target.filter(is_near)));
    let (Some((source, _)), Some((target, num_target))) = (source, target) else { return true };
    let apart = std::array::from_fn(|d| source[d] - target[d]);
    let Some(apart) = tangent(frame, &apart) else { return false };
    let by_chance = CHANCE * (num_target.recip() / 3.0).sqrt();
    square(&apart) > DIFFERS.max(by_chance).powi(2) * within
}

fn square(v: &[f64; 3]) -> f64 {
    v.iter().map(|v| v * v).sum()
}

/// Return the part of a vector along the shape; `None` where a frame has neither a normal nor a direction of its own.
fn tangent(frame: &Frame, v: &[f64; 3]) -> Option<[f64; 3]> {
    let on: f64 = (0..3).map(|d| v[d] * frame.axis[d]).sum();
    if frame.along < 0.5 * frame.across {
        return Some(std::array::from_fn(|d| v[d] - on * frame.axis[d]));
    }
    (frame.across < 0.5 * frame.along).then(|| frame.axis.map(|a| on * a))
}

/// Return the weighted mean of offsets and their number; `None` without any.
fn middle(offsets: impl Iterator<Item = ([f64; 3], f64)>) -> Option<([f64; 3], f64)> {
    let (mut sum, mut total, mut count) = ([0.0; 3], 0.0, 0.0);
    for (v, weight) in offsets {
        (0..3).for_each(|d| sum[d] += weight * v[d]);
        total += weight;
        count += 1.0;
    }
    (total > 0.0).then(|| (sum.map(|s| s / total), count))
}

#[cfg(test)]
mod tests {
    use super::*;

    const CURVE: Frame = Frame { axis: [0.0, 1.0, 0.0], along: 0.0, across: 1.0, bend: 0.0 };

    /// Points on a line about its normal at offset `off`, from `low` to `high` of the reach 1.
    fn line(low: f64, high: f64, off: f64) -> impl Iterator<Item = ([f64; 3], f64)> {
        let points = (0..=200).map(|k| 0.01 * f64::from(k) - 1.0);
        points.filter(move |x| (low..=high).contains(x)).map(move |x| ([x, off, 0.0], 1.0))
    }

    #[test]
    fn a_side_that_ends_where_the_other_goes_on_ends_alone() {
        // The source ends at the point, a tenth before it, half of the reach behind it; then the target.
        assert!(ends_alone(line(-1.0, 0.0, 0.0), line(-1.0, 1.0, 0.0), &CURVE, 1.0));
        assert!(ends_alone(line(-1.0, -0.1, 0.0), line(-1.0, 1.0, 0.0), &CURVE, 1.0));
        assert!(!ends_alone(line(-1.0, 0.5, 0.0), line(-1.0, 1.0, 0.0), &CURVE, 1.0));
        assert!(ends_alone(line(-1.0, 1.0, 0.0), line(-1.0, 0.0, 0.0), &CURVE, 1.0));
        // Out of reach of one side.
        assert!(ends_alone(line(-1.0, 1.0, 1.5), line(-1.0, 1.0, 0.0), &CURVE, 1.0));
    }

    #[test]
    fn what_both_sides_show_and_what_lies_across_the_shape_count_for_nothing() {
        assert!(!ends_alone(line(-1.0, 1.0, 0.0), line(-1.0, 1.0, 0.0), &CURVE, 1.0));
        assert!(!ends_alone(line(-1.0, 0.0, 0.0), line(-1.0, 0.0, 0.0), &CURVE, 1.0));
        assert!(!ends_alone(line(-1.0, 1.0, 0.8), line(-1.0, 1.0, 0.0), &CURVE, 1.0));
        // Two target points may lie on one side by chance.
        let two = [([0.4, 0.0, 0.0], 1.0), ([0.6, 0.0, 0.0], 1.0)];
        assert!(!ends_alone(line(-1.0, 1.0, 0.0), two.into_iter(), &CURVE, 1.0));
        // A filled image has no tangent.
        let filled = Frame { along: 1.0, ..CURVE };
        assert!(!ends_alone(line(-1.0, 0.0, 0.0), line(-1.0, 1.0, 0.0), &filled, 1.0));
    }
}
