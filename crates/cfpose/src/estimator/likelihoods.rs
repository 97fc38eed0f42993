//! The points of both sides that a likelihood is prepared for: few that cover both, those that modes are compared on, those of the last fit.

use super::search::Search;
use super::workbench::of_side;
use crate::distances::likelihood::{Fit, PointsLikelihood};
use crate::distances::neighbours::Neighbours;
use crate::distances::sampling::{draw, even, represent};
use crate::error::{Error, Side};
use crate::streams::stream;
use cfpose_kernel::points::{Points, PointsError};

/// Source points near a target point that may explain it: of few points, of more.
pub(super) const NEIGHBOURS: [usize; 2] = [8, 12];
/// The same in the last fit.
const LAST_NEIGHBOURS: usize = 32;
/// Deviations of the noise that the neighbours of a target point reach over: those left out bend the fit towards the inside of a
/// curve. At 2.5 the mean squared error of noisy curves was 5 to 100 times the variance, at 4 it is once to twice.
const REACH: f64 = 4.0;
/// Share of clutter up to which a rough fit may be of a part.
const PART: f64 = 0.6;
/// How far noise may reach in the plane, in sizes of the target: farther it spans the bends of a curve, and does not show where a side ends.
/// In space the fits that need it most are those of halves whose noise has swallowed a misfit.
const WIDEST: f64 = 0.2;
/// Target points that show where the target goes on, at most.
const SURROUNDINGS: usize = 6000;
/// Source points that are kept in any case.
const LEAST: usize = 150;

impl Search<'_> {
    /// Prepare the likelihood that modes are compared by.
    pub fn comparison(&self, source_points: usize) -> Result<Option<PointsLikelihood<'_>>, Error> {
        let [most, num_target] = self.parts.criteria.fine_points;
        self.prepared([source_points, most], num_target, NEIGHBOURS[1], "modes")
    }

    /// Return how many source points modes are compared on: as many as the noise of rough fits lets take part, of that with the least noise: a
    /// part that fits exactly is told from a whole that fits roughly by all points only.
    pub fn compared_points(&self, rough: &[Fit]) -> Result<usize, Error> {
        let most = self.parts.criteria.fine_points[0];
        let exact = rough.iter().filter(|fit| fit.mixture.clutter < PART);
        let exact = exact.min_by(|a, b| a.mixture.sigma.total_cmp(&b.mixture.sigma));
        exact.map_or(Ok(most), |fit| self.within_reach(fit, most, NEIGHBOURS[1]))
    }

    /// Prepare the likelihood of the last fit: of as many points as the noise lets take part.
    pub fn wide_enough(&self, fit: &Fit, target_points: usize) -> Result<Option<PointsLikelihood<'_>>, Error> {
        let Some(points) = &self.pipeline.points else { return Ok(None) };
        let count = self.within_reach(fit, points.source_points, LAST_NEIGHBOURS)?;
        self.prepared([count, points.source_points], target_points, LAST_NEIGHBOURS, "points")
    }

    /// Prepare the likelihood that tells what of both sides is seen: of at most so many source and target points.
    pub fn seeing(&self, fit: &Fit, points: [usize; 2]) -> Result<Option<PointsLikelihood<'_>>, Error> {
        let count = self.within_reach(fit, points[0], NEIGHBOURS[1])?;
        self.prepared([count, points[0]], points[1], NEIGHBOURS[1], "seen")
    }

    /// Return the largest number of source points, at most so many, of which the neighbours of a target point reach over the noise.
    fn within_reach(&self, fit: &Fit, most: usize, neighbours: usize) -> Result<usize, Error> {
        let mut count = self.last().all_source.len().min(most);
        while count > LEAST && self.reach(fit, count, neighbours)? < REACH * fit.mixture.sigma {
            count = (count * 3 / 5).max(LEAST);
        }
        Ok(count)
    }

    /// Return how far the neighbours of a target point reach, of so many source points: the median of a few.
    fn reach(&self, fit: &Fit, source_points: usize, neighbours: usize) -> Result<f64, Error> {
        let few = self.prepared([source_points; 2], 100, neighbours, "points")?;
        Ok(few.and_then(|few| few.place(&fit.theta, false).map(|placed| few.reach(&placed))).unwrap_or(0.0))
    }

    /// Thin both sides of the last stage at random and prepare their likelihood. Where noise lets take part fewer source points than `most`, those
    /// that cover the source stand for all of it: a random few would leave gaps.
    fn prepared(
        &self,
        [num_source, most]: [usize; 2],
        num_target: usize,
        neighbours: usize,
        name: &str,
    ) -> Result<Option<PointsLikelihood<'_>>, Error> {
        let stage = self.last();
        let mut rng = stream(self.parts.settings.seed, name);
        let source = if num_source < most.min(stage.all_source.len()) {
            represent(&stage.all_source, num_source)
        } else {
            draw(&stage.all_source, num_source, &mut rng)
        };
        let source = source.map_err(of_side(Side::Source))?;
        let target = draw(&stage.sides.mapped_target, num_target, &mut rng).map_err(of_side(Side::Target))?;
        let likelihood = PointsLikelihood::new(&stage.problem, &source, target.rows(), neighbours);
        let is_plane = stage.sides.mapped_target.dim() == 2;
        let widest = if is_plane { WIDEST } else { f64::INFINITY };
        likelihood.map(|likelihood| self.surrounded(likelihood, widest)).transpose()
    }

    /// Let a likelihood end early, and see all of the target, while its noise reaches over at most `widest` of its sizes.
    fn surrounded<'s>(&'s self, likelihood: PointsLikelihood<'s>, widest: f64) -> Result<PointsLikelihood<'s>, Error> {
        let surroundings = match self.surroundings.get() {
            Some(known) => known,
            None => {
                let mut rng = stream(self.parts.settings.seed, "surroundings");
                let target = &self.last().sides.mapped_target;
                let target = draw(target, SURROUNDINGS, &mut rng).map_err(of_side(Side::Target))?;
                self.surroundings.get_or_init(|| Neighbours::new(target.rows(), target.dim()))
            }
        };
        Ok(likelihood.with_interrupt(self.interrupt).within(surroundings, widest))
    }

    /// Prepare the likelihood of points that cover both sides: of the source an even part, of the target half an even part, which dense
    /// clutter does not dominate, half a random one, which thin clutter does not.
    pub fn covering(&self, [num_source, num_target]: [usize; 2]) -> Result<Option<PointsLikelihood<'_>>, Error> {
        let stage = self.last();
        let source = self.evenly(&stage.all_source, num_source).map_err(of_side(Side::Source))?;
        let rows = self.parts_of_target(num_target / 2)?.map(|part| part.rows()).concat();
        let likelihood = PointsLikelihood::new(&stage.problem, &source, rows, NEIGHBOURS[0]);
        // Rough fits have more noise than there is.
        likelihood.map(|likelihood| self.surrounded(likelihood, f64::INFINITY)).transpose()
    }

    /// Return an even and a random part of the target.
    pub fn parts_of_target(&self, count: usize) -> Result<[Points; 2], Error> {
        let mut rng = stream(self.parts.settings.seed, "everywhere");
        let target = &self.last().sides.mapped_target;
        let of_target = of_side(Side::Target);
        Ok([self.evenly(target, count).map_err(&of_target)?, draw(target, count, &mut rng).map_err(&of_target)?])
    }

    /// Return an even part of what counts of the points.
    pub fn evenly(&self, points: &Points, count: usize) -> Result<Points, PointsError> {
        if points.is_uniform() {
            return even(points, count);
        }
        even(&draw(points, 0, &mut stream(self.parts.settings.seed, "what counts"))?, count)
    }
}
