//! A solver: Levenberg-Marquardt whose damping falls slowly and rises fast. See docs/adding/solver.md.
//!
//! Source: Transtrum and Sethna, Improvements to the Levenberg-Marquardt algorithm (arXiv 1201.5885), "delayed gratification".

use cfpose_optim::descent::Model;
use cfpose_optim::entry::ParameterSpec;
use cfpose_optim::session::run;
use cfpose_optim::{
    Control, LeastSquares, Needs, Outcome, Proposal, Qr, Search, SolveError, Solver, SolverEntry, StepRule, descend,
};

/// The options.
#[derive(Clone, Copy)]
struct DelayedGratification {
    raise: f64,
    lower: f64,
}

impl Solver for DelayedGratification {
    fn name(&self) -> &'static str {
        ENTRY.name
    }

    fn needs(&self) -> Needs {
        Needs { jacobian: true, bounds: true, ..Needs::default() }
    }

    // The usual loop with a step rule and a search of our own: stopping tests, bounds and rounding come with the loop.
    fn solve(
        &self,
        problem: &dyn LeastSquares,
        start: &[f64],
        control: &mut Control<'_>,
    ) -> Result<Outcome, SolveError> {
        run(self.name(), self.needs(), problem, start, control, |session, start| {
            descend(session, start, &mut Damped::default(), &mut self.clone())
        })
    }
}

/// d = argmin norm(r + J d)^2 + damping norm(D d)^2.
#[derive(Default)]
struct Damped {
    qr: Qr,
}

impl StepRule for Damped {
    fn prepare(&mut self, model: &Model) {
        self.qr.factorise(model.rows, model.cols, &model.jacobian, &model.residual);
    }

    fn step(&mut self, model: &Model, damping: f64, step: &mut [f64]) -> Option<Proposal> {
        if !self.qr.solve_damped(damping, &model.scaling, step) {
            return None;
        }
        step.iter_mut().for_each(|d| *d = -*d);
        let scaled_norm = model.scaled_norm(step);
        // What the model promises: 1/2 norm(J d)^2 + damping norm(D d)^2.
        let predicted = 0.5 * self.qr.image_squared(step) + damping * scaled_norm * scaled_norm;
        // Only a step that is hardly damped says by its smallness that the minimum is near.
        let full = 2.0 * predicted >= self.qr.attainable(&model.scaling);
        Some(Proposal { predicted, scaled_norm, full })
    }
}

impl Search for DelayedGratification {
    fn begin(&mut self, _model: &Model, _scaled_start: f64) -> f64 {
        0.01
    }

    fn judge(&mut self, damping: &mut f64, gain_ratio: f64, _proposal: Option<Proposal>) -> bool {
        let accepted = gain_ratio > 1e-4;
        *damping = if accepted { (*damping / self.lower).max(1e-16) } else { *damping * self.raise };
        accepted
    }
}

/// The table line.
pub static ENTRY: SolverEntry = SolverEntry {
    name: "delayed-gratification",
    summary: "Levenberg-Marquardt with delayed gratification",
    parameters: &[
        ParameterSpec { name: "raise", default: "2", meaning: "factor of the damping after a rejected trial, > 1" },
        ParameterSpec { name: "lower", default: "10", meaning: "divisor of the damping after an accepted trial, > 1" },
    ],
    source: "Transtrum and Sethna 2012",
    build: |parameters| {
        let above_one = |key| parameters.number(key, "a number above 1", |v| v.is_finite() && v > 1.0);
        Ok(Box::new(DelayedGratification { raise: above_one("raise")?, lower: above_one("lower")? }))
    },
};
