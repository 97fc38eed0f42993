//! The adapter that erases a fully general map: theta's derivatives run through every point.

use num_dual::HyperDual64;
use pulp::{Simd, WithSimd};

use super::factored::{SEEDS, lift_points, normalise_slopes, normalise_values};
use super::{DynMap, FactoredFacts, LiftedPoints, MapBlock, PreparedMap, Transform};
use crate::author::PointMap;
use crate::isa::Isa;
use crate::jet::Jet;
use crate::lane::Lane;
use crate::points::{BLOCK, Points};

/// Erase a [`PointMap`].
pub struct General<M, const POINT: usize, const DIM: usize> {
    map: M,
}

impl<M: PointMap<POINT, DIM>, const POINT: usize, const DIM: usize> General<M, POINT, DIM> {
    /// Wrap an author's map.
    pub fn new(map: M) -> Self {
        Self { map }
    }
}

impl<M: PointMap<POINT, DIM>, const POINT: usize, const DIM: usize> DynMap for General<M, POINT, DIM> {
    fn point_dim(&self) -> usize {
        POINT
    }

    fn dim(&self) -> usize {
        DIM
    }

    fn factored(&self) -> Option<FactoredFacts> {
        None
    }

    fn lift(&self, points: &Points) -> LiftedPoints {
        lift_points(points, POINT, None, |point, _, out| out.copy_from_slice(&point[..POINT]))
    }

    fn prepare(&self, theta: &[f64], basis: &[f64], tangent: usize) -> PreparedMap {
        PreparedMap { tangent, theta: theta.to_vec(), basis: basis.to_vec(), ..PreparedMap::default() }
    }

    fn block(
        &self,
        isa: Isa,
        prepared: &PreparedMap,
        transform: &Transform,
        points: &LiftedPoints,
        start: usize,
        out: &mut MapBlock,
    ) {
        out.set_weights(&points.weights[start..start + BLOCK]);
        isa.run(GeneralBlock { map: &self.map, prepared, transform, points, start, out });
    }

    fn hyper(&self, theta: &[HyperDual64], lifted: &[f64], out: &mut [HyperDual64]) -> HyperDual64 {
        let mut point = [HyperDual64::from(0.0); POINT];
        for d in 0..POINT {
            point[d] = HyperDual64::from(lifted[d]);
        }
        out[..DIM].copy_from_slice(&self.map.map(theta, point));
        self.map.density(theta, point).unwrap_or(HyperDual64::from(1.0))
    }
}

/// The work on one block, compiled for each instruction set.
struct GeneralBlock<'a, M, const POINT: usize, const DIM: usize> {
    map: &'a M,
    prepared: &'a PreparedMap,
    transform: &'a Transform,
    points: &'a LiftedPoints,
    start: usize,
    out: &'a mut MapBlock,
}

impl<M: PointMap<POINT, DIM>, const POINT: usize, const DIM: usize> WithSimd for GeneralBlock<'_, M, POINT, DIM> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        if self.prepared.tangent == 0 {
            self.values(simd);
            return;
        }
        // The weight of a block is read again for each chunk of seeds, so keep the plain one.
        let plain = self.out.weight;
        for first in (0..self.prepared.tangent).step_by(SEEDS) {
            self.out.weight = plain;
            chunk(simd, self.map, self.prepared, self.transform, self.points, self.start, first, self.out);
        }
    }
}

impl<M: PointMap<POINT, DIM>, const POINT: usize, const DIM: usize> GeneralBlock<'_, M, POINT, DIM> {
    #[inline(always)]
    fn values<S: Simd>(self, simd: S) {
        let theta: Vec<Lane<S>> = self.prepared.theta.iter().map(|value| Lane::splat(simd, *value)).collect();
        for lane in (0..BLOCK).step_by(S::F64_LANES) {
            let mut point = [Lane::splat(simd, 0.0); POINT];
            for d in 0..POINT {
                point[d] = Lane::load(simd, &self.points.columns[d][self.start + lane..]);
            }
            let x = normalise_values(self.transform, self.map.map(&theta, point));
            for q in 0..DIM {
                x[q].store(&mut self.out.x[q].0[lane..]);
            }
            if let Some(density) = self.map.density(&theta, point) {
                let weight = Lane::load(simd, &self.out.weight.0[lane..]) * density;
                weight.store(&mut self.out.weight.0[lane..]);
                self.out.unit_weight = false;
            }
        }
    }
}

/// Run the block with the seeds `first..first + SEEDS`.
#[inline(always)]
#[allow(clippy::too_many_arguments)] // the fields of GeneralBlock, reborrowed per chunk
fn chunk<S: Simd, M: PointMap<POINT, DIM>, const POINT: usize, const DIM: usize>(
    simd: S,
    map: &M,
    prepared: &PreparedMap,
    transform: &Transform,
    points: &LiftedPoints,
    start: usize,
    first: usize,
    out: &mut MapBlock,
) {
    let tangent = prepared.tangent;
    let width = SEEDS.min(tangent - first);
    let mut theta = Vec::with_capacity(prepared.theta.len());
    for (i, value) in prepared.theta.iter().enumerate() {
        let mut seeded = Jet::<S, SEEDS>::fixed(Lane::splat(simd, *value));
        for c in 0..width {
            seeded.eps[c] = Lane::splat(simd, prepared.basis[i * tangent + first + c]);
        }
        theta.push(seeded);
    }
    for lane in (0..BLOCK).step_by(S::F64_LANES) {
        let mut point = [theta[0]; POINT];
        for d in 0..POINT {
            point[d] = Jet::fixed(Lane::load(simd, &points.columns[d][start + lane..]));
        }
        let mapped = map.map(&theta, point);
        let mut weight = Lane::load(simd, &out.weight.0[lane..]);
        if let Some(density) = map.density(&theta, point) {
            out.moving_weight = true;
            out.unit_weight = false;
            for c in 0..width {
                (density.eps[c] * weight).store(&mut out.dweight[first + c].0[lane..]);
            }
            weight = weight * density.re;
            weight.store(&mut out.weight.0[lane..]);
        }
        let mut x = [weight; DIM];
        for q in 0..DIM {
            x[q] = mapped[q].re;
        }
        let x = normalise_values(transform, x);
        let slopes = normalise_slopes(transform, &mapped);
        for q in 0..DIM {
            x[q].store(&mut out.x[q].0[lane..]);
            for c in 0..width {
                (slopes[q][c] * weight).store(&mut out.dx[q * tangent + first + c].0[lane..]);
            }
        }
    }
}
