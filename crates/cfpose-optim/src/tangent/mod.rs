//! The frame in which back-ends of other crates run: flat coordinates around a base point, evaluations through the session,
//! rounds that start again from the best point, and our own stopping tests.
//!
//! A back-end minimises over `x = S d`, where `retract(base, d)` is the point and S a diagonal scaling. When it ends, fails
//! or stops making progress, the frame moves its base to the best point and asks for another round; a round that gains
//! nothing decides. So no back-end can lose the best point or call a limit a convergence.

use std::cell::RefCell;

use crate::descent::{Model, not_finite_start};
use crate::manifold::{Manifold, norm};
use crate::outcome::Status;
use crate::session::{End, Progress, Session};
use crate::solver::Stopping;

mod guard;

pub use guard::guarded;

/// Cosine of the gradient test below which a round without gain counts as convergence: the cost is flat to rounding there.
const FLAT_COSINE: f64 = 1e-6;

/// An evaluated point in flat coordinates.
struct Sample {
    x: Vec<f64>,
    cost: f64,
    gradient: Option<Vec<f64>>,
}

/// Flat coordinates around a base point.
pub struct Frame<'f, 's, 'a> {
    inner: RefCell<Inner<'f, 's, 'a>>,
    /// Tangent dimension.
    pub size: usize,
    manifold: &'s dyn Manifold,
}

struct Inner<'f, 's, 'a> {
    session: &'f mut Session<'s, 'a>,
    base: Vec<f64>,
    scaling: Vec<f64>,
    /// Residual and, where there is one, Jacobian at `model_theta`.
    model: Model,
    model_theta: Vec<f64>,
    recent: Vec<Sample>,
    end: Option<End>,
    /// Calls left before an inner loop of a back-end counts as stuck.
    patience: usize,
}

/// Calls that one iteration of a back-end may make; populations make one or two a particle.
const PATIENCE: usize = 20_100;

impl<'f, 's, 'a> Frame<'f, 's, 'a> {
    /// Put the frame at the start and evaluate it, with a Jacobian if asked for.
    pub fn new(session: &'f mut Session<'s, 'a>, start: &[f64], with_jacobian: bool) -> Result<Self, End> {
        let problem = session.problem();
        let (rows, size) = (problem.num_residuals(), problem.manifold().tangent());
        let mut model = Model::new(rows, size);
        let cost = if with_jacobian {
            session.evaluate_jacobian(start, &mut model.residual, &mut model.jacobian)?
        } else {
            session.evaluate(start, &mut model.residual)?
        };
        if !cost.is_finite() {
            return Err(not_finite_start(&model));
        }
        model.update();
        let inner = Inner {
            session,
            base: start.to_vec(),
            scaling: vec![1.0; size],
            model,
            model_theta: if with_jacobian { start.to_vec() } else { Vec::new() },
            recent: Vec::new(),
            end: None,
            patience: PATIENCE,
        };
        Ok(Self { inner: RefCell::new(inner), size, manifold: problem.manifold() })
    }

    /// Use the column norms of the Jacobian at the base as scaling, so that the Hessian is near the identity on its diagonal;
    /// times a caution, which shortens the first step of a line search by its square.
    fn scale_by_columns(&self, caution: f64) {
        let mut inner = self.inner.borrow_mut();
        inner.scaling = inner.model.scaling.iter().map(|s| s * caution).collect();
        inner.recent.clear();
    }

    /// Return the cost at the base.
    pub fn base_cost(&self) -> f64 {
        self.inner.borrow().model.cost
    }

    /// Return the size of theta along each flat coordinate, 1 where it is 0.
    pub fn extent(&self) -> Vec<f64> {
        let inner = self.inner.borrow();
        let mut extent = vec![0.0; self.size];
        self.manifold.extent(&inner.base, &mut extent);
        let scaled = extent.iter().zip(&inner.scaling).map(|(e, s)| if *e > 0.0 { e * s } else { *s });
        scaled.collect()
    }

    /// Return the stopping rules.
    pub fn stopping(&self) -> Stopping {
        self.inner.borrow().session.stopping().clone()
    }

    /// Return the coordinates that a back-end with a sense of absolute size may give to the base: theta on a vector space,
    /// else 0.
    pub fn origin(&self) -> Vec<f64> {
        let inner = self.inner.borrow();
        if self.is_flat_space() { weighted(&inner.base, &inner.scaling) } else { vec![0.0; self.size] }
    }

    /// Return residual and Jacobian with respect to the flat coordinates; counts an iteration when the point is new.
    pub fn residual_and_jacobian(&self, x: &[f64]) -> Option<(Vec<f64>, Vec<f64>)> {
        let mut inner = self.inner.borrow_mut();
        let theta = inner.point_unchecked(self.manifold, x);
        if inner.model_theta != theta {
            inner.patience = PATIENCE;
            let result = inner.session.next_iteration();
            inner.keep_end(result)?;
            let (cost, gradient) = inner.evaluate_gradient(self.manifold, x)?;
            inner.remember(Sample { x: x.to_vec(), cost, gradient: Some(gradient) });
            drop(inner);
            self.record(x, cost, f64::NAN, f64::NAN);
            inner = self.inner.borrow_mut();
        }
        let finite = inner.model.residual.iter().chain(&inner.model.jacobian).all(|v| v.is_finite());
        finite.then(|| (inner.model.residual.clone(), inner.turned_jacobian(self.manifold, x)))
    }

    /// Return the seed of the solve.
    pub fn seed(&self) -> u64 {
        self.inner.borrow().session.seed()
    }

    /// Return the cost at flat coordinates, infinite where it is not finite; `None` after the end of the solve.
    pub fn cost(&self, x: &[f64]) -> Option<f64> {
        let mut inner = self.inner.borrow_mut();
        inner.use_patience()?;
        if let Some(sample) = inner.recent.iter().find(|s| s.x == x) {
            return Some(sample.cost);
        }
        let theta = inner.point(self.manifold, x)?;
        let mut residual = std::mem::take(&mut inner.model.residual);
        let result = inner.session.evaluate(&theta, &mut residual);
        inner.model.residual = residual;
        let cost = inner.keep_end(result)?;
        inner.remember(Sample { x: x.to_vec(), cost, gradient: None });
        Some(cost)
    }

    /// Return cost and gradient at flat coordinates; `None` after the end of the solve or where they are not finite.
    pub fn cost_and_gradient(&self, x: &[f64]) -> Option<(f64, Vec<f64>)> {
        let mut inner = self.inner.borrow_mut();
        inner.use_patience()?;
        let known = inner.recent.iter().find(|s| s.x == x);
        if let Some((cost, Some(gradient))) = known.map(|s| (s.cost, &s.gradient)) {
            return cost.is_finite().then(|| (cost, gradient.clone()));
        }
        let (cost, gradient) = inner.evaluate_gradient(self.manifold, x)?;
        inner.remember(Sample { x: x.to_vec(), cost, gradient: Some(gradient.clone()) });
        cost.is_finite().then_some((cost, gradient))
    }

    /// Return the Gauss-Newton Hessian at flat coordinates, for the point evaluated last or evaluated again.
    pub fn normal_matrix(&self, x: &[f64]) -> Option<Vec<Vec<f64>>> {
        let mut inner = self.inner.borrow_mut();
        if inner.recent.last().is_none_or(|s| s.x != x || s.gradient.is_none()) {
            let (cost, gradient) = inner.evaluate_gradient(self.manifold, x)?;
            inner.remember(Sample { x: x.to_vec(), cost, gradient: Some(gradient) });
        }
        let m = self.size;
        let turned = inner.turned_jacobian(self.manifold, x);
        let mut hessian = vec![vec![0.0; m]; m];
        for row in turned.chunks_exact(m.max(1)) {
            for a in 0..m {
                for b in 0..m {
                    hessian[a][b] += row[a] * row[b];
                }
            }
        }
        hessian.iter().flatten().all(|v| v.is_finite()).then_some(hessian)
    }

    /// Count an iteration of a back-end; `None` when a limit is reached.
    pub fn next_iteration(&self) -> Option<()> {
        let mut inner = self.inner.borrow_mut();
        inner.patience = PATIENCE;
        let result = inner.session.next_iteration();
        inner.keep_end(result)
    }

    /// Report an iteration that stands at flat coordinates `x`.
    pub fn record(&self, x: &[f64], cost: f64, step_norm: f64, damping: f64) {
        let mut inner = self.inner.borrow_mut();
        let gradient = inner.recent.iter().find(|s| s.x == x).and_then(|s| s.gradient.as_ref());
        let gradient_norm =
            gradient.map_or(f64::NAN, |g| norm(&g.iter().zip(&inner.scaling).map(|(g, s)| g * s).collect::<Vec<_>>()));
        let theta = inner.point_unchecked(self.manifold, x);
        let progress = Progress { cost, gradient_norm, step_norm, damping, accepted: true };
        inner.session.record(&theta, progress);
    }

    /// Say whether the zero-cost test holds at the best point.
    fn zero(inner: &Inner<'_, '_, '_>) -> Option<End> {
        let (_, cost) = inner.session.best();
        let limit = inner.session.stopping().zero_cost?;
        (cost <= limit).then(|| End::new(Status::ZeroResidual, format!("cost {cost:.3e} is zero to rounding")))
    }

    /// Take the end of the solve, if there is one: a limit, or a vanished residual.
    pub fn ended(&self) -> Option<End> {
        let mut inner = self.inner.borrow_mut();
        let zero = Self::zero(&inner);
        zero.or_else(|| inner.end.take())
    }

    /// Say whether the cosine test holds at the best point, if that is the one evaluated last.
    pub fn flat(&self) -> Option<End> {
        let inner = self.inner.borrow();
        if inner.model_theta != inner.session.best().0 {
            return None;
        }
        let limit = inner.session.stopping().gradient_tolerance?;
        let cosine = inner.model.cosine(|_| true);
        (cosine <= limit).then(|| {
            End::new(Status::GradientTolerance, format!("cosine between residual and Jacobian is at most {cosine:.3e}"))
        })
    }

    /// Move the base to the best point; return how far that was, relative to the size of theta (scaled norms).
    pub fn recentre(&self, with_jacobian: bool) -> Result<f64, End> {
        let mut inner = self.inner.borrow_mut();
        let inner = &mut *inner;
        let best = inner.session.best().0.to_vec();
        let (mut step, mut extent) = (vec![0.0; self.size], vec![0.0; self.size]);
        self.manifold.local(&inner.base, &best, &mut step);
        self.manifold.extent(&best, &mut extent);
        let moved = norm(&weighted(&step, &inner.scaling));
        let size = norm(&weighted(&extent, &inner.scaling));
        if with_jacobian && inner.model_theta != best {
            let cost = inner.session.evaluate_jacobian(&best, &mut inner.model.residual, &mut inner.model.jacobian)?;
            if !cost.is_finite() {
                return Err(End::new(Status::NumericalFailure, "the Jacobian at the best point is not finite"));
            }
            inner.model_theta.clone_from(&best);
        }
        if with_jacobian {
            inner.model.update();
        }
        inner.model.cost = inner.session.best().1;
        inner.base = best;
        inner.recent.clear();
        inner.end = None;
        Ok(if moved == 0.0 { 0.0 } else { moved / size.max(f64::MIN_POSITIVE) })
    }

    /// Return cost and gradient at the base from the model in hand, without an evaluation.
    pub fn base_gradient(&self) -> Vec<f64> {
        let inner = self.inner.borrow();
        inner.model.gradient.iter().zip(&inner.scaling).map(|(g, s)| g / s).collect()
    }

    /// Let the base count as evaluated, so that a back-end that starts there costs nothing.
    pub fn seed_base(&self, with_gradient: bool) {
        let gradient = with_gradient.then(|| self.base_gradient());
        let mut inner = self.inner.borrow_mut();
        let cost = inner.model.cost;
        let x = vec![0.0; self.size];
        inner.remember(Sample { x, cost, gradient });
    }

    /// Return the number of residuals.
    pub fn num_residuals(&self) -> usize {
        self.inner.borrow().model.rows
    }

    /// Return the least cost seen.
    pub fn best_cost(&self) -> f64 {
        self.inner.borrow().session.best().1
    }

    /// Say whether the manifold is a vector space, where a base need not be moved.
    pub fn is_flat_space(&self) -> bool {
        self.manifold.ambient() == self.size
    }

    /// Return the bounds of the problem in flat coordinates; `None` where it has none, and where theta is no vector.
    pub fn bounds(&self) -> Option<(Vec<f64>, Vec<f64>)> {
        let inner = self.inner.borrow();
        let bounds = inner.session.problem().bounds().filter(|_| self.is_flat_space())?;
        let placed = |values: &[f64]| -> Vec<f64> {
            values.iter().zip(&inner.base).zip(&inner.scaling).map(|((v, b), s)| (v - b) * s).collect()
        };
        Some((placed(&bounds.lower), placed(&bounds.upper)))
    }

    /// Say whether the solve is over.
    pub fn is_over(&self) -> bool {
        let inner = self.inner.borrow();
        inner.end.is_some() || Self::zero(&inner).is_some()
    }

    /// Decide after a round that brought `gain` (relative decrease of the cost) by a move of relative length `moved`.
    pub fn decide(&self, gain: f64, moved: f64, with_jacobian: bool) -> Option<End> {
        if with_jacobian && let Some(end) = self.flat() {
            return Some(end);
        }
        let inner = self.inner.borrow();
        let stopping = inner.session.stopping();
        let cosine = inner.model.cosine(|_| true);
        let near = !with_jacobian || cosine <= FLAT_COSINE;
        if near && stopping.cost_tolerance.is_some_and(|limit| gain <= limit) {
            let message = format!("a restarted round lowers the cost by {gain:.3e} relative");
            return Some(End::new(Status::CostTolerance, message));
        }
        if near && stopping.step_tolerance.is_some_and(|limit| moved <= limit) {
            return Some(End::new(Status::StepTolerance, format!("a restarted round moves by {moved:.3e} relative")));
        }
        (gain <= 0.0).then(|| {
            let detail = if with_jacobian { format!(" (cosine {cosine:.1e})") } else { String::new() };
            End::new(Status::Stalled, format!("a restarted round brings no decrease and no test holds{detail}"))
        })
    }
}

/// Caution beyond which a stall is final: first steps are then shorter than rounding.
const MOST_CAUTION: f64 = 1e6;

/// What a round of a back-end says about itself.
#[derive(Debug, Clone, PartialEq)]
pub enum Round {
    /// Its gain decides about convergence.
    Decisive,
    /// It searched too widely for that; go on with a narrower one.
    Wide,
    /// The back-end's own test, which is one of ours, held.
    Over(End),
}

/// Run rounds of a back-end until one decides or a limit is reached.
pub fn rounds(
    session: &mut Session<'_, '_>,
    start: &[f64],
    with_jacobian: bool,
    mut round: impl FnMut(&Frame<'_, '_, '_>, usize) -> Round,
) -> Result<End, End> {
    let frame = Frame::new(session, start, with_jacobian)?;
    frame.seed_base(with_jacobian);
    frame.record(&vec![0.0; frame.size], frame.base_cost(), f64::NAN, f64::NAN);
    if let Some(end) = frame.ended().or_else(|| frame.flat()) {
        return Ok(end);
    }
    if frame.size == 0 {
        return Ok(End::new(Status::Stalled, "there is no parameter to vary"));
    }
    let mut caution = 1.0;
    for index in 0.. {
        let before = frame.base_cost();
        if with_jacobian {
            frame.scale_by_columns(caution);
        }
        frame.seed_base(with_jacobian);
        let verdict = round(&frame, index);
        if let Some(end) = frame.ended() {
            return Ok(end);
        }
        let moved = frame.recentre(with_jacobian)?;
        let gain = (before - frame.base_cost()) / before;
        if let Round::Over(end) = verdict {
            return Ok(end);
        }
        if verdict == Round::Decisive
            && let Some(end) = frame.decide(gain, moved, with_jacobian)
        {
            // A line search that failed at its first, long step deserves a shorter one.
            if end.status != Status::Stalled || caution >= MOST_CAUTION || !with_jacobian {
                return Ok(end);
            }
            caution *= 10.0;
        } else {
            caution = 1.0;
        }
        // A round that could not even begin must not spin.
        if frame.next_iteration().is_none() {
            return Ok(frame.ended().unwrap_or_else(|| End::new(Status::Stalled, "no further round is possible")));
        }
    }
    Ok(End::new(Status::Stalled, "rounds ran out"))
}

fn weighted(v: &[f64], weights: &[f64]) -> Vec<f64> {
    v.iter().zip(weights).map(|(a, w)| a * w).collect()
}

impl Inner<'_, '_, '_> {
    fn point_unchecked(&self, manifold: &dyn Manifold, x: &[f64]) -> Vec<f64> {
        let step: Vec<f64> = x.iter().zip(&self.scaling).map(|(x, s)| x / s).collect();
        let mut theta = self.base.clone();
        manifold.retract(&self.base, &step, &mut theta);
        theta
    }

    /// Return the point at flat coordinates; `None` after the end, or when they left the numbers.
    fn point(&mut self, manifold: &dyn Manifold, x: &[f64]) -> Option<Vec<f64>> {
        let usable = self.end.is_none() && x.iter().all(|v| v.is_finite());
        usable.then(|| self.point_unchecked(manifold, x))
    }

    /// Count a call, also one that is answered from memory; `None` when an inner loop of a back-end is stuck.
    fn use_patience(&mut self) -> Option<()> {
        self.patience = self.patience.checked_sub(1)?;
        Some(())
    }

    fn keep_end<T>(&mut self, result: Result<T, End>) -> Option<T> {
        match result {
            Ok(value) => Some(value),
            Err(end) => {
                self.end = Some(end);
                None
            }
        }
    }

    fn remember(&mut self, sample: Sample) {
        self.recent.retain(|s| s.x != sample.x);
        if self.recent.len() >= 4 {
            self.recent.remove(0);
        }
        self.recent.push(sample);
    }

    fn evaluate_gradient(&mut self, manifold: &dyn Manifold, x: &[f64]) -> Option<(f64, Vec<f64>)> {
        let theta = self.point(manifold, x)?;
        let (mut residual, mut jacobian) =
            (std::mem::take(&mut self.model.residual), std::mem::take(&mut self.model.jacobian));
        let result = self.session.evaluate_jacobian(&theta, &mut residual, &mut jacobian);
        (self.model.residual, self.model.jacobian) = (residual, jacobian);
        self.model_theta = theta;
        let cost = self.keep_end(result)?;
        self.model.update_gradient();
        let m = x.len();
        let turn = self.turn(manifold, x);
        // d cost / d x_b = sum_a g_a * turn_ab / s_b.
        let entry = |b: usize| (0..m).map(|a| self.model.gradient[a] * turn[a * m + b]).sum::<f64>() / self.scaling[b];
        Some((cost, (0..m).map(entry).collect()))
    }

    /// Return the derivative of the retraction at the step that belongs to `x`.
    fn turn(&self, manifold: &dyn Manifold, x: &[f64]) -> Vec<f64> {
        let m = x.len();
        let step: Vec<f64> = x.iter().zip(&self.scaling).map(|(x, s)| x / s).collect();
        let mut turn = vec![0.0; m * m];
        manifold.differential(&self.base, &step, &mut turn);
        turn
    }

    /// Return the Jacobian of the model with respect to `x`.
    fn turned_jacobian(&self, manifold: &dyn Manifold, x: &[f64]) -> Vec<f64> {
        let m = x.len();
        let turn = self.turn(manifold, x);
        let mut turned = vec![0.0; self.model.jacobian.len()];
        for (row, out) in self.model.jacobian.chunks_exact(m.max(1)).zip(turned.chunks_exact_mut(m.max(1))) {
            for b in 0..m {
                out[b] = (0..m).map(|a| row[a] * turn[a * m + b]).sum::<f64>() / self.scaling[b];
            }
        }
        turned
    }
}
