//! Fits whose noise has swallowed a misfit, and what is preferred to them (docs/method.md, *Modes*).

use super::modes::{Behind, Mode, Modes, score};
use super::search::Search;
use crate::distances::likelihood::{Fit, PointsLikelihood};
use crate::error::Error;

/// Where the most likely theta is a misfit: the share of its noise that a second search may use.
const LESS_NOISE: f64 = 0.3;
/// Deviation of theta that counts as one test, where a fit is to be beyond chance: radians, sizes of the source.
const EXACT: f64 = 0.01;

impl Search<'_> {
    /// Say whether neighbouring target points miss the shape together at a fit.
    pub(super) fn is_misfit(&self, fine: &PointsLikelihood<'_>, fit: &Fit) -> bool {
        let Some(mut placed) = fine.place(&fit.theta, false) else { return true };
        fine.reweigh(&mut placed, &fit.mixture);
        self.parts.criteria.is_misfit(fine.coherence(&placed, &fit.mixture), fit.mixture.sigma / fine.size)
    }

    /// Return the modes that are no misfits and far beyond chance: a shape that is squeezed into a dense blob of clutter explains more
    /// points than the right theta, and misses them together. `None` where there are none.
    pub(super) fn sound_modes(&self, fine: &PointsLikelihood<'_>, modes: &Modes) -> Option<Modes> {
        let chance = fine.chance();
        let is_sound = |mode: &&Mode| {
            self.is_beyond_chance(fine, mode.fit.log_likelihood - chance) && !self.is_misfit(fine, &mode.fit)
        };
        let mut all: Vec<Mode> = modes.all.iter().filter(is_sound).cloned().collect();
        let gain = all.first()?.fit.log_likelihood - chance;
        let (best, others) = all.split_at_mut(1);
        best[0].behind = Behind::default();
        others.iter_mut().for_each(|mode| mode.follow(&best[0]));
        Some(Modes { all, gain, ..*modes })
    }

    /// Say whether a gain over clutter, in nats, is more than the best of all thetas would have by chance.
    fn is_beyond_chance(&self, fine: &PointsLikelihood<'_>, gain: f64) -> bool {
        let tests = fine.mover.tangent() as f64 * (std::f64::consts::TAU / EXACT).ln();
        gain > tests - self.parts.criteria.false_alarms * std::f64::consts::LN_10
    }

    /// Look for modes with much less noise than a misfit has; `None` where there are none that are beyond chance, or only misfits again.
    pub(super) fn exact_modes(
        &self,
        coarse: PointsLikelihood<'_>,
        aligned: Vec<(f64, Vec<f64>)>,
        given: &[Vec<f64>],
        misfit: &Fit,
    ) -> Result<Option<Modes>, Error> {
        let most = LESS_NOISE * misfit.mixture.sigma / coarse.size;
        let coarse = coarse.with_noise_below(most).without_edges();
        let again = aligned.into_iter().filter_map(|(_, theta)| score(&coarse, theta)).collect();
        let again = self.ascended(&coarse, self.worth_polishing(again, self.parts.criteria.ascended));
        let source_points = self.compared_points(&again)?;
        let Some(fine) = self.comparison(source_points)? else { return Ok(None) };
        let fine = fine.with_noise_below(most);
        let Some(exact) = self.modes_among(&fine, again, given)? else { return Ok(None) };
        let exact = self.implied_by(&fine, Modes { most_noise: Some(most), source_points, ..exact })?;
        let is_sound = self.is_beyond_chance(&fine, exact.gain) && !self.is_misfit(&fine, &exact.all[0].fit);
        Ok(is_sound.then_some(exact))
    }
}
