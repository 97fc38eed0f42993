//! Where the points' likelihood has its maxima: from what the means found, from given thetas, and everywhere
//! (docs/method.md, *Modes*).

use super::candidate::Candidate;
use super::search::Search;
use super::workbench::of_side;
use crate::criteria::Criteria;
use crate::distances::likelihood::{Fit, Kernel, PointsLikelihood};
use crate::error::{Error, Side};
use cfpose_kernel::points::{Points, PointsError};

/// Reaches of the coarse alignment, in sizes of the target: the first for all starts, the others for the best of them.
const REACHES: [f64; 3] = [0.25, 0.13, 0.07];
/// Steps at each reach.
const STEPS: usize = 4;
/// Thetas closer than this are one mode: radians, sizes of the source.
pub(super) const ONE_MODE: f64 = 0.1;
/// Modes that symmetries imply, polished before it is asked whether they lead anywhere.
const AT_A_TIME: usize = 4;
/// So many equal modes are those of a symmetry, even if some that it implies lead nowhere.
const SYMMETRY: usize = 6;
/// So many times in a row may all of a few lead nowhere then.
const FRUITLESS: usize = 3;
/// Share of clutter up to which several equal modes are all that is looked for: with two copies of the source a half is unexplained.
const SEVERAL: f64 = 0.4;
/// Least noise while starts are sorted: without it the first theta that is polished leaves equal ones far behind.
const COARSE_NOISE: f64 = 0.005;
/// Points of each side that starts are proposed for.
const PROPOSED_FOR: usize = 300;

/// A mode of the likelihood.
#[derive(Debug, Clone)]
pub(super) struct Mode {
    pub fit: Fit,
    /// Behind the most likely one.
    pub behind: Behind,
    /// ln p of every target point; empty where it cannot be computed.
    each: Vec<f64>,
}

impl Mode {
    /// Take a fit as the most likely one so far.
    fn new(fine: &PointsLikelihood<'_>, fit: Fit) -> Self {
        let each = log_each(fine, &fit);
        Self { fit, behind: Behind::default(), each }
    }

    /// Compare with the most likely one.
    pub fn follow(&mut self, best: &Mode) {
        self.behind = Behind::of(best.fit.log_likelihood - self.fit.log_likelihood, &best.each, &self.each);
    }
}

/// How far a fit is behind another.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Behind {
    pub nats: f64,
    /// The same in standard deviations of a sum of as many independent differences.
    pub deviations: f64,
}

impl Behind {
    /// Compare two fits by the nats between them and ln p of every target point.
    fn of(nats: f64, best: &[f64], other: &[f64]) -> Self {
        let differences: Vec<f64> = best.iter().zip(other).map(|(a, b)| a - b).collect();
        let mean = differences.iter().sum::<f64>() / differences.len() as f64;
        let square: f64 = differences.iter().map(|d| (d - mean).powi(2)).sum();
        Self { nats, deviations: if square > 0.0 { nats / square.sqrt() } else { 0.0 } }
    }

    /// Say whether the data cannot tell the two apart.
    pub fn is_equal(&self, criteria: &Criteria) -> bool {
        self.nats < criteria.mode_nats || self.deviations < criteria.mode_deviations
    }

    /// Say whether the other may turn out to be equal once it stands better: without noise a small step is worth many nats.
    pub fn may_be_equal(&self, criteria: &Criteria) -> bool {
        self.is_equal(criteria) || self.deviations < 2.0 * criteria.mode_deviations
    }
}

/// A theta and how likely it is.
pub(super) trait Scored {
    fn value(&self) -> f64;
    fn theta(&self) -> &[f64];
}

impl Scored for (f64, Vec<f64>) {
    fn value(&self) -> f64 {
        self.0
    }

    fn theta(&self) -> &[f64] {
        &self.1
    }
}

impl Scored for Fit {
    fn value(&self) -> f64 {
        self.log_likelihood
    }

    fn theta(&self) -> &[f64] {
        &self.theta
    }
}

/// What the search for modes found, most likely first.
pub(super) struct Modes {
    pub all: Vec<Mode>,
    /// Gain of the best over a target that is all clutter, in nats.
    pub gain: f64,
    /// Largest noise that was allowed, in sizes of the target, where they are of a second search.
    pub most_noise: Option<f64>,
    /// Source points that they are compared on ([`Search::comparison`]).
    pub source_points: usize,
}

impl Search<'_> {
    /// Look for all modes of the likelihood; `None` where it cannot be computed.
    ///
    /// A noise that is large enough explains any two shapes that are a little alike, and can beat a part that fits exactly. So where
    /// neighbouring points miss the shape together at the most likely theta, the search is made again with much less noise; what it
    /// finds is the answer if it is no misfit and far beyond chance.
    pub fn modes(&mut self, found: &[Candidate], given: &[Vec<f64>]) -> Result<Option<Modes>, Error> {
        let Some(coarse) = self.covering(self.parts.criteria.coarse_points)? else { return Ok(None) };
        let coarse = coarse.with_noise_above(COARSE_NOISE);
        let aligned = self.aligned(&coarse, found, given)?;
        let roughly = self.ascended(&coarse, self.worth_polishing(aligned.clone(), self.parts.criteria.ascended));
        let source_points = self.compared_points(&roughly)?;
        let Some(fine) = self.comparison(source_points)? else { return Ok(None) };
        let Some(modes) = self.modes_among(&fine, roughly, given)? else { return Ok(None) };
        let modes = self.implied_by(&fine, Modes { source_points, ..modes })?;
        let first = &modes.all[0].fit;
        if !self.is_misfit(&fine, first) {
            return Ok(Some(modes));
        }
        let sound = self.sound_modes(&fine, &modes);
        let exact = self.exact_modes(coarse, aligned, given, first)?;
        let best = |modes: &Modes| modes.all[0].fit.log_likelihood;
        let found = [sound, exact].into_iter().flatten().max_by(|a, b| best(a).total_cmp(&best(b)));
        Ok(Some(found.unwrap_or(modes)))
    }

    /// Polish rough fits and given thetas into modes; `None` where there is none, or where it is time to end.
    pub(super) fn modes_among(
        &self,
        fine: &PointsLikelihood<'_>,
        roughly: Vec<Fit>,
        given: &[Vec<f64>],
    ) -> Result<Option<Modes>, Error> {
        if self.interrupt.is_raised() {
            return Ok(None);
        }
        let mut fits: Vec<Fit> = Vec::new();
        for rough in self.worth_polishing(roughly, self.parts.criteria.polished) {
            let most = most_likely(&fits).map_or(f64::NEG_INFINITY, |fit| fit.log_likelihood);
            let shape = fine.ascend_from(&rough, 30, most);
            self.add_copies(fine, shape, &mut fits);
        }
        // A given start is refined where it is, however far it is behind at first.
        for theta in given.iter().map(|theta| self.last().adopt(theta, self.parts)) {
            let shape = fine.ascend(&theta, Kernel::Shape, 30, f64::NEG_INFINITY);
            self.add_copies(fine, shape, &mut fits);
        }
        // What the model says the best may also be: a mirrored tilt, a second decomposition.
        if let Some(best) = most_likely(&fits).map(|fit| fit.theta.clone()) {
            for theta in self.last().implied(&best, self.parts) {
                let most = most_likely(&fits).map_or(f64::NEG_INFINITY, |fit| fit.log_likelihood);
                let shape = fine.ascend(&theta, Kernel::Shape, 30, most);
                self.add_copies(fine, shape, &mut fits);
            }
        }
        fits.iter_mut().for_each(|fit| self.add_prior(fit));
        let all = self.distinct(fine, fits);
        let gain = all.first().map_or(0.0, |mode| mode.fit.log_likelihood - fine.chance());
        Ok((!all.is_empty()).then_some(Modes { all, gain, most_noise: None, source_points: 0 }))
    }

    /// Add what the modes imply: those of the symmetries of the source, and those of the rest of the target, unless there are several answers
    /// that explain most of it and can be believed.
    pub(super) fn implied_by(&self, fine: &PointsLikelihood<'_>, modes: Modes) -> Result<Modes, Error> {
        let mut all = self.completed(fine, modes.all);
        let best = &all[0].fit;
        let has_equal = all[1..].iter().any(|mode| mode.behind.is_equal(&self.parts.criteria));
        if !has_equal || best.mixture.clutter > SEVERAL || self.is_misfit(fine, best) {
            self.add_others(fine, &mut all)?;
        }
        let gain = all[0].fit.log_likelihood - fine.chance();
        Ok(Modes { all, gain, ..modes })
    }

    pub(super) fn add_prior(&self, fit: &mut Fit) {
        if let Some(prior) = &self.parts.prior {
            fit.log_likelihood += prior.log_density(&fit.theta);
        }
    }

    /// Sort fits, most likely first, and leave out those that are the same as a better one.
    fn distinct(&self, fine: &PointsLikelihood<'_>, mut fits: Vec<Fit>) -> Vec<Mode> {
        fits.sort_by(|a, b| b.log_likelihood.total_cmp(&a.log_likelihood));
        let mut all: Vec<Mode> = Vec::new();
        fits.into_iter().for_each(|fit| self.insert(fine, fit, &mut all));
        all
    }

    /// Insert a fit among modes, most likely first, where it is no other one again.
    pub(super) fn insert(&self, fine: &PointsLikelihood<'_>, fit: Fit, all: &mut Vec<Mode>) {
        if let Some(same) = all.iter().position(|mode| self.apart(&mode.fit.theta, &fit.theta) <= ONE_MODE) {
            if all[same].fit.log_likelihood >= fit.log_likelihood {
                return;
            }
            all.remove(same);
        }
        let at = all.partition_point(|mode| mode.fit.log_likelihood >= fit.log_likelihood);
        let mut mode = Mode::new(fine, fit);
        if at > 0 {
            mode.follow(&all[0]);
        }
        all.insert(at, mode);
        if at == 0 {
            let (best, others) = all.split_at_mut(1);
            others.iter_mut().for_each(|mode| mode.follow(&best[0]));
        }
    }

    /// Add the modes that the symmetries of the source make of the equal ones, a few at a time, until there are no new ones or enough.
    ///
    /// A symmetry leads where it says. A few proposals that all lead nowhere, or somewhere else, say that the equal modes are no symmetry;
    /// where there are many, that has to happen again and again.
    fn completed(&self, fine: &PointsLikelihood<'_>, mut all: Vec<Mode>) -> Vec<Mode> {
        let most = self.parts.criteria.polished[1];
        let equal = |all: &[Mode]| all.iter().filter(|mode| mode.behind.is_equal(&self.parts.criteria)).count();
        let (mut tried, mut fruitless): (Vec<Vec<f64>>, usize) = (Vec::new(), 0);
        loop {
            let before = equal(&all);
            let proposed = self.symmetric(&all, &tried, AT_A_TIME.min(most.saturating_sub(tried.len())));
            if proposed.is_empty() || self.interrupt.is_raised() {
                return all;
            }
            let best = all.first().map_or(f64::NEG_INFINITY, |mode| mode.fit.log_likelihood);
            fruitless += 1;
            for theta in proposed {
                let fit = fine.ascend(&theta, Kernel::Shape, 30, best);
                if let Some(mut fit) = fit.filter(|fit| self.is_usable(fit)) {
                    let (is_there, known) = (self.apart(&theta, &fit.theta) <= 2.0 * ONE_MODE, equal(&all));
                    self.add_prior(&mut fit);
                    self.insert(fine, fit, &mut all);
                    if is_there && equal(&all) > known {
                        fruitless = 0;
                    }
                }
                tried.push(theta);
            }
            if fruitless >= if before < SYMMETRY { 1 } else { FRUITLESS } {
                return all;
            }
        }
    }

    pub(super) fn is_usable(&self, fit: &Fit) -> bool {
        fit.log_likelihood.is_finite() && self.is_plausible(&fit.theta)
    }

    /// Return scored thetas: candidates and given ones as they are and aligned, and the best of those from everywhere.
    fn aligned(
        &self,
        coarse: &PointsLikelihood<'_>,
        found: &[Candidate],
        given: &[Vec<f64>],
    ) -> Result<Vec<(f64, Vec<f64>)>, Error> {
        let adopt = |theta: &Vec<f64>| self.last().adopt(theta, self.parts);
        let mut scored: Vec<(f64, Vec<f64>)> = Vec::new();
        for theta in found.iter().map(|candidate| &candidate.theta).chain(given).map(adopt) {
            let aligned = coarse.align(&theta, &REACHES, STEPS);
            scored.extend(score(coarse, theta));
            scored.extend(aligned.and_then(|(_, theta)| score(coarse, theta)));
        }
        let target = &self.last().sides.mapped_target;
        scored.extend(
            self.proposed_by_parts(target)?.iter().map(adopt).filter_map(|theta| self.brought_near(coarse, &theta)),
        );
        scored.extend(self.best_of(coarse, self.everywhere()?));
        scored.retain(|(value, theta)| value.is_finite() && self.is_plausible(theta));
        Ok(scored)
    }

    /// Align thetas from all over; return the best that differ, scored.
    pub(super) fn best_of(&self, coarse: &PointsLikelihood<'_>, thetas: Vec<Vec<f64>>) -> Vec<(f64, Vec<f64>)> {
        let most = self.parts.criteria.aligned;
        // Half of the steps tell which starts deserve the other half.
        let halfway = |theta: &Vec<f64>| coarse.align(theta, &REACHES[..1], STEPS / 2);
        let best_first = |mut rough: Vec<(f64, Vec<f64>)>| {
            rough.sort_by(|a, b| b.0.total_cmp(&a.0));
            rough
        };
        let adopted = thetas.iter().map(|theta| self.last().adopt(theta, self.parts));
        let mut rough = best_first(adopted.filter_map(|theta| halfway(&theta)).collect());
        rough.truncate((rough.len() / 3).max(2 * most));
        let rough = best_first(rough.iter().filter_map(|(_, theta)| halfway(theta)).collect());
        // Many starts lead to one place.
        let mut chosen: Vec<Vec<f64>> = Vec::new();
        for (_, theta) in rough {
            let is_new = |theta: &Vec<f64>| chosen.iter().all(|other| self.apart(other, theta) > ONE_MODE);
            if chosen.len() < most && is_new(&theta) && self.is_plausible(&theta) {
                chosen.push(theta);
            }
        }
        chosen.iter().filter_map(|theta| self.brought_near(coarse, theta)).collect()
    }

    /// Align a theta that is not far off; a wide reach would pull it towards what only one side shows.
    pub(super) fn brought_near(&self, coarse: &PointsLikelihood<'_>, theta: &[f64]) -> Option<(f64, Vec<f64>)> {
        coarse.align(theta, &REACHES[1..], STEPS).and_then(|(_, theta)| score(coarse, theta))
    }

    /// Return thetas that a part of the source and a part of `target` propose together.
    pub(super) fn proposed_by_parts(&self, target: &Points) -> Result<Vec<Vec<f64>>, Error> {
        let Some(name) = self.pipeline.points.as_ref().and_then(|points| points.parts.as_ref()) else {
            return Ok(Vec::new());
        };
        if self.interrupt.is_raised() {
            return Ok(Vec::new());
        }
        let stage = self.last();
        self.proposals_for(name, stage, &stage.sides.source, target)
    }

    /// Return thetas all over the model's manifold, from both parts of the target: of the second one what differs, which is little where
    /// there is no clutter.
    fn everywhere(&self) -> Result<Vec<Vec<f64>>, Error> {
        let [even, random] = self.parts_of_target(PROPOSED_FOR)?;
        let (mut thetas, others) = (self.all_over(&even)?, self.all_over(&random)?);
        let differs =
            |(k, theta): &(usize, Vec<f64>)| thetas.get(*k).is_none_or(|same| self.apart(same, theta) > ONE_MODE);
        let others: Vec<Vec<f64>> = others.into_iter().enumerate().filter(differs).map(|(_, theta)| theta).collect();
        thetas.extend(others);
        Ok(thetas)
    }

    /// Return thetas all over the model's manifold that put the source on `target` without what lies far outside of it.
    pub(super) fn all_over(&self, target: &Points) -> Result<Vec<Vec<f64>>, Error> {
        let Some(name) = self.pipeline.points.as_ref().and_then(|points| points.start.as_ref()) else {
            return Ok(Vec::new());
        };
        let stage = self.last();
        let source = self.evenly(&stage.sides.source, PROPOSED_FOR).map_err(of_side(Side::Source))?;
        let target = central(target).map_err(of_side(Side::Target))?;
        self.proposals_for(name, stage, &source, &target)
    }

    /// Return the best that differ: some in any case, more while they are about as good.
    pub(super) fn worth_polishing<T: Scored>(&self, mut scored: Vec<T>, [always, most]: [usize; 2]) -> Vec<T> {
        let criteria = &self.parts.criteria;
        scored.sort_by(|a, b| b.value().total_cmp(&a.value()));
        let best = scored.first().map_or(0.0, T::value);
        let mut kept: Vec<T> = Vec::new();
        for item in scored {
            let wanted = kept.len() < always || kept.len() < most && item.value() > best - criteria.about_as_good;
            if wanted && kept.iter().all(|other| self.apart(other.theta(), item.theta()) > 1.5 * ONE_MODE) {
                kept.push(item);
            }
        }
        kept
    }

    /// Ascend the likelihood of few points, as a shape: what is far behind there need not be polished on more.
    pub(super) fn ascended(&self, coarse: &PointsLikelihood<'_>, starts: Vec<(f64, Vec<f64>)>) -> Vec<Fit> {
        let mut fits: Vec<Fit> = Vec::new();
        for (_, theta) in starts {
            let most = most_likely(&fits).map_or(f64::NEG_INFINITY, |fit| fit.log_likelihood);
            let fit = coarse.ascend(&theta, Kernel::Shape, 12, most);
            fits.extend(fit.filter(|fit| self.is_usable(fit)));
        }
        fits
    }

    /// Add a fit of the shape, and one of copies from there: where nearly all source points take part.
    fn add_copies(&self, fine: &PointsLikelihood<'_>, shape: Option<Fit>, fits: &mut Vec<Fit>) {
        let Some(shape) = shape else { return };
        let most = most_likely(fits).map_or(f64::NEG_INFINITY, |fit| fit.log_likelihood);
        let has_all = 4 * fine.mover.len() > 3 * self.last().all_source.len();
        let copies =
            has_all.then(|| fine.ascend(&shape.theta, Kernel::Copies, 8, most.max(shape.log_likelihood))).flatten();
        fits.extend([Some(shape), copies].into_iter().flatten().filter(|fit| self.is_usable(fit)));
    }
}

fn most_likely(fits: &[Fit]) -> Option<&Fit> {
    fits.iter().max_by(|a, b| a.log_likelihood.total_cmp(&b.log_likelihood))
}

/// Return by how many nats a fit is behind another, and that in standard deviations of a sum of as many independent differences: Vuong's
/// test (1989) of two models that do not contain each other. Where the target is a new sample of a symmetric shape, one of the
/// equal poses is ahead by chance, by more nats the more points there are.
pub(super) fn behind(likelihood: &PointsLikelihood<'_>, best: &Fit, other: &Fit) -> Behind {
    let nats = best.log_likelihood - other.log_likelihood;
    Behind::of(nats, &log_each(likelihood, best), &log_each(likelihood, other))
}

/// Return ln p of every target point at a fit; nothing where a point is mapped to infinity.
fn log_each(likelihood: &PointsLikelihood<'_>, fit: &Fit) -> Vec<f64> {
    let Some(mut placed) = likelihood.place(&fit.theta, false) else { return Vec::new() };
    likelihood.reweigh(&mut placed, &fit.mixture);
    likelihood.log_each(&placed, &fit.mixture)
}

/// Score a theta by the likelihood of its best mixture.
pub(super) fn score(likelihood: &PointsLikelihood<'_>, theta: Vec<f64>) -> Option<(f64, Vec<f64>)> {
    let mut placed = likelihood.place(&theta, false)?;
    Some((likelihood.best_mixture(&mut placed, Kernel::Shape, 5).1, theta))
}

/// Leave out what is farther from the middle than three times the median distance.
fn central(points: &Points) -> Result<Points, PointsError> {
    let dim = points.dim();
    let middle: Vec<f64> = (0..dim)
        .map(|d| {
            let mut column = points.column(d).to_vec();
            column.sort_by(f64::total_cmp);
            column[column.len() / 2]
        })
        .collect();
    let distance = |k: usize| (0..dim).map(|d| (points.column(d)[k] - middle[d]).powi(2)).sum::<f64>().sqrt();
    let distances: Vec<f64> = (0..points.len()).map(distance).collect();
    let mut sorted = distances.clone();
    sorted.sort_by(f64::total_cmp);
    let limit = 3.0 * sorted[sorted.len() / 2];
    let rows: Vec<usize> = (0..points.len()).filter(|k| distances[*k] <= limit).collect();
    if rows.len() < 3 { Ok(points.clone()) } else { points.select(&rows) }
}
