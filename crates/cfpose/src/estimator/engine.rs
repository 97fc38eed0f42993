//! Running a pipeline: hypotheses climb through the stages, the best one is kept, questioned, and if need be repaired.

use cfpose_optim::manifold::Manifold;
use cfpose_optim::problem::LeastSquares;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use super::level::{Ingredients, Level, Solved};
use super::pipeline::Pipeline;
use super::{Settings, Start, Supervision};
use crate::error::Error;
use crate::geometry::theta::BlockKind;
use crate::model::Scene;
use crate::start::StartContext;

/// Share of common residual variance above which a fit is misplaced.
pub(super) const COHERENT: f64 = 0.35;
/// Share of unexplained source points above which the sets overlap only in part.
pub(super) const PARTIAL: f64 = 0.12;
/// Perturbations of a start, standard deviations of the rotation in radians: twice near, then farther away.
const SPREADS: [f64; 3] = [0.2, 0.2, 0.4];
/// A start whose screened cost exceeds the best one's by this factor is not needed once a better one was accepted.
const CLEARLY_WORSE: f64 = 3.0;
/// Starts closer than this (tangent norm, rotations in radians) are one.
const SAME: f64 = 0.05;

/// What one start led to.
#[derive(Debug, Clone)]
pub(super) struct Hypothesis {
    pub solved: Solved,
    /// In front of the camera, front-facing.
    pub plausible: bool,
    /// Whether the statistics and the distances agree with the fit.
    pub accepted: bool,
    /// Rank: distance between the points, or the cost.
    pub score: f64,
}

/// What a stage did, over all starts.
#[derive(Debug, Clone, PartialEq)]
pub struct StageReport {
    /// Name of the stage.
    pub name: String,
    /// Solves.
    pub solves: usize,
    /// Residual evaluations.
    pub evaluations: usize,
    /// Hypotheses that the gate of the stage gave up.
    pub rejected: usize,
}

/// A pipeline at work.
pub(super) struct Engine<'a> {
    pub ingredients: Ingredients<'a>,
    pub pipeline: &'a Pipeline,
    pub levels: Vec<Level>,
    pub reports: Vec<StageReport>,
    pub iterations: usize,
    pub starts: usize,
    /// Screened global starts with their costs, best last; `None` before the screening.
    queue: Option<Vec<(f64, Vec<f64>)>>,
}

impl<'a> Engine<'a> {
    /// Build all stages.
    pub fn new(ingredients: Ingredients<'a>, pipeline: &'a Pipeline) -> Result<Self, Error> {
        let levels =
            pipeline.stages.iter().map(|stage| Level::new(&ingredients, stage)).collect::<Result<Vec<_>, _>>()?;
        let report =
            |level: &Level| StageReport { name: level.stage.name.clone(), solves: 0, evaluations: 0, rejected: 0 };
        let reports = levels.iter().map(report).collect();
        Ok(Self { ingredients, pipeline, levels, reports, iterations: 0, starts: 0, queue: None })
    }

    fn settings(&self) -> &'a Settings {
        self.ingredients.settings
    }

    /// Add the work of an engine that ran the stages from `first` on, on a part of the points.
    pub fn absorb(&mut self, first: usize, other: &Engine<'_>) {
        self.iterations += other.iterations;
        for (report, part) in self.reports[first..].iter_mut().zip(&other.reports) {
            report.solves += part.solves;
            report.evaluations += part.evaluations;
            report.rejected += part.rejected;
        }
    }

    /// Return the last stage.
    pub fn last(&self) -> &Level {
        &self.levels[self.levels.len() - 1]
    }

    pub fn is_plausible(&self, theta: &[f64]) -> bool {
        let level = self.last();
        let own = &theta[..level.model.layout.manifold().ambient()];
        let scene = Scene { theta: own, source: &level.source, target: &level.target };
        !(level.model.examine)(&scene).implausible
    }

    /// Solve one stage and count.
    fn solve(&mut self, index: usize, theta: &[f64], supervision: &mut Supervision<'_>) -> Result<Solved, Error> {
        let settings = self.ingredients.settings;
        let solved = self.levels[index].solve(theta, settings, supervision)?;
        self.reports[index].solves += 1;
        self.reports[index].evaluations += solved.evaluations;
        self.iterations += solved.iterations;
        Ok(solved)
    }

    /// Lead one theta through the stages from `first` on; `None` where a gate or a solver gave it up.
    pub fn climb(
        &mut self,
        first: usize,
        theta: &[f64],
        supervision: &mut Supervision<'_>,
    ) -> Result<Option<Hypothesis>, Error> {
        let mut theta = theta.to_vec();
        let mut last = None;
        for index in first..self.levels.len() {
            let solved = self.solve(index, &theta, supervision)?;
            let passes =
                solved.outcome.usable() && (!self.levels[index].stage.gate || self.is_plausible(&solved.theta));
            if !passes && index + 1 < self.levels.len() {
                self.reports[index].rejected += 1;
                return Ok(None);
            }
            theta.clone_from(&solved.theta);
            last = Some(solved);
        }
        last.map(|solved| self.weigh(solved)).transpose()
    }

    /// Judge a solution of the last stage.
    pub fn weigh(&self, mut solved: Solved) -> Result<Hypothesis, Error> {
        let plausible = self.is_plausible(&solved.theta);
        let usable = solved.outcome.usable();
        if self.pipeline.support && usable {
            solved.support = Some(self.last().support(&solved.theta)?);
        }
        let agrees = solved.statistics.as_ref().is_some_and(|s| s.reduced() < self.pipeline.accept);
        let coherent = solved.support.is_some_and(|s| s.coherence > COHERENT);
        let score = match (&solved.support, self.pipeline.support) {
            (Some(support), true) => support.distance(),
            _ => solved.outcome.cost,
        };
        let penalty = if plausible && usable { 0.0 } else { 1e6 };
        let accepted = usable && plausible && agrees && !coherent;
        Ok(Hypothesis {
            solved,
            plausible,
            accepted,
            score: if score.is_finite() { score + penalty } else { f64::MAX },
        })
    }

    /// Return the thetas to begin with: given ones, or those of a named strategy; none where the pipeline searches by itself.
    pub fn given(&self) -> Result<Vec<Vec<f64>>, Error> {
        match &self.settings().start {
            Start::Given(thetas) => Ok(thetas.clone()),
            Start::Named(name) if name == "auto" => Ok(Vec::new()),
            Start::Named(name) => self.proposals(name),
        }
    }

    /// Climb from each of the given starts.
    pub fn climb_given(
        &mut self,
        given: &[Vec<f64>],
        supervision: &mut Supervision<'_>,
    ) -> Result<Vec<Hypothesis>, Error> {
        let mut found = Vec::new();
        for start in given {
            self.starts += 1;
            found.extend(self.climb(0, start, supervision)?);
        }
        Ok(ranked(found))
    }

    /// Climb from perturbed copies of a start, the restarts `range`, until one is accepted.
    pub fn restarts(
        &mut self,
        start: &[f64],
        range: std::ops::Range<usize>,
        supervision: &mut Supervision<'_>,
    ) -> Result<Vec<Hypothesis>, Error> {
        let mut found = Vec::new();
        for trial in range.start..range.end.min(self.pipeline.restarts) {
            let seed = self.settings().seed ^ 0x7065_7274_7572_6265;
            let mut rng = ChaCha8Rng::seed_from_u64(seed.wrapping_add(trial as u64));
            let moved = self.perturbed(start, SPREADS[trial % SPREADS.len()], &mut rng);
            self.starts += 1;
            let hypothesis = self.climb(0, &moved, supervision)?;
            let accepted = hypothesis.as_ref().is_some_and(|h| h.accepted);
            found.extend(hypothesis);
            if accepted {
                break;
            }
        }
        Ok(ranked(found))
    }

    /// Propose starts by name.
    fn proposals(&self, name: &str) -> Result<Vec<Vec<f64>>, Error> {
        let level = &self.levels[0];
        let cost = |theta: &[f64]| level.cost(theta);
        let context = StartContext {
            model: &level.model,
            source: &level.source,
            target: &level.mapped_target,
            cost: &cost,
            seed: self.settings().seed,
        };
        self.ingredients.registry.start(name)?.starts(&context)
    }

    /// Lead the starts of the global strategy through the first stages and queue the best different ones, best last.
    fn screen(&mut self, supervision: &mut Supervision<'_>) -> Result<(), Error> {
        let name = self.pipeline.global_start.clone().unwrap_or_else(|| "identity".to_string());
        let mut proposals = self.proposals(&name)?;
        let (screening, keep) = (self.pipeline.screening_stages.min(self.levels.len() - 1), self.pipeline.keep);
        if keep == 0 || screening == 0 {
            self.starts += proposals.len();
            self.queue = Some(proposals.into_iter().rev().map(|theta| (0.0, theta)).collect());
            return Ok(());
        }
        // Before any solve: the cheapest cost of the first stage, the best of a large set.
        if proposals.len() > 4 * keep {
            let mut costs: Vec<(f64, Vec<f64>)> =
                proposals.into_iter().map(|theta| (self.levels[0].cost(&theta), theta)).collect();
            costs.sort_by(|a, b| a.0.total_cmp(&b.0));
            proposals = costs.into_iter().take(4 * keep).map(|(_, theta)| theta).collect();
        }
        let mut screened: Vec<(f64, Vec<f64>)> = Vec::new();
        for start in &proposals {
            self.starts += 1;
            let (mut theta, mut cost) = (start.clone(), f64::INFINITY);
            for index in 0..screening {
                let solved = self.solve(index, &theta, supervision)?;
                cost = if solved.outcome.usable() { solved.outcome.cost } else { f64::INFINITY };
                theta.clone_from(&solved.theta);
            }
            screened.push((cost, theta));
        }
        screened.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut kept: Vec<(f64, Vec<f64>)> = Vec::new();
        for (cost, theta) in screened {
            let plausible = cost.is_finite() && self.is_plausible(&theta);
            if plausible && kept.len() < keep && kept.iter().all(|(_, other)| self.distance(other, &theta) > SAME) {
                kept.push((cost, theta));
            }
        }
        kept.reverse();
        self.queue = Some(kept);
        Ok(())
    }

    /// Lead the next `count` queued starts through the remaining stages.
    ///
    /// An accepted pose ends the search, unless the next start was about as good so far: both are then reported.
    pub fn global(&mut self, count: usize, supervision: &mut Supervision<'_>) -> Result<Vec<Hypothesis>, Error> {
        if self.queue.is_none() {
            self.screen(supervision)?;
        }
        let screened = self.pipeline.keep > 0 && self.pipeline.screening_stages > 0 && self.levels.len() > 1;
        let first = if screened { self.pipeline.screening_stages.min(self.levels.len() - 1) } else { 0 };
        let mut found: Vec<Hypothesis> = Vec::new();
        let mut best = f64::INFINITY;
        for taken in 0.. {
            let Some((cost, theta)) = self.queue.as_mut().and_then(Vec::pop) else { break };
            best = best.min(cost);
            let done = found.iter().any(|h| h.accepted) && cost > CLEARLY_WORSE * best;
            if done || taken >= count && !found.iter().any(|h| h.accepted) {
                self.queue.get_or_insert_default().push((cost, theta));
                break;
            }
            found.extend(self.climb(first, &theta, supervision)?);
        }
        Ok(ranked(found))
    }

    /// Return the tangent norm between two thetas of the first stage's length or longer.
    pub fn distance(&self, a: &[f64], b: &[f64]) -> f64 {
        let manifold = self.last().model.layout.manifold();
        let own = manifold.ambient();
        let mut step = vec![0.0; manifold.tangent()];
        manifold.local(&a[..own], &b[..own], &mut step);
        cfpose_optim::manifold::norm(&step)
    }

    /// Draw a start about another: rotations and directions by `spread` radians, the rest by `spread` times the size of
    /// the source.
    fn perturbed(&self, start: &[f64], spread: f64, rng: &mut ChaCha8Rng) -> Vec<f64> {
        let level = &self.levels[0];
        let manifold = level.problem.manifold();
        let covariance = level.source.covariance();
        let size = 2.0 * (covariance[0][0] + covariance[1][1] + covariance[2][2]).sqrt();
        let mut scales = Vec::new();
        for block in level.model.layout.blocks() {
            let scale = match block.kind {
                BlockKind::Rotation | BlockKind::Angle | BlockKind::Direction(_) => spread,
                _ => spread * size,
            };
            scales.extend(std::iter::repeat_n(scale, block.kind.manifold().tangent()));
        }
        let own = level.own_tangent();
        let free = self.settings().free.as_deref();
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

/// Sort: accepted first, then by score.
pub(super) fn ranked(mut found: Vec<Hypothesis>) -> Vec<Hypothesis> {
    found.sort_by(|a, b| b.accepted.cmp(&a.accepted).then(a.score.total_cmp(&b.score)));
    found
}
