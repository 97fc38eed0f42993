//! From a pipeline to an answer: what is tried, in order of its cost, until a candidate is accepted.

use super::Watch;
use super::candidate::Candidate;
use super::pipeline::{Outliers, Pipeline};
use super::search::{Search, Stages, ranked};
use crate::criteria::Criteria;
use crate::error::Error;

/// One thing to try; the next is tried only while nothing is accepted.
enum Step {
    /// Climb from the given starts.
    Given(Vec<Vec<f64>>),
    /// Climb from perturbed copies of a start, so many.
    Restarts(Vec<f64>, usize),
    /// Climb from the next so many starts of the global strategy.
    Global(usize),
    /// Look for outliers.
    Outliers,
}

/// Order what is tried by its cost. Where the points have the last word, the means only have to lead somewhere.
fn plan(pipeline: &Pipeline, given: &[Vec<f64>], criteria: &Criteria) -> Vec<Step> {
    if pipeline.points.is_some() {
        return vec![match given {
            [] => Step::Global(criteria.first_global),
            _ => Step::Given(given.to_vec()),
        }];
    }
    let mut steps = vec![Step::Given(given.to_vec())];
    if let ([start], true) = (given, pipeline.restarts > 0) {
        steps.push(Step::Restarts(start.clone(), pipeline.restarts));
    }
    if given.is_empty() || pipeline.global_start.is_some() {
        steps.push(Step::Global(usize::MAX));
    }
    if pipeline.outliers != Outliers::None {
        steps.push(Step::Outliers);
    }
    steps
}

/// What came out of a search.
#[derive(Default)]
pub(super) struct Found {
    /// All candidates of the climbs, best first; none where a part of the points led to the answer.
    pub all: Vec<Candidate>,
    /// The best, which may be a repaired one that is not among them.
    pub best: Option<Candidate>,
    /// Nothing was left out because of a deadline or a cancel flag.
    pub finished: bool,
}

impl Search<'_> {
    /// Try one thing after the other until a candidate is accepted; where the points have the last word, on a part of many points first.
    ///
    /// # Errors
    /// [`Error`] for misuse of a solver, a start strategy that does not apply, points mapped to infinity.
    pub fn run(&mut self, given: &[Vec<f64>], watch: &mut Watch<'_>) -> Result<Found, Error> {
        let mut found = Found::default();
        if let Some(all) = self.explored(given, watch)? {
            found.best = self.by_points(&all, given, watch)?;
            if found.best.is_none() && self.interrupt.is_raised() {
                // On all points nothing was solved: the best on a part is the best there is.
                let best = all.first().map(|best| self.last().unsolved(&best.theta, self.parts));
                let plausible = |best: Candidate| Candidate { plausible: self.is_plausible(&best.theta), ..best };
                found.best = best.map(|best| plausible(best).on(&self.stages.data));
            }
        }
        if found.best.is_none() && !self.interrupt.is_raised() {
            self.climb_by_plan(given, &mut found, watch)?;
            if self.has_points() && !self.interrupt.is_raised() {
                let best = self.by_points(&found.all, given, watch)?;
                found.best = best.or(found.best);
            }
        }
        found.finished = !self.interrupt.is_raised();
        Ok(found)
    }

    /// Say whether the likelihood of the points has the last word.
    fn has_points(&self) -> bool {
        self.pipeline.points.is_some() && !self.last().model().target.is_moving()
    }

    /// Climb, one step of the plan after the other, until a candidate is accepted.
    fn climb_by_plan(&mut self, given: &[Vec<f64>], found: &mut Found, watch: &mut Watch<'_>) -> Result<(), Error> {
        for step in plan(self.pipeline, given, &self.parts.criteria) {
            self.take(step, found, watch)?;
            if self.interrupt.is_raised() || found.best.as_ref().is_some_and(|best| best.accepted) {
                break;
            }
        }
        Ok(())
    }

    /// Climb on a part of many points, where the points have the last word and the means only have to lead somewhere; `None` where there
    /// are not so many.
    fn explored(&mut self, given: &[Vec<f64>], watch: &mut Watch<'_>) -> Result<Option<Vec<Candidate>>, Error> {
        let most = self.parts.criteria.explored;
        let data = &self.stages.data;
        if !self.has_points() || most == 0 || data.source.len().max(data.target.len()) <= 2 * most {
            return Ok(None);
        }
        // A part that cannot be set up, because hardly a point has weight, is none.
        let Ok(part) = data.thinned(most, self.parts.settings.seed) else { return Ok(None) };
        let Ok(stages) = Stages::new(self.parts, part, self.pipeline, 0) else { return Ok(None) };
        let mut search = Search::new(self.parts, self.pipeline, &stages, self.interrupt);
        let mut found = Found::default();
        search.climb_by_plan(given, &mut found, watch)?;
        self.absorb(0, &search);
        self.starts += search.starts;
        // What statistics say of a part they do not say of all.
        found.all.iter_mut().for_each(|candidate| candidate.accepted = false);
        Ok(Some(found.all))
    }

    /// Let the likelihood of the points choose.
    fn by_points(
        &mut self,
        all: &[Candidate],
        given: &[Vec<f64>],
        watch: &mut Watch<'_>,
    ) -> Result<Option<Candidate>, Error> {
        let Some(modes) = self.modes(all, given)? else { return Ok(None) };
        let settled = self.settle(&modes, all, given, watch)?;
        Ok(settled.filter(|_| !self.interrupt.is_raised()))
    }

    fn take(&mut self, step: Step, found: &mut Found, watch: &mut Watch<'_>) -> Result<(), Error> {
        let more = match step {
            Step::Given(starts) => self.climb_given(&starts, watch)?,
            Step::Restarts(start, count) => self.restarts(&start, 0..count, watch)?,
            Step::Global(count) => self.global(count, watch)?,
            Step::Outliers => return self.question(found, watch),
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
    fn question(&mut self, found: &mut Found, watch: &mut Watch<'_>) -> Result<(), Error> {
        let Some(repaired) = self.repair(watch)? else { return Ok(()) };
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
}
