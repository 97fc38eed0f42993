//! The order in which thetas are tried for a pattern of several greys.

use super::edges::{Field, Levels};
use super::fit::Schedule;
use super::greys::{BESIDE, Greys};
use super::hunt::Hunt;
use super::joint::pairs;
use super::pattern::{Outline, Pattern};
use super::registrar::{Outlined, Registered, Registrar};
use super::starts::Disturbed;
use super::verdict::FrameVerdict;
use super::view::View;
use crate::segment::median;

/// Disturbed starts of the moments, and of the steps with few places.
const MOMENT_STARTS: usize = 8;
const STEP_STARTS: usize = 200;

/// Fewest steps of a kind whose greys are read off a frame.
const FEW: usize = 12;

/// Share of the steps between greys below which a theta of one threshold is not believed.
const CONTRADICTED: f64 = 0.3;

impl Registrar {
    /// Register by the greys alone.
    pub(super) fn register_greys(
        &self,
        greys: &Greys,
        pattern: &Pattern,
        view: &View,
        last: Option<&[f64]>,
        seed: u64,
    ) -> Option<Registered> {
        let outlined = self.outlined_of(&greys.outline, 1).ok()?;
        let of_greys = view.of_greys();
        let mut hunt = Hunt::new(self, &outlined, pattern, &of_greys);
        hunt.run_greys(greys, last, seed);
        let (theta, ..) = hunt.best.clone()?;
        let levels = self.levels_at(&outlined, &of_greys, &theta);
        let outlined = self.outlined_of(&Outline { levels, ..greys.outline.clone() }, 1).ok()?;
        let mut settled = Hunt::new(self, &outlined, pattern, &of_greys);
        settled.starts = hunt.starts;
        let by = hunt.best.map_or("", |(_, _, by)| by);
        settled.contour(&theta, Schedule::LAST, by);
        self.finished(settled, seed)
    }

    /// Return the greys on both sides of the steps as the frame has them at a theta: of steps of one kind the medians.
    fn levels_at(&self, outlined: &Outlined, view: &View, theta: &[f64]) -> Vec<Levels> {
        let mut levels = outlined.levels.clone();
        let Some(found) = self.search(outlined, view, theta, 3.0) else { return levels };
        let mut kinds: Vec<(Levels, [Vec<f32>; 2])> = Vec::new();
        for (i, level) in outlined.levels.iter().enumerate().filter(|(i, _)| found.distances[*i].abs() < 1.5) {
            let at = |t: f64| {
                let place = [0, 1].map(|d| found.pixels[i][d] + (found.distances[i] + t) * found.across[i][d]);
                view.field.sample(place[0], place[1]).map(|value| value as f32)
            };
            let (Some(inside), Some(outside)) = (at(-BESIDE), at(BESIDE)) else { continue };
            match kinds.iter_mut().find(|(known, _)| known == level) {
                Some((_, [a, b])) => {
                    a.push(inside);
                    b.push(outside);
                }
                None => kinds.push((*level, [vec![inside], vec![outside]])),
            }
        }
        for (kind, [inside, outside]) in kinds.iter_mut().filter(|(_, [inside, _])| inside.len() >= FEW) {
            let (Some(inside), Some(outside)) = (median(inside), median(outside)) else { continue };
            let own = outlined.levels.iter().zip(&mut levels).filter(|(level, _)| *level == kind);
            own.for_each(|(_, level)| *level = Levels { inside, outside, ..*level });
        }
        levels
    }

    /// Choose between what greys and one threshold have found, neither of the greys' accepted: a theta of the threshold is finished on
    /// the steps between greys, and not `good` where they contradict it.
    pub(super) fn of_both(
        &self,
        greys: &Greys,
        pattern: &Pattern,
        view: &View,
        by_greys: Option<Registered>,
        plain: Option<Registered>,
    ) -> Option<Registered> {
        let Some(mut plain) = plain else { return by_greys };
        let outlined = self.outlined_of(&greys.outline, 1).ok()?;
        let of_greys = view.of_greys();
        let mut hunt = Hunt::new(self, &outlined, pattern, &of_greys);
        if hunt.contour(&plain.theta, Schedule::NEAR, "greys-after-threshold") {
            return self.finished(hunt, 0);
        }
        let share = self.quality_of(&outlined, pattern, &of_greys, &plain.theta).share;
        if plain.verdict.accepted() {
            if share < CONTRADICTED {
                plain.verdict = FrameVerdict::Suspect;
                plain.warnings = vec![format!(
                    "the greys contradict it: {:.0} % of the steps between them are in the frame",
                    100.0 * share
                )];
            }
            return Some(plain);
        }
        by_greys.filter(|by_greys| by_greys.quality.share > share).or(Some(plain))
    }
}

impl Hunt<'_> {
    /// Try what is likely first, until a theta is accepted: the last one, moments of the pairs of clusters, steps from afar.
    pub fn run_greys(&mut self, greys: &Greys, last: Option<&[f64]>, seed: u64) {
        let identity = self.registrar.start().to_vec();
        if last.is_some_and(|last| self.contour(last, Schedule::TRACK, "last"))
            || (self.registrar.given && last.is_none() && self.contour(&identity, Schedule::TRACK, "start"))
        {
            return;
        }
        let begin = last.map_or(identity, <[f64]>::to_vec);
        let mut disturbed = Disturbed::new(self.registrar, self.pattern, seed);
        let centred = disturbed.centred(&begin, self.view);
        let (darkness, noise) = self.view.darkness();
        let pairs = pairs(greys, darkness, *noise as f32, self.view.camera);
        let turns =
            [4, 2, 6, 1, 7, 3, 5].map(|k| disturbed.turned(&centred, f64::from(k) * std::f64::consts::FRAC_PI_4));
        let mut starts = vec![begin.clone(), centred.clone()];
        starts.extend(turns);
        starts.extend((0..MOMENT_STARTS).map(|k| disturbed.near(if k % 2 == 0 { &begin } else { &centred }, 1.0)));
        for start in starts.iter().filter(|_| !pairs.is_empty()) {
            let found = self.registrar.by_pairs(&pairs, start);
            let found = found.filter(|theta| self.registrar.is_plausible(self.pattern, theta));
            if found.is_some_and(|theta| self.contour(&theta, Schedule::GREYS, "greys")) {
                return;
            }
        }
        if self.contour(&begin, Schedule::FAR, "greys-contour") {
            return;
        }
        let Some(coarse) = self.registrar.coarse_of(&greys.outline) else { return };
        for k in 0..STEP_STARTS {
            let best = self.best.as_ref().map_or_else(|| begin.clone(), |(theta, ..)| theta.clone());
            let (base, scale) = [(&best, 0.6), (&begin, 1.2), (&centred, 1.2)][k % 3];
            let start = disturbed.near(base, scale);
            if self.screened(&coarse, &start, "greys-disturbed") {
                return;
            }
        }
    }
}
