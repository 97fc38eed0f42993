//! The search: candidates climb through the stages from every start; starts are proposed, screened, perturbed.

use std::cell::OnceCell;

use cfpose_optim::Interrupt;
use cfpose_optim::manifold::Manifold;
use cfpose_optim::problem::LeastSquares;
use rand::RngExt;
use rand_chacha::ChaCha12Rng;
use rand_distr::StandardNormal;

use super::candidate::Candidate;
use super::estimate::StageReport;
use super::pipeline::Pipeline;
use super::settings::Start;
use super::stage::ReadyStage;
use super::workbench::{Data, Workbench};
use super::{Parts, Watch};
use crate::distances::neighbours::Neighbours;
use crate::error::Error;
use crate::geometry::theta::BlockKind;
use crate::model::{LinearKind, Scene};
use crate::start::StartContext;
use crate::streams::stream;
use cfpose_kernel::points::Points;

/// Stages of a pipeline on one pair of point sets: built once, solved many times.
pub(super) struct Stages {
    pub ready: Vec<ReadyStage>,
    pub data: Data,
}

impl Stages {
    /// Build all stages of a pipeline from the stage `first` on.
    pub fn new(parts: &Parts, data: Data, pipeline: &Pipeline, first: usize) -> Result<Self, Error> {
        let mut workbench = Workbench::new(parts, &data);
        let ready =
            pipeline.stages[first..].iter().map(|stage| workbench.stage(stage)).collect::<Result<Vec<_>, _>>()?;
        Ok(Self { ready, data })
    }

    /// Return the last stage: the one whose problem is reported.
    pub fn last(&self) -> &ReadyStage {
        &self.ready[self.ready.len() - 1]
    }
}

/// A pipeline at work on its stages.
pub(super) struct Search<'a> {
    pub parts: &'a Parts,
    pub pipeline: &'a Pipeline,
    pub stages: &'a Stages,
    pub reports: Vec<StageReport>,
    pub iterations: usize,
    pub starts: usize,
    /// Size of the source in the unit of a translation: twice its root mean square radius.
    pub size: f64,
    /// When to end early.
    pub interrupt: Interrupt<'a>,
    /// The target as the likelihood of the points sees it, once it is asked for.
    pub surroundings: OnceCell<Neighbours>,
    /// Screened global starts with their costs, best last; `None` before the screening.
    queue: Option<Vec<(f64, Vec<f64>)>>,
}

impl<'a> Search<'a> {
    /// Begin.
    pub fn new(parts: &'a Parts, pipeline: &'a Pipeline, stages: &'a Stages, interrupt: Interrupt<'a>) -> Self {
        let reports = stages.ready.iter().map(|stage| StageReport::new(&stage.stage.name)).collect();
        let stage = stages.last();
        // A rigid map keeps lengths; a similarity or an affine map puts the target's on translations.
        let stretches = stage.model().linear.as_ref().is_some_and(|group| group.kind != LinearKind::Rotation);
        let points = if stretches { &stage.sides.mapped_target } else { &stage.sides.source };
        let covariance = points.covariance();
        let size = 2.0 * (covariance[0][0] + covariance[1][1] + covariance[2][2]).sqrt();
        let size = if size > 0.0 { size } else { 1.0 };
        let (surroundings, queue) = (OnceCell::new(), None);
        Self { parts, pipeline, stages, reports, iterations: 0, starts: 0, size, interrupt, surroundings, queue }
    }

    /// Add the work of a search over the stages from `first` on, on a part of the points.
    pub fn absorb(&mut self, first: usize, other: &Search<'_>) {
        self.iterations += other.iterations;
        for (report, part) in self.reports[first..].iter_mut().zip(&other.reports) {
            report.add(part);
        }
    }

    /// Return the last stage.
    pub fn last(&self) -> &'a ReadyStage {
        self.stages.last()
    }

    /// Say whether theta is within the bounds and the model finds it plausible: in front of the camera, front-facing.
    pub fn is_plausible(&self, theta: &[f64]) -> bool {
        let stage = self.last();
        let scene = Scene { theta: &theta[..stage.own()], source: &stage.sides.source, target: &stage.sides.target };
        self.parts.admits(&theta[..stage.own()]) && !(stage.model().examine)(&scene).implausible
    }

    /// Solve one stage and count.
    fn solve(&mut self, index: usize, theta: &[f64], watch: &mut Watch<'_>) -> Result<Candidate, Error> {
        let solved = self.stages.ready[index].solve(theta, self.parts, watch)?;
        self.reports[index].count(solved.evaluations);
        self.iterations += solved.iterations;
        Ok(solved)
    }

    /// Lead one theta through all stages; `None` where a gate or a solver gave it up.
    pub fn climb(&mut self, theta: &[f64], watch: &mut Watch<'_>) -> Result<Option<Candidate>, Error> {
        self.climb_from(0, theta, watch)
    }

    /// Lead one theta through the stages from `first` on; `None` as of [`Search::climb`].
    pub fn climb_from(
        &mut self,
        first: usize,
        theta: &[f64],
        watch: &mut Watch<'_>,
    ) -> Result<Option<Candidate>, Error> {
        let (mut theta, mut last) = (theta.to_vec(), None);
        let count = self.stages.ready.len();
        for index in first..count {
            let solved = self.solve(index, &theta, watch)?;
            if self.interrupt.is_raised() && (index + 1 < count || !solved.outcome.usable()) {
                return Ok(Some(self.last().unsolved(&solved.theta, self.parts).on(&self.stages.data)));
            }
            let gated = self.stages.ready[index].stage.gate;
            let passes = solved.outcome.usable() && (!gated || self.is_plausible(&solved.theta));
            if !passes && index + 1 < count {
                self.reports[index].rejected += 1;
                return Ok(None);
            }
            theta.clone_from(&solved.theta);
            last = Some(solved);
        }
        last.map(|solved| self.weigh(solved)).transpose()
    }

    /// Judge a solution of the last stage: is it plausible, do statistics and distances agree with it, how does it rank.
    fn weigh(&self, mut found: Candidate) -> Result<Candidate, Error> {
        found.plausible = self.is_plausible(&found.theta);
        let usable = found.outcome.usable();
        if self.pipeline.support && usable && !self.interrupt.is_raised() {
            found.support = Some(self.last().support(&found.theta)?);
        }
        let agrees = found.statistics.as_ref().is_some_and(|s| s.reduced() < self.pipeline.accept);
        let coherent = found.support.is_some_and(|s| s.coherence > self.parts.criteria.coherent);
        let score = match (&found.support, self.pipeline.support) {
            (Some(support), true) => support.distance(),
            _ => found.outcome.cost,
        };
        let penalty = if found.plausible && usable { 0.0 } else { 1e6 };
        found.accepted = usable && found.plausible && agrees && !coherent;
        found.score = if score.is_finite() { score + penalty } else { f64::MAX };
        Ok(found.on(&self.stages.data))
    }

    /// Return the thetas to begin with: given ones, or those of a named strategy; none where the pipeline searches by itself.
    pub fn given(&self) -> Result<Vec<Vec<f64>>, Error> {
        let settings = &self.parts.settings;
        match &settings.start {
            Some(Start::Given(thetas)) => Ok(thetas.clone()),
            Some(Start::Named(name)) => {
                let starts = self.proposals(name, self.stages.first())?;
                if starts.is_empty() {
                    let problem =
                        format!("start `{name}` proposes nothing for these points; use another start or a theta");
                    return Err(Error::Unsupported(problem));
                }
                Ok(starts)
            }
            None if self.parts.prior.is_some() => {
                Ok(self.parts.prior.iter().map(|prior| self.parts.hold(prior.theta())).collect())
            }
            None if settings.preset == "paper" => self.proposals("identity", self.stages.first()),
            None => Ok(Vec::new()),
        }
    }

    /// Climb from each of the given starts.
    pub fn climb_given(&mut self, given: &[Vec<f64>], watch: &mut Watch<'_>) -> Result<Vec<Candidate>, Error> {
        let mut found = Vec::new();
        for start in given {
            self.starts += 1;
            found.extend(self.climb(start, watch)?);
            if self.interrupt.is_raised() {
                break;
            }
        }
        Ok(ranked(found))
    }

    /// Climb from perturbed copies of a start, the restarts `range`, until one is accepted.
    pub fn restarts(
        &mut self,
        start: &[f64],
        range: std::ops::Range<usize>,
        watch: &mut Watch<'_>,
    ) -> Result<Vec<Candidate>, Error> {
        let (mut found, spreads) = (Vec::new(), self.parts.criteria.perturb);
        for trial in range.start..range.end.min(self.pipeline.restarts) {
            let mut rng = stream(self.parts.settings.seed, &format!("perturb-{trial}"));
            let moved = self.perturbed(start, spreads[trial % spreads.len()], &mut rng);
            self.starts += 1;
            let candidate = self.climb(&moved, watch)?;
            let accepted = candidate.as_ref().is_some_and(|c| c.accepted);
            found.extend(candidate);
            if accepted || self.interrupt.is_raised() {
                break;
            }
        }
        Ok(ranked(found))
    }

    /// Return the unweighted cost of a stage at theta; infinite once it is time to end.
    fn cost(&self, stage: &ReadyStage, theta: &[f64]) -> f64 {
        if self.interrupt.is_raised() { f64::INFINITY } else { stage.cost(theta, self.parts) }
    }

    /// Propose starts by name for a stage, what is fixed held at its value.
    pub fn proposals(&self, name: &str, stage: &ReadyStage) -> Result<Vec<Vec<f64>>, Error> {
        self.proposals_for(name, stage, &stage.sides.source, &stage.sides.mapped_target)
    }

    /// Propose starts for a part of both sides.
    pub fn proposals_for(
        &self,
        name: &str,
        stage: &ReadyStage,
        source: &Points,
        target: &Points,
    ) -> Result<Vec<Vec<f64>>, Error> {
        let cost = |theta: &[f64]| self.cost(stage, theta);
        let context = StartContext {
            model: stage.model(),
            source,
            target,
            cost: &cost,
            seed: self.parts.settings.seed,
            freedom: self.parts.freedom.as_ref(),
        };
        let proposed = self.parts.registry.start(name)?.starts(&context)?;
        Ok(proposed.iter().enumerate().map(|(number, theta)| self.parts.hold_start(theta, number)).collect())
    }

    /// Return how many stages the global starts are screened by; 0 for none.
    fn screening(&self) -> usize {
        if self.pipeline.keep == 0 { 0 } else { self.pipeline.screening_stages.min(self.stages.ready.len() - 1) }
    }

    /// Lead the starts of the global strategy through the first stages and queue the best different ones, best last.
    fn screen(&mut self, watch: &mut Watch<'_>) -> Result<Vec<(f64, Vec<f64>)>, Error> {
        let name = self.pipeline.global_start.clone().unwrap_or_else(|| "identity".to_string());
        let mut proposals = self.proposals(&name, self.stages.first())?;
        let (screening, keep) = (self.screening(), self.pipeline.keep);
        if screening == 0 {
            self.starts += proposals.len();
            return Ok(proposals.into_iter().rev().map(|theta| (0.0, theta)).collect());
        }
        // Before any solve: the cheapest cost of the first stage, the best of a large set.
        let most = self.parts.criteria.screened * keep;
        if proposals.len() > most {
            let cost = |theta: Vec<f64>| (self.cost(self.stages.first(), &theta), theta);
            let mut costs: Vec<(f64, Vec<f64>)> = proposals.into_iter().map(cost).collect();
            costs.sort_by(|a, b| a.0.total_cmp(&b.0));
            proposals = costs.into_iter().take(most).map(|(_, theta)| theta).collect();
        }
        let mut screened: Vec<(f64, Vec<f64>)> = Vec::new();
        for start in &proposals {
            self.starts += 1;
            let (mut theta, mut cost) = (start.clone(), f64::INFINITY);
            for index in 0..screening {
                let solved = self.solve(index, &theta, watch)?;
                cost = if solved.outcome.usable() { solved.outcome.cost } else { f64::INFINITY };
                theta.clone_from(&solved.theta);
            }
            screened.push((cost, theta));
            if self.interrupt.is_raised() {
                break;
            }
        }
        screened.sort_by(|a, b| a.0.total_cmp(&b.0));
        if self.interrupt.is_raised() {
            screened.truncate(1);
            return Ok(screened);
        }
        let mut kept: Vec<(f64, Vec<f64>)> = Vec::new();
        for (cost, theta) in screened {
            let different = kept.iter().all(|(_, other)| !self.is_same(other, &theta));
            if cost.is_finite() && self.is_plausible(&theta) && kept.len() < keep && different {
                kept.push((cost, theta));
            }
        }
        kept.reverse();
        Ok(kept)
    }

    /// Lead the next `count` queued starts through the remaining stages.
    ///
    /// An accepted pose ends the search, unless the next start was about as good so far: both are then reported.
    pub fn global(&mut self, count: usize, watch: &mut Watch<'_>) -> Result<Vec<Candidate>, Error> {
        let mut queue = match self.queue.take() {
            Some(queue) => queue,
            None => self.screen(watch)?,
        };
        let (first, clearly_worse) = (self.screening(), self.parts.criteria.clearly_worse);
        let mut found: Vec<Candidate> = Vec::new();
        let mut best = f64::INFINITY;
        let mut taken = 0;
        while let Some((cost, theta)) = queue.pop() {
            best = best.min(cost);
            let accepted = found.iter().any(|c| c.accepted);
            if accepted && cost > clearly_worse * best || taken >= count && !accepted {
                queue.push((cost, theta));
                break;
            }
            found.extend(self.climb_from(first, &theta, watch)?);
            taken += 1;
            if self.interrupt.is_raised() {
                break;
            }
        }
        self.queue = Some(queue);
        Ok(ranked(found))
    }

    /// Return how far two thetas are apart: radians, and lengths in sizes of the source.
    pub fn apart(&self, a: &[f64], b: &[f64]) -> f64 {
        let layout = self.last().model().layout.manifold();
        let own = layout.ambient();
        let mut step = vec![0.0; layout.tangent()];
        match &self.parts.centred {
            Some(centred) => centred.local(&a[..own], &b[..own], &mut step),
            None => layout.local(&a[..own], &b[..own], &mut step),
        }
        let units = self.units(b);
        step.iter_mut().zip(&units).for_each(|(step, unit)| *step /= unit);
        // Opposite unit vectors have no tangent step between them: their chord tells them apart.
        let chord = a[..own].iter().zip(&b[..own]).map(|(x, y)| (x - y).powi(2)).sum::<f64>().sqrt();
        let directions = self.last().model().layout.blocks().iter().any(|b| matches!(b.kind, BlockKind::Direction(_)));
        cfpose_optim::manifold::norm(&step).max(if directions { 0.5 * chord } else { 0.0 })
    }

    /// Return the unit of every tangent coordinate of the model: 1 (radians), for translations the size of the source where the map
    /// puts it, else the largest entry of the block.
    fn units(&self, theta: &[f64]) -> Vec<f64> {
        let stage = self.last();
        let layout = &stage.model().layout;
        let mut units = Vec::new();
        for block in layout.blocks() {
            let largest = || {
                let range = layout.range(block.name).unwrap_or(0..0);
                theta[range].iter().fold(0.0_f64, |most, value| most.max(value.abs()))
            };
            let unit = match (&block.kind, block.name) {
                (BlockKind::Rotation | BlockKind::Angle | BlockKind::Direction(_), _) => 1.0,
                (_, "translation") => self.size,
                _ => Some(largest()).filter(|unit| *unit > 0.0).unwrap_or(1.0),
            };
            units.extend(std::iter::repeat_n(unit, block.kind.manifold().tangent()));
        }
        units
    }

    /// Return the units of the free tangent coordinates.
    pub fn scales(&self, theta: &[f64]) -> Vec<f64> {
        let units = self.units(theta);
        match self.parts.settings.free.as_deref() {
            Some(free) => free.iter().map(|column| units[*column]).collect(),
            None => units,
        }
    }

    /// Say whether two thetas count as one.
    pub fn is_same(&self, a: &[f64], b: &[f64]) -> bool {
        self.apart(a, b) <= self.parts.criteria.same_theta
    }

    /// Draw a start about another: rotations and directions by `spread` radians, the rest by `spread` times the size of
    /// the source.
    fn perturbed(&self, start: &[f64], spread: f64, rng: &mut ChaCha12Rng) -> Vec<f64> {
        let stage = self.stages.first();
        let manifold = stage.problem.manifold();
        let covariance = stage.sides.source.covariance();
        let size = 2.0 * (covariance[0][0] + covariance[1][1] + covariance[2][2]).sqrt();
        let mut scales = Vec::new();
        for block in stage.model().layout.blocks() {
            let scale = match block.kind {
                BlockKind::Rotation | BlockKind::Angle | BlockKind::Direction(_) => spread,
                _ => spread * size,
            };
            scales.extend(std::iter::repeat_n(scale, block.kind.manifold().tangent()));
        }
        let (own, free) = (stage.own_tangent(), self.parts.settings.free.as_deref());
        let step: Vec<f64> = (0..manifold.tangent())
            .map(|j| {
                let column = free.map_or(j, |free| free.get(j).copied().unwrap_or(j));
                let scale = if j < own { scales.get(column).copied().unwrap_or(0.0) } else { 0.0 };
                scale * rng.sample::<f64, _>(StandardNormal)
            })
            .collect();
        let mut full = start.to_vec();
        full.resize(manifold.ambient(), 0.0);
        let mut moved = full.clone();
        manifold.retract(&full, &step, &mut moved);
        moved.truncate(start.len());
        moved
    }
}

impl Stages {
    /// Return the first stage: the one that starts are proposed for.
    pub fn first(&self) -> &ReadyStage {
        &self.ready[0]
    }
}

impl ReadyStage {
    /// Return the unweighted cost at theta of any stage.
    pub fn cost(&self, theta: &[f64], parts: &Parts) -> f64 {
        let (residual, _) = self.problem.unweighted(&self.adopt(theta, parts), false);
        cfpose_optim::problem::half_squared_norm(&residual)
    }
}

/// Sort: accepted first, then by score.
pub(super) fn ranked(mut found: Vec<Candidate>) -> Vec<Candidate> {
    found.sort_by(|a, b| b.accepted.cmp(&a.accepted).then(a.score.total_cmp(&b.score)));
    found
}
