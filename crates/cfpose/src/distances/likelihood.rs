//! The likelihood of the target points at a theta (docs/method.md, *The likelihood of the points*).
//!
//! Every target point is a draw from a kernel on some mapped source point, or uniform clutter:
//!
//! p(q | theta) = (1 - c) sum_k w_k N(q; x_k(theta) + b_k, S_k) + c / A
//!
//! * S_k = s^2 I, b_k = 0 for [`Kernel::Copies`]: the target holds noisy copies of source points.
//! * S_k = s^2 I + t_k^2 T T' for [`Kernel::Shape`]: the target was drawn from the shape anew; T spans the tangent at the source
//!   point, t_k is a share of the distance to its neighbours, b_k where a bent shape lies on average within t_k, along the normal.
//!
//! s (noise) and c (clutter) are unknowns. Means of features decide where to look; this decides what is true: its logarithm is
//! compared between modes, kinds of sampling and chance, in nats. Responsibilities say which points of *both* sides take part.

use std::cell::OnceCell;
use std::sync::Arc;

use cfpose_kernel::points::Points;
use cfpose_optim::Interrupt;

use super::neighbours::{Neighbour, Neighbours};
use super::{Mapped, Mover, regions};
use crate::geometry::linalg::{add_outer, symmetrise};
use crate::problem::MomentProblem;

pub(crate) mod align;
mod coherence;
mod covariance;
mod edges;
mod fit;
mod kernels;
mod mixture;
mod responsibilities;
mod shape;
mod weights;

pub(crate) use fit::Fit;
use kernels::Kernels;
use shape::{Frame, Shape};

/// What a kernel on a source point stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kernel {
    /// The target holds copies of source points.
    Copies,
    /// The target was drawn from the shape anew.
    Shape,
}

/// The unknowns beside theta.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Mixture {
    pub kernel: Kernel,
    /// Standard deviation of the noise in one coordinate.
    pub sigma: f64,
    /// Share of clutter.
    pub clutter: f64,
}

/// Lists of neighbours are kept while no source point moves by more than this share of how far they reach.
const SAME_NEIGHBOURS: f64 = 0.15;
/// Responsibilities below this are left out of the derivatives.
const NEGLIGIBLE: f64 = 1e-7;

/// A source that moves and a target: the data of the likelihood.
pub(crate) struct PointsLikelihood<'a> {
    pub mover: Mover<'a>,
    shape: Shape,
    /// ln of the weights of the source points, which sum to 1.
    log_weights: Vec<f64>,
    /// In an order in which neighbours follow each other.
    pub target: Vec<[f64; 3]>,
    /// ln of the density of clutter: minus the logarithm of the volume of the target's bounding box, enlarged by .3.
    log_uniform: f64,
    /// Median distance of the target points to their median point.
    pub size: f64,
    /// Noise is between these shares of the target's size.
    noise: [f64; 2],
    /// Share of the source that may be called hidden.
    most_hidden: f64,
    /// Source points near a target point that may explain it, at most.
    neighbours: usize,
    /// All of the target that is known, not only the points that are compared, and how far noise may reach, in sizes of the target.
    surroundings: Option<(&'a Neighbours, f64)>,
    /// What of it is near every target point, once it is asked for.
    around: OnceCell<Vec<Vec<Neighbour>>>,
    /// When to end early: alignments and ascents then return nothing.
    interrupt: Interrupt<'a>,
}

/// The source at one theta, ready to be compared with the target.
pub(crate) struct Placed {
    pub mapped: Mapped,
    frames: Vec<Frame>,
    /// For every target point the indices of the nearest source points, the nearest first, the farthest last.
    near: Arc<Near>,
    each: usize,
    /// Distances of these pairs along the frame's axis, and squared ones across it.
    distances: Vec<[f64; 2]>,
    /// ln of the weights of the source points here.
    log_weights: Vec<f64>,
    /// What the choice of weights costs, in nats, and what the target points that are left out had: both stay while theta moves.
    cost: f64,
    /// Target points that take no part in theta and noise ([`PointsLikelihood::leave_out`]); empty: none.
    left_out: Vec<bool>,
}

/// Lists of neighbours, and where the source was when they were made.
struct Near {
    lists: Vec<u32>,
    x: Vec<[f64; 3]>,
    /// How far the lists reach around nearly all target points.
    reach: f64,
}

/// Sums over the target at one theta.
pub(crate) struct Sums {
    pub log_likelihood: f64,
    /// Gradient with the frames held.
    pub gradient: Vec<f64>,
    /// Information if it were known which source point each target point comes from.
    pub complete: Vec<f64>,
    /// What is lost of it because that is not known: complete - lost is the observed information.
    pub lost: Vec<f64>,
    /// Number of target points that each source point is nearest to.
    pub nearest: Vec<f64>,
}

impl<'a> PointsLikelihood<'a> {
    /// Prepare `source` (as the problem's model takes it) and `target` (in the feature space); `None` for a target without extent.
    pub fn new(
        problem: &'a MomentProblem,
        source: &Points,
        mut target: Vec<[f64; 3]>,
        neighbours: usize,
    ) -> Option<Self> {
        let mover = Mover::new(problem, source);
        // Neighbours follow each other: what is near one is near the next.
        let depth = target.len().checked_ilog2().unwrap_or(0);
        regions(&mut target, depth, &|q| *q, &mut |_| ());
        let dim = mover.dim();
        let mut log_volume = 0.0;
        let mut centre = [0.0; 3];
        let mut widths = [0.0_f64; 3];
        for d in 0..dim {
            let mut column: Vec<f64> = target.iter().map(|q| q[d]).collect();
            column.sort_by(f64::total_cmp);
            widths[d] = column[column.len() - 1] - column[0];
            centre[d] = column[column.len() / 2];
        }
        // A flat target has no volume: its least extent is taken as a hundredth of its largest.
        let largest = widths.iter().copied().fold(0.0, f64::max);
        (0..dim).for_each(|d| log_volume += (1.3 * widths[d].max(0.01 * largest)).ln());
        let distance = |q: &[f64; 3]| (0..dim).map(|d| (q[d] - centre[d]).powi(2)).sum::<f64>().sqrt();
        let mut distances: Vec<f64> = target.iter().map(distance).collect();
        distances.sort_by(f64::total_cmp);
        let size = distances[distances.len() / 2];
        let total: f64 = source.weights().iter().sum();
        let log_weights = source.weights().iter().map(|w| (w / total).ln()).collect();
        let log_uniform = -log_volume;
        (size > 0.0 && log_uniform.is_finite()).then(|| Self {
            mover,
            shape: Shape::new(source),
            log_weights,
            target,
            log_uniform,
            size,
            noise: mixture::SIGMA,
            most_hidden: weights::MOST_HIDDEN[0],
            neighbours,
            surroundings: None,
            around: OnceCell::new(),
            interrupt: Interrupt::default(),
        })
    }

    /// Let target points beside edges be found ([`PointsLikelihood::leave_out`]) among more of the target than is compared, while the
    /// noise reaches over at most `widest` sizes of the target.
    pub fn within(self, surroundings: &'a Neighbours, widest: f64) -> Self {
        Self { surroundings: Some((surroundings, widest)), ..self }
    }

    /// Let all of the target pull at the source, beside edges and out of reach, too.
    pub fn without_edges(self) -> Self {
        Self { surroundings: None, ..self }
    }

    /// Let alignments and ascents end early.
    pub fn with_interrupt(self, interrupt: Interrupt<'a>) -> Self {
        Self { interrupt, ..self }
    }

    /// Let the noise be at most this share of the target's size, and more of the source be hidden.
    pub fn with_noise_below(self, most_noise: f64) -> Self {
        let most = most_noise.clamp(2.0 * mixture::SIGMA[0], mixture::SIGMA[1]);
        Self { noise: [self.noise[0].min(0.5 * most), most], most_hidden: weights::MOST_HIDDEN[1], ..self }
    }

    /// Let the noise be at least this share of the target's size: where data have none, a theta that is not polished yet is not far behind.
    pub fn with_noise_above(self, least: f64) -> Self {
        Self { noise: [least.clamp(mixture::SIGMA[0], self.noise[1]), self.noise[1]], ..self }
    }

    /// Return the log likelihood of a target that is all clutter: the null hypothesis of [`PointsLikelihood::evidence`].
    pub fn chance(&self) -> f64 {
        self.target.len() as f64 * self.log_uniform
    }

    /// Move the source to theta; `None` where a point is not finite.
    pub fn place(&self, theta: &[f64], derivatives: bool) -> Option<Placed> {
        let mapped = self.mover.map(theta, derivatives);
        let near = Arc::new(self.near(&mapped, None)?);
        let frames = self.shape.frames(&mapped);
        Some(self.place_with(mapped, frames, near))
    }

    /// Move the source to theta with the frames and weights of another placement, and with its neighbours while they are about the same.
    fn replace(&self, theta: &[f64], other: &Placed) -> Option<Placed> {
        let mapped = self.mover.map(theta, true);
        let moved = |a: &[f64; 3], b: &[f64; 3]| (0..3).map(|d| (a[d] - b[d]).powi(2)).sum::<f64>();
        let most = (SAME_NEIGHBOURS * other.near.reach).powi(2);
        let is_near = mapped.x.iter().zip(&other.near.x).all(|(a, b)| moved(a, b) <= most);
        let near = if is_near { other.near.clone() } else { Arc::new(self.near(&mapped, Some(&other.near))?) };
        let mut placed = self.place_with(mapped, other.frames.clone(), near);
        placed.log_weights.clone_from(&other.log_weights);
        placed.cost = other.cost;
        placed.left_out.clone_from(&other.left_out);
        Some(placed)
    }

    /// Find the neighbours of the target points, where they were `before` if that is known; `None` where a source point is not finite.
    fn near(&self, mapped: &Mapped, before: Option<&Near>) -> Option<Near> {
        if mapped.x.iter().flatten().any(|x| !x.is_finite()) {
            return None;
        }
        let tree = Neighbours::new(mapped.x.clone(), mapped.dim);
        let each = self.neighbours.min(mapped.x.len());
        let mut lists: Vec<u32> = Vec::with_capacity(each * self.target.len());
        let mut reaches = Vec::with_capacity(self.target.len());
        let mut found = Vec::new();
        for (j, q) in self.target.iter().enumerate() {
            let beside = &lists[lists.len().saturating_sub(each)..];
            let here = before.map_or(beside, |near| &near.lists[j * each..(j + 1) * each]);
            tree.nearest_n_beside(q, each, &[beside, here], &mut found);
            reaches.push(found.last().map_or(0.0, |last| last.squared));
            lists.extend(found.iter().map(|found| found.index as u32));
        }
        let at = reaches.len() / 10;
        let reach = reaches.select_nth_unstable_by(at, f64::total_cmp).1.sqrt();
        (lists.len() == each * self.target.len()).then(|| Near { lists, x: mapped.x.clone(), reach })
    }

    fn place_with(&self, mapped: Mapped, frames: Vec<Frame>, near: Arc<Near>) -> Placed {
        let each = self.neighbours.min(mapped.x.len());
        let mut placed = Placed {
            mapped,
            frames,
            near,
            each,
            distances: Vec::new(),
            log_weights: self.log_weights.clone(),
            cost: 0.0,
            left_out: Vec::new(),
        };
        self.measure(&mut placed);
        placed
    }

    /// Fit the frames of a placement anew.
    fn refresh(&self, placed: &mut Placed) {
        placed.frames = self.shape.frames(&placed.mapped);
        self.measure(placed);
    }

    /// Compute the distances of all pairs along the axes, and the squared ones across them.
    fn measure(&self, placed: &mut Placed) {
        let mut distances = Vec::with_capacity(placed.near.lists.len());
        for (q, near) in self.target.iter().zip(placed.near.lists.chunks_exact(placed.each)) {
            for k in near {
                distances.push(placed.distance(q, *k as usize));
            }
        }
        placed.distances = distances;
    }

    /// Return the observed information at theta with the noise as wide as the kernels: what is left of a direction's information when
    /// the roughness of a sample is smoothed away. `None` where a point is not finite.
    pub fn smooth_information(&self, theta: &[f64], mixture: &Mixture) -> Option<Vec<f64>> {
        let mut placed = self.place(theta, true)?;
        let sigma = mixture.sigma.hypot(1.5 * placed.tangential_variance().sqrt());
        let smooth = Mixture { kernel: Kernel::Shape, sigma, ..*mixture };
        let kernels = self.reweigh(&mut placed, &smooth);
        let sums = self.sums(&placed, &kernels);
        Some(sums.complete.iter().zip(&sums.lost).map(|(complete, lost)| complete - lost).collect())
    }

    /// Return the median distance of the target points' farthest source neighbours.
    pub fn reach(&self, placed: &Placed) -> f64 {
        let farthest = |j: usize| {
            let k = placed.near.lists[(j + 1) * placed.each - 1] as usize;
            (0..3).map(|d| (self.target[j][d] - placed.mapped.x[k][d]).powi(2)).sum::<f64>().sqrt()
        };
        let mut all: Vec<f64> = (0..self.target.len()).map(farthest).collect();
        all.sort_by(f64::total_cmp);
        all[all.len() / 2]
    }

    /// Compute the likelihood and, where the placement has derivatives, its slope and information.
    fn sums(&self, placed: &Placed, kernels: &Kernels) -> Sums {
        let (dim, n) = (placed.mapped.dim, placed.mapped.tangent);
        let mut sums = Sums {
            log_likelihood: -placed.cost,
            gradient: vec![0.0; n],
            complete: vec![0.0; n * n],
            lost: vec![0.0; n * n],
            nearest: vec![0.0; placed.mapped.x.len()],
        };
        let (mut pull, mut total) = (vec![0.0; n], vec![0.0; n]);
        let mut mass = vec![0.0; placed.mapped.x.len()];
        self.explain(placed, kernels, |j, explained| {
            if placed.is_left_out(j) {
                return;
            }
            let (q, near) = (&self.target[j], placed.near_to(j));
            sums.log_likelihood += explained.log;
            sums.nearest[near[0] as usize] += 1.0;
            total.fill(0.0);
            for (share, k) in explained.shares().zip(near) {
                if share < NEGLIGIBLE {
                    continue;
                }
                let k = *k as usize;
                mass[k] += share;
                // a = G' S^-1 v.
                let v: [f64; 3] = std::array::from_fn(|d| q[d] - placed.mapped.x[k][d]);
                let weighted = kernels.precisions[k].apply(&v);
                pull.fill(0.0);
                for d in 0..dim {
                    pull.iter_mut().zip(placed.mapped.slope(k, d)).for_each(|(p, g)| *p += weighted[d] * g);
                }
                total.iter_mut().zip(&pull).for_each(|(t, p)| *t += share * p);
                add_outer(&mut sums.lost, &pull, share);
            }
            add_outer(&mut sums.lost, &total, -1.0);
            sums.gradient.iter_mut().zip(&total).for_each(|(g, t)| *g += t);
        });
        // G' S^-1 G of a source point counts as often as it is responsible.
        for k in 0..mass.len() {
            if mass[k] > 0.0 {
                kernels.precisions[k].add_information(&placed.mapped, k, mass[k], &mut sums.complete);
            }
        }
        for matrix in [&mut sums.lost, &mut sums.complete] {
            symmetrise(n, matrix);
        }
        sums
    }

    /// Return the log likelihood alone.
    fn log_likelihood(&self, placed: &Placed, kernels: &Kernels) -> f64 {
        let mut sum = -placed.cost;
        self.explain(placed, kernels, |j, explained| {
            sum += if placed.is_left_out(j) { 0.0 } else { explained.log };
        });
        sum
    }

    /// Return for every target point ln p and the probability that it is no clutter.
    fn explained(&self, placed: &Placed, kernels: &Kernels) -> Vec<[f64; 2]> {
        let mut each = Vec::with_capacity(self.target.len());
        self.explain(placed, kernels, |_, explained| each.push([explained.log, explained.inlier]));
        each
    }

    /// Return ln p of every target point.
    pub fn log_each(&self, placed: &Placed, mixture: &Mixture) -> Vec<f64> {
        self.explained(placed, &self.kernels(placed, mixture)).into_iter().map(|[log, _]| log).collect()
    }

    /// Return for every target point the probability that it is no clutter.
    pub fn responsibilities(&self, placed: &Placed, mixture: &Mixture) -> Vec<f64> {
        self.explained(placed, &self.kernels(placed, mixture)).into_iter().map(|[_, inlier]| inlier).collect()
    }

    /// Return for every one of other points of the target, so many that no lists of neighbours are kept, the probability that it is no
    /// clutter.
    pub fn responsibilities_of(&self, placed: &Placed, mixture: &Mixture, points: &[[f64; 3]]) -> Vec<f64> {
        let mut inliers = Vec::with_capacity(points.len());
        self.explain_others(&mut Nearby::new(placed), &self.kernels(placed, mixture), points, |_, _, _, explained| {
            inliers.push(explained.inlier);
        });
        inliers
    }
}

/// The placed source with a search tree: for points of which no lists of neighbours are kept.
struct Nearby<'a> {
    placed: &'a Placed,
    tree: Neighbours,
    /// Of the last point.
    found: Vec<Neighbour>,
    near: Vec<u32>,
    distances: Vec<[f64; 2]>,
}

impl<'a> Nearby<'a> {
    fn new(placed: &'a Placed) -> Self {
        let tree = Neighbours::new(placed.mapped.x.clone(), placed.mapped.dim);
        Self { placed, tree, found: Vec::new(), near: Vec::new(), distances: Vec::new() }
    }

    /// Return the nearest source points of each of some points, and the distances from them ([`Placed::distance`]).
    fn of(&mut self, points: &[[f64; 3]]) -> (&[u32], &[[f64; 2]]) {
        let (placed, found) = (self.placed, &mut self.found);
        self.near.clear();
        self.distances.clear();
        for q in points {
            let beside: Vec<u32> = found.iter().map(|found| found.index as u32).collect();
            self.tree.nearest_n_beside(q, placed.each, &[&beside], found);
            self.near.extend(found.iter().map(|found| found.index as u32));
            self.distances.extend(found.iter().map(|found| placed.distance(q, found.index)));
        }
        (&self.near, &self.distances)
    }
}

impl Placed {
    /// Say whether two placements share their lists of neighbours: the source has hardly moved between them.
    fn same_neighbours(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.near, &other.near)
    }

    /// Return the distance of a point from a source point along its axis, and the squared one across it.
    fn distance(&self, q: &[f64; 3], k: usize) -> [f64; 2] {
        let (x, axis) = (&self.mapped.x[k], &self.frames[k].axis);
        let v: [f64; 3] = std::array::from_fn(|d| q[d] - x[d]);
        let on = axis[0] * v[0] + axis[1] * v[1] + axis[2] * v[2];
        [on, (v[0] * v[0] + v[1] * v[1] + v[2] * v[2] - on * on).max(0.0)]
    }

    /// Return the median variance of the kernels along the shape, without noise.
    fn tangential_variance(&self) -> f64 {
        let mut all: Vec<f64> = self.frames.iter().map(|frame| frame.across.max(frame.along)).collect();
        let middle = all.len() / 2;
        *all.select_nth_unstable_by(middle, f64::total_cmp).1
    }

    /// Say whether target point `j` takes no part in theta and noise.
    fn is_left_out(&self, j: usize) -> bool {
        self.left_out.get(j).is_some_and(|out| *out)
    }

    /// Return the distances of target point `j` from the source points near it.
    fn distances_to(&self, j: usize) -> &[[f64; 2]] {
        &self.distances[j * self.each..(j + 1) * self.each]
    }

    /// Return the source points near target point `j`.
    fn near_to(&self, j: usize) -> &[u32] {
        &self.near.lists[j * self.each..(j + 1) * self.each]
    }
}
