//! Another of the same: where the most likely theta leaves much of the target unexplained, the source is looked for in the rest.

use super::likelihoods::NEIGHBOURS;
use super::modes::Mode;
use super::search::Search;
use super::workbench::of_side;
use crate::distances::likelihood::{Kernel, PointsLikelihood};
use crate::distances::sampling::{even, thin};
use crate::error::{Error, Side};
use crate::streams::stream;
use cfpose_kernel::points::Points;

/// Target points that are asked whether they are explained.
const ASKED: usize = 8000;
/// A rest of fewer points is no shape.
const LEAST: usize = 50;
/// Thetas of the rest that are polished: some in any case, more while they are about as good.
const POLISHED: [usize; 2] = [2, 3];

impl Search<'_> {
    /// Add the modes that the unexplained rest of the target proposes. Two copies of the source are equally likely, and only one of them
    /// is near the starts that the whole target proposes.
    ///
    /// Modes are compared on the whole target, like all others.
    pub fn add_others(&self, fine: &PointsLikelihood<'_>, all: &mut Vec<Mode>) -> Result<(), Error> {
        let Some(rest) = self.rest(fine, all)? else { return Ok(()) };
        let best = all.first().map_or(f64::NEG_INFINITY, |mode| mode.fit.log_likelihood);
        for theta in self.proposed_by(&rest)? {
            let fit = fine.ascend(&theta, Kernel::Shape, 30, best);
            if let Some(mut fit) = fit.filter(|fit| self.is_usable(fit)) {
                self.add_prior(&mut fit);
                self.insert(fine, fit, all);
            }
        }
        Ok(())
    }

    /// Return the share of the target that neither a mode nor those that the data cannot tell from it explain; `None` where there are none.
    pub fn unexplained(&self, fine: &PointsLikelihood<'_>, chosen: &Mode, others: &[Mode]) -> Option<f64> {
        let equal: Vec<&Mode> = others.iter().filter(|mode| mode.behind.is_equal(&self.parts.criteria)).collect();
        let mut explained = vec![0.0_f64; fine.target.len()];
        for fit in equal.iter().map(|mode| &mode.fit).chain([&chosen.fit]) {
            let mut placed = fine.place(&fit.theta, false)?;
            fine.reweigh(&mut placed, &fit.mixture);
            let shares = fine.responsibilities(&placed, &fit.mixture);
            explained.iter_mut().zip(shares).for_each(|(all, share)| *all = all.max(share));
        }
        let share = 1.0 - explained.iter().sum::<f64>() / explained.len() as f64;
        (!equal.is_empty()).then_some(share)
    }

    /// Return the target points that the most likely mode does not explain, where they are many.
    fn rest(&self, fine: &PointsLikelihood<'_>, all: &[Mode]) -> Result<Option<Points>, Error> {
        let Some(best) = all.first().map(|mode| &mode.fit) else { return Ok(None) };
        if best.mixture.clutter < self.parts.criteria.another || self.interrupt.is_raised() {
            return Ok(None);
        }
        let Some(mut placed) = fine.place(&best.theta, false) else { return Ok(None) };
        fine.reweigh(&mut placed, &best.mixture);
        let mut rng = stream(self.parts.settings.seed, "rest");
        let target = thin(&self.last().sides.mapped_target, ASKED, &mut rng).map_err(of_side(Side::Target))?;
        let explained = fine.responsibilities_of(&placed, &best.mixture, &target.rows());
        let rows: Vec<usize> = (0..target.len()).filter(|k| explained[*k] < 0.5).collect();
        if rows.len() < LEAST {
            return Ok(None);
        }
        target.select(&rows).map(Some).map_err(of_side(Side::Target))
    }

    /// Return the thetas that explain a part of the target best, of those that its features propose and of those from all over.
    fn proposed_by(&self, rest: &Points) -> Result<Vec<Vec<f64>>, Error> {
        let stage = self.last();
        let [num_source, num_target] = self.parts.criteria.coarse_points;
        let source = self.evenly(&stage.all_source, num_source).map_err(of_side(Side::Source))?;
        let target = even(rest, num_target).map_err(of_side(Side::Target))?;
        let coarse = PointsLikelihood::new(&stage.problem, &source, target.rows(), NEIGHBOURS[0]);
        let Some(coarse) = coarse.map(|coarse| coarse.with_interrupt(self.interrupt)) else { return Ok(Vec::new()) };
        let mut scored = self.best_of(&coarse, self.all_over(&target)?);
        let adopted = self.proposed_by_parts(rest)?;
        let adopted = adopted.iter().map(|theta| stage.adopt(theta, self.parts));
        scored.extend(adopted.filter_map(|theta| self.brought_near(&coarse, &theta)));
        scored.retain(|(value, theta)| value.is_finite() && self.is_plausible(theta));
        Ok(self.worth_polishing(scored, POLISHED).into_iter().map(|(_, theta)| theta).collect())
    }
}
