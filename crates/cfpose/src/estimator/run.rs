//! From a pipeline to an answer: what is tried, in order of its cost, until a candidate is accepted.

use super::Supervision;
use super::candidate::Candidate;
use super::pipeline::{Outliers, Pipeline};
use super::search::{Search, ranked};
use crate::criteria::Criteria;
use crate::error::Error;

/// One thing to try; the next is tried only while nothing is accepted.
enum Step {
    /// Climb from the given starts.
    Given(Vec<Vec<f64>>),
    /// Climb from perturbed copies of a start.
    Restarts(Vec<f64>, std::ops::Range<usize>),
    /// Climb from the next so many starts of the global strategy.
    Global(usize),
    /// Look for outliers, from the candidates so far and these thetas.
    Outliers(Vec<Vec<f64>>),
    /// Look for a pose that explains a part of both sets.
    Overlap,
}

/// Order what is tried by its cost: a start that fails for its own sake is cheaper to replace than outliers are to find,
/// and both are cheaper than a search everywhere.
fn plan(pipeline: &Pipeline, given: &[Vec<f64>], criteria: &Criteria) -> Vec<Step> {
    let mut steps = vec![Step::Given(given.to_vec())];
    let restarts = if given.len() == 1 { pipeline.restarts } else { 0 };
    if let (Some(start), true) = (given.first(), restarts > 0) {
        steps.push(Step::Restarts(start.clone(), 0..1));
        steps.push(Step::Outliers(given.to_vec()));
        steps.push(Step::Restarts(start.clone(), 1..restarts));
    }
    if given.is_empty() && pipeline.outliers != Outliers::None {
        steps.push(Step::Global(criteria.first_global));
        steps.push(Step::Outliers(Vec::new()));
    }
    if given.is_empty() || pipeline.global_start.is_some() {
        steps.push(Step::Global(usize::MAX));
    }
    steps.push(Step::Outliers(Vec::new()));
    if pipeline.overlap {
        steps.push(Step::Overlap);
    }
    steps
}

/// What came out of a search.
#[derive(Default)]
pub(super) struct Found {
    /// All candidates of the climbs, best first.
    pub all: Vec<Candidate>,
    /// The best, which may be a repaired one that is not among them.
    pub best: Option<Candidate>,
}

impl Search<'_> {
    /// Try one thing after the other until a candidate is accepted.
    ///
    /// # Errors
    /// [`Error`] for misuse of a solver, a start strategy that does not apply, points mapped to infinity.
    pub fn run(&mut self, given: &[Vec<f64>], supervision: &mut Supervision<'_>) -> Result<Found, Error> {
        let mut found = Found::default();
        if self.pipeline.points_start.is_some() && !self.last().model().target.is_moving() {
            return self.run_points(given, supervision);
        }
        for step in plan(self.pipeline, given, &self.parts.criteria) {
            self.take(step, &mut found, supervision)?;
            if found.best.as_ref().is_some_and(|best| best.accepted) {
                break;
            }
        }
        Ok(found)
    }

    /// Climb, then let the likelihood of the points choose.
    fn run_points(&mut self, given: &[Vec<f64>], supervision: &mut Supervision<'_>) -> Result<Found, Error> {
        let mut found = Found::default();
        if given.is_empty() {
            self.take(Step::Global(self.parts.criteria.first_global), &mut found, supervision)?;
        } else {
            self.take(Step::Given(given.to_vec()), &mut found, supervision)?;
        }
        if let Some(modes) = self.modes(&found.all, given)? {
            if let Some(candidate) = self.settle(&modes, supervision)? {
                found.best = Some(candidate);
            }
        }
        Ok(found)
    }

    fn take(&mut self, step: Step, found: &mut Found, supervision: &mut Supervision<'_>) -> Result<(), Error> {
        let more = match step {
            Step::Given(starts) => self.climb_given(&starts, supervision)?,
            Step::Restarts(start, range) => self.restarts(&start, range, supervision)?,
            Step::Global(count) => self.global(count, supervision)?,
            Step::Outliers(starts) => return self.question(found, &starts, supervision),
            Step::Overlap => return self.look_for_overlap(found, supervision),
        };
        if more.is_empty() {
            return Ok(());
        }
        found.all.extend(more);
        found.all = ranked(std::mem::take(&mut found.all));
        let best = &found.all[0];
        // A repaired candidate stays unless the new best is closer to the points.
        let repaired = found.best.as_ref().filter(|kept| kept.clutter.is_some()).and_then(|kept| kept.support);
        let is_closer = repaired.is_none_or(|kept| best.support.is_some_and(|s| s.distance() < kept.distance()));
        if best.accepted || is_closer {
            found.best = Some(best.clone());
        }
        Ok(())
    }

    /// Replace the best where leaving outliers out explains the data better.
    fn question(
        &mut self,
        found: &mut Found,
        starts: &[Vec<f64>],
        supervision: &mut Supervision<'_>,
    ) -> Result<(), Error> {
        let Some(repaired) = self.repair(&found.all, starts, supervision)? else { return Ok(()) };
        let support = repaired.support;
        let is_farther =
            |kept: &Candidate| kept.support.is_none_or(|s| support.distance() < s.distance()) || !kept.plausible;
        let better = found.best.as_ref().is_none_or(is_farther);
        let mut candidate = repaired.candidate;
        if !candidate.accepted && !better {
            return Ok(());
        }
        candidate.clutter = Some(repaired.clutter);
        if !candidate.accepted {
            // The means of what is left still disagree: the robust fit itself is the answer.
            candidate.take(&repaired.fit);
            candidate.plausible = self.is_plausible(&candidate.theta);
        }
        // What the outliers leave unexplained is known; what the source leaves is not.
        candidate.support = Some(support);
        found.best = Some(candidate);
        Ok(())
    }

    /// Replace the best where another pose gives more points of both sides a partner.
    fn look_for_overlap(&mut self, found: &mut Found, supervision: &mut Supervision<'_>) -> Result<(), Error> {
        let Some(best) = &mut found.best else { return Ok(()) };
        let partial = self.parts.criteria.partial;
        if !best.support.is_some_and(|s| s.unexplained_source.max(s.unexplained_target) > partial) {
            return Ok(());
        }
        let Some(overlap) = self.by_overlap(&best.theta, supervision)? else { return Ok(()) };
        best.take(&overlap.fit);
        best.support = Some(self.last().support(&best.theta)?);
        best.plausible = self.is_plausible(&best.theta);
        best.clutter = Some(overlap.clutter);
        Ok(())
    }
}
