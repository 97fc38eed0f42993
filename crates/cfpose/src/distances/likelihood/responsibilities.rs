//! Which source points are responsible for the target points: a block of target points at a time, a vector of them at a step.

use cfpose_kernel::lane::exp_below;
use pulp::{Simd, WithSimd};

use super::kernels::Kernels;
use super::{Nearby, Placed, PointsLikelihood};

/// Target points of a block: a multiple of the lanes of every instruction set.
const ROWS: usize = 32;

/// Parts that are so many nats below the largest one are nothing.
const NOTHING: f64 = -30.0;

/// What the kernels say about one target point.
pub(super) struct Explained<'a> {
    /// ln p(q).
    pub log: f64,
    /// Probability of being no clutter: the sum of the shares.
    pub inlier: f64,
    shares: &'a [[f64; ROWS]],
    row: usize,
}

impl Explained<'_> {
    /// Return the probabilities of coming from each source point nearby, in the order of the list of neighbours.
    pub fn shares(&self) -> impl Iterator<Item = f64> + '_ {
        self.shares.iter().map(|of_all| of_all[self.row])
    }
}

impl PointsLikelihood<'_> {
    /// Visit the target points, in their order, with what the kernels say about each. The visit is compiled for the instruction set, too,
    /// where the compiler puts it in its place.
    pub(super) fn explain(&self, placed: &Placed, kernels: &Kernels, visit: impl FnMut(usize, &Explained<'_>)) {
        self.mover.isa().run(Explain { placed, kernels, visit });
    }

    /// Visit points of which no lists of neighbours are kept, with the source points nearby, the distances from them and what the kernels say.
    pub(super) fn explain_others(
        &self,
        nearby: &mut Nearby<'_>,
        kernels: &Kernels,
        points: &[[f64; 3]],
        mut visit: impl FnMut(&[f64; 3], &[u32], &[[f64; 2]], &Explained<'_>),
    ) {
        let each = nearby.placed.each;
        let mut block = Block::new(each);
        for points in points.chunks(ROWS) {
            let (near, distances) = nearby.of(points);
            self.mover.isa().run(Fill { block: &mut block, kernels, near, distances });
            let lists = near.chunks_exact(each).zip(distances.chunks_exact(each));
            for (row, (q, (near, distances))) in points.iter().zip(lists).enumerate() {
                visit(q, near, distances, &block.row(row));
            }
        }
    }
}

/// The work of [`PointsLikelihood::explain`].
struct Explain<'a, Visit> {
    placed: &'a Placed,
    kernels: &'a Kernels,
    visit: Visit,
}

impl<Visit: FnMut(usize, &Explained<'_>)> WithSimd for Explain<'_, Visit> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { placed, kernels, mut visit } = self;
        let each = placed.each;
        let mut block = Block::new(each);
        let lists = placed.near.lists.chunks(ROWS * each).zip(placed.distances.chunks(ROWS * each));
        for (number, (near, distances)) in lists.enumerate() {
            Fill { block: &mut block, kernels, near, distances }.with_simd(simd);
            for row in 0..near.len() / each {
                visit(number * ROWS + row, &block.row(row));
            }
        }
    }
}

/// Responsibilities of a block of target points; what belongs to one source neighbour of all of them stands together.
struct Block {
    each: usize,
    /// Logarithms of the parts of p(q), then shares: of neighbour i and target point r at [i][r].
    shares: Vec<[f64; ROWS]>,
    logs: [f64; ROWS],
    inliers: [f64; ROWS],
}

impl Block {
    /// Make room for target points with `each` source neighbours.
    fn new(each: usize) -> Self {
        Self { each, shares: vec![[0.0; ROWS]; each], logs: [0.0; ROWS], inliers: [0.0; ROWS] }
    }

    /// Return what the kernels say about one of them.
    fn row(&self, row: usize) -> Explained<'_> {
        Explained { log: self.logs[row], inlier: self.inliers[row], shares: &self.shares, row }
    }
}

/// Computes the responsibilities of up to `ROWS` target points from their source neighbours and their distances from them
/// ([`Placed::distance`]), `each` a target point. Plain loops that every instruction set has vectors for, with the same bits on all.
struct Fill<'a> {
    block: &'a mut Block,
    kernels: &'a Kernels,
    near: &'a [u32],
    distances: &'a [[f64; 2]],
}

impl WithSimd for Fill<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        let Self { block, kernels, near, distances } = self;
        let Block { each, shares, logs, inliers } = block;
        let lists = near.chunks_exact(*each).zip(distances.chunks_exact(*each));
        for (row, (near, distances)) in lists.enumerate() {
            for ((parts, k), distance) in shares.iter_mut().zip(near).zip(distances) {
                parts[row] = kernels.log_part(*k as usize, *distance);
            }
        }
        let clutter = kernels.log_clutter;
        let mut largest = [clutter; ROWS];
        for parts in &*shares {
            for (largest, part) in largest.iter_mut().zip(parts) {
                *largest = if *part > *largest { *part } else { *largest };
            }
        }
        *inliers = [0.0; ROWS];
        for parts in &mut *shares {
            for ((part, largest), inlier) in parts.iter_mut().zip(&largest).zip(&mut *inliers) {
                let below = *part - largest;
                let share = exp_below(below);
                *part = if below > NOTHING { share } else { 0.0 };
                *inlier += *part;
            }
        }
        let mut inverse = [0.0; ROWS];
        for row in 0..ROWS {
            let total = inliers[row] + exp_below(clutter - largest[row]);
            inverse[row] = total.recip();
            inliers[row] *= inverse[row];
            logs[row] = total;
        }
        for row in 0..near.len() / *each {
            logs[row] = largest[row] + logs[row].ln();
        }
        for parts in shares {
            parts.iter_mut().zip(&inverse).for_each(|(part, inverse)| *part *= inverse);
        }
    }
}
