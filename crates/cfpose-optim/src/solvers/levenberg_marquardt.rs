//! Levenberg-Marquardt on manifolds.

use crate::descent::{Model, Proposal, Search, StepRule, descend};
use crate::entry::{EntryError, ParameterSpec, Parameters};
use crate::linear::Qr;
use crate::outcome::Outcome;
use crate::problem::LeastSquares;
use crate::session::run;
use crate::solver::{Control, Needs, SolveError, Solver, SolverEntry};

/// How the damping follows from the gain ratio.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Damping {
    /// Divide by `decrease` after a gain ratio above 3/4, multiply by `increase` below 1/4 (Marquardt 1963).
    Marquardt,
    /// Multiply by `max(1/3, 1 - (2 gain_ratio - 1)^3)` when accepted, by 2, 4, 8, ... when rejected (Nielsen 1999).
    Nielsen,
}

/// Minimise by steps `d = argmin norm(r + J d)^2 + damping * norm(D d)^2` that are retracted onto the manifold.
///
/// * D is Marquardt's scaling: `D_j` is the largest norm that column j of the Jacobian has had so far (as in MINPACK), 1 for
///   a column of zeros. With it the damping has no unit and the iteration does not depend on the units of theta.
/// * `gain_ratio = (cost - cost(retract(theta, d))) / predicted` with
///   `predicted = 1/2 norm(J d)^2 + damping * norm(D d)^2`, both raised by the rounding of the cost.
///   A trial is accepted when `gain_ratio > accept`.
/// * Stops by the inequalities of [`crate::Stopping`]; a trial with a value that is not finite is a rejected trial.
///
/// Sources: Marquardt, An algorithm for least-squares estimation of nonlinear parameters, SIAM J. 11 (1963);
/// More, The Levenberg-Marquardt algorithm: implementation and theory (1978); Nielsen, Damping parameter in Marquardt's
/// method, IMM-REP-1999-05. *Differs from MINPACK*: the damping is the control number, no radius is solved for.
///
/// ```
/// use cfpose_optim::solvers::LevenbergMarquardt;
/// use cfpose_optim::testproblems::Rosenbrock;
/// use cfpose_optim::{Control, Solver};
/// let outcome = LevenbergMarquardt::default().solve(&Rosenbrock, &[-1.2, 1.0], &mut Control::default()).unwrap();
/// assert!(outcome.usable() && outcome.status.converged());
/// assert!((outcome.theta[0] - 1.0).abs() < 1e-12 && (outcome.theta[1] - 1.0).abs() < 1e-12);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LevenbergMarquardt {
    /// Rule for the damping.
    pub damping: Damping,
    /// Damping of the first trial.
    pub initial_damping: f64,
    /// Longest first step relative to the scaled size of theta; a longer one raises the first damping.
    pub initial_radius: f64,
    /// Factor of an increase (rule `marquardt`).
    pub increase: f64,
    /// Divisor of a decrease (rule `marquardt`).
    pub decrease: f64,
    /// A trial with a gain ratio above this is accepted.
    pub accept: f64,
}

impl Default for LevenbergMarquardt {
    fn default() -> Self {
        Self {
            damping: Damping::Marquardt,
            initial_damping: 1e-2,
            initial_radius: 1.0,
            increase: 4.0,
            decrease: 10.0,
            accept: 1e-4,
        }
    }
}

impl Solver for LevenbergMarquardt {
    fn name(&self) -> &'static str {
        ENTRY.name
    }

    fn needs(&self) -> Needs {
        Needs { jacobian: true, bounds: true, ..Needs::default() }
    }

    fn solve(
        &self,
        problem: &dyn LeastSquares,
        start: &[f64],
        control: &mut Control<'_>,
    ) -> Result<Outcome, SolveError> {
        run(self.name(), self.needs(), problem, start, control, |session, start| {
            let mut search = DampingSearch { options: *self, growth: 2.0, run: 0 };
            descend(session, start, &mut DampedStep::default(), &mut search)
        })
    }
}

/// The damped Gauss-Newton step; the control number is the damping.
#[derive(Debug, Default)]
struct DampedStep {
    qr: Qr,
}

impl StepRule for DampedStep {
    fn prepare(&mut self, model: &Model) {
        self.qr.factorise(model.rows, model.cols, &model.jacobian, &model.residual);
    }

    fn step(&mut self, model: &Model, damping: f64, step: &mut [f64]) -> Option<Proposal> {
        if !self.qr.solve_damped(damping, &model.scaling, step) {
            return None;
        }
        step.iter_mut().for_each(|d| *d = -*d);
        let scaled_norm = model.scaled_norm(step);
        let predicted = 0.5 * self.qr.image_squared(step) + damping * scaled_norm * scaled_norm;
        let full = 2.0 * predicted >= self.qr.attainable(&model.scaling);
        Some(Proposal { predicted, scaled_norm, full })
    }
}

/// Damping by gain ratio.
#[derive(Debug)]
struct DampingSearch {
    options: LevenbergMarquardt,
    growth: f64,
    /// Good trials in a row.
    run: i32,
}

/// Below this the damping does not change a step any more.
const LEAST_DAMPING: f64 = 1e-16;

impl Search for DampingSearch {
    fn begin(&mut self, model: &Model, scaled_start: f64) -> f64 {
        // norm(D d) <= norm(D^-1 g) / damping; the exact length is found by trial, in steps of the increase.
        let mut damping = self.options.initial_damping;
        if scaled_start > 0.0 {
            let (mut rule, mut step) = (DampedStep::default(), vec![0.0; model.cols]);
            rule.prepare(model);
            for _ in 0..60 {
                match rule.step(model, damping, &mut step) {
                    Some(p) if p.scaled_norm > self.options.initial_radius * scaled_start => {
                        damping *= self.options.increase
                    }
                    _ => break,
                }
            }
        }
        damping
    }

    fn judge(&mut self, damping: &mut f64, gain_ratio: f64, _proposal: Option<Proposal>) -> bool {
        let accepted = gain_ratio > self.options.accept;
        match self.options.damping {
            Damping::Marquardt => {
                if gain_ratio > 0.75 {
                    self.run += 1;
                    *damping /= self.options.decrease.powi(self.run);
                } else {
                    self.run = 0;
                    if gain_ratio < 0.25 {
                        *damping *= self.options.increase;
                    }
                }
            }
            Damping::Nielsen if accepted => {
                *damping *= (1.0 - (2.0 * gain_ratio - 1.0).powi(3)).max(1.0 / 3.0);
                self.growth = 2.0;
            }
            Damping::Nielsen => {
                *damping *= self.growth;
                self.growth *= 2.0;
            }
        }
        *damping = damping.max(LEAST_DAMPING);
        accepted
    }
}

/// The line of the solver table.
pub const ENTRY: SolverEntry = SolverEntry {
    name: "levenberg-marquardt",
    summary: "Levenberg-Marquardt with Marquardt scaling on manifolds",
    parameters: &[
        ParameterSpec {
            name: "damping",
            default: "marquardt",
            meaning: "rule that changes the damping: marquardt or nielsen",
        },
        ParameterSpec {
            name: "initial-damping",
            default: "1e-2",
            meaning: "damping of the first trial, relative to the scaled squared column norms, > 0",
        },
        ParameterSpec {
            name: "initial-radius",
            default: "1",
            meaning: "longest first step relative to the scaled size of theta, > 0",
        },
        ParameterSpec {
            name: "increase",
            default: "4",
            meaning: "factor of the damping after a gain ratio below 1/4 (marquardt), > 1",
        },
        ParameterSpec {
            name: "decrease",
            default: "10",
            meaning: "divisor of the damping after a gain ratio above 3/4 (marquardt), > 1",
        },
        ParameterSpec {
            name: "accept",
            default: "1e-4",
            meaning: "least gain ratio of an accepted trial, 0 <= . < 1/4",
        },
    ],
    source: "Marquardt 1963; More 1978; Nielsen 1999",
    build,
};

fn build(parameters: &Parameters) -> Result<Box<dyn Solver>, EntryError> {
    let above = |low: f64| move |v: f64| v.is_finite() && v > low;
    Ok(Box::new(LevenbergMarquardt {
        damping: parameters.choice("damping", &[("marquardt", Damping::Marquardt), ("nielsen", Damping::Nielsen)])?,
        initial_damping: parameters.number("initial-damping", "a number above 0", above(0.0))?,
        initial_radius: parameters.number("initial-radius", "a number above 0", above(0.0))?,
        increase: parameters.number("increase", "a number above 1", above(1.0))?,
        decrease: parameters.number("decrease", "a number above 1", above(1.0))?,
        accept: parameters.number("accept", "a number from 0 to below 0.25", |v| (0.0..0.25).contains(&v))?,
    }))
}
