//! The result of a solve: best point, status, counts, trace.

use serde::Serialize;

/// Why a solve ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Status {
    /// The gradient test held.
    GradientTolerance,
    /// The cost test held.
    CostTolerance,
    /// The step test held.
    StepTolerance,
    /// The residual vanished.
    ZeroResidual,
    /// The limit on iterations was reached.
    MaxIterations,
    /// The limit on evaluations was reached.
    MaxEvaluations,
    /// The deadline passed.
    Deadline,
    /// The cancel flag was raised.
    Cancelled,
    /// No further decrease was possible although no test held.
    Stalled,
    /// A value that must be finite was not.
    NumericalFailure,
    /// The solver cannot treat this problem; the message says why.
    Unsupported,
}

impl Status {
    /// Return the name used in JSON and tables.
    ///
    /// ```
    /// assert_eq!(cfpose_optim::Status::GradientTolerance.name(), "gradient-tolerance");
    /// ```
    pub fn name(self) -> &'static str {
        match self {
            Status::GradientTolerance => "gradient-tolerance",
            Status::CostTolerance => "cost-tolerance",
            Status::StepTolerance => "step-tolerance",
            Status::ZeroResidual => "zero-residual",
            Status::MaxIterations => "max-iterations",
            Status::MaxEvaluations => "max-evaluations",
            Status::Deadline => "deadline",
            Status::Cancelled => "cancelled",
            Status::Stalled => "stalled",
            Status::NumericalFailure => "numerical-failure",
            Status::Unsupported => "unsupported",
        }
    }

    /// Say whether a convergence test held.
    pub fn converged(self) -> bool {
        matches!(self, Status::GradientTolerance | Status::CostTolerance | Status::StepTolerance | Status::ZeroResidual)
    }

    /// Say whether a deadline or a cancel flag ended the solve.
    pub fn is_interruption(self) -> bool {
        matches!(self, Status::Deadline | Status::Cancelled)
    }

    /// Say whether the best point may be used: everything but a failure; a limit with a finite best point is usable.
    pub fn usable(self) -> bool {
        !matches!(self, Status::NumericalFailure | Status::Unsupported)
    }
}

/// Numbers of evaluations.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct Counts {
    /// Outer iterations.
    pub iterations: usize,
    /// Residual evaluations, those with a Jacobian included.
    pub residuals: usize,
    /// Evaluations that computed a Jacobian.
    pub jacobians: usize,
    /// Evaluations of the curvature term.
    pub curvatures: usize,
}

/// One accepted or rejected iteration.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TraceRow {
    /// Iteration, from 0 (the start).
    pub iteration: usize,
    /// Residual evaluations so far.
    pub evaluations: usize,
    /// Cost at the current point.
    pub cost: f64,
    /// Norm of the gradient J'r, NaN where the solver has none.
    pub gradient_norm: f64,
    /// Norm of the last step, NaN at the start.
    pub step_norm: f64,
    /// Damping or trust-region radius, NaN where the solver has none.
    pub damping: f64,
    /// Whether the step was accepted.
    pub accepted: bool,
}

/// What a solve returns, whatever happened.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Outcome {
    /// Best point seen, ambient coordinates.
    pub theta: Vec<f64>,
    /// Cost 1/2 r'r there, infinite when no finite value was found.
    pub cost: f64,
    /// Largest violation of bounds and constraints there, 0 when there are none.
    pub violation: f64,
    /// Why the solve ended.
    pub status: Status,
    /// One sentence with the numbers behind the status.
    pub message: String,
    /// Norm of the gradient at the last point where it was computed.
    pub gradient_norm: f64,
    /// Numbers of evaluations.
    pub counts: Counts,
    /// Wall-clock seconds.
    pub seconds: f64,
    /// Trace, empty unless asked for.
    pub trace: Vec<TraceRow>,
}

impl Outcome {
    /// Make the outcome of a theta that nothing was solved from: no evaluations, no trace.
    ///
    /// ```
    /// use cfpose_optim::{Outcome, Status};
    /// let outcome = Outcome::unsolved(vec![0.5], 2.0, Status::Deadline, "no time");
    /// assert!(outcome.usable() && outcome.counts.residuals == 0);
    /// ```
    #[must_use]
    pub fn unsolved(theta: Vec<f64>, cost: f64, status: Status, message: &str) -> Self {
        Self {
            theta,
            cost,
            violation: 0.0,
            status,
            message: message.to_string(),
            gradient_norm: f64::NAN,
            counts: Counts::default(),
            seconds: 0.0,
            trace: Vec::new(),
        }
    }

    /// Say whether the best point may be used: the status allows it, the cost is finite, and no constraint is violated by more
    /// than 1e-6.
    pub fn usable(&self) -> bool {
        self.status.usable() && self.cost.is_finite() && self.violation <= USABLE_VIOLATION
    }

    /// Describe the whole solve in words: what came out, why it ended, what it cost, and the trace if there is one.
    ///
    /// ```
    /// use cfpose_optim::{Control, solvers, testproblems::Rosenbrock};
    /// let solver = solvers::build("levenberg-marquardt").unwrap();
    /// let mut control = Control { trace: true, ..Control::default() };
    /// let report = solver.solve(&Rosenbrock, &[-1.2, 1.0], &mut control).unwrap().full_report();
    /// assert!(report.starts_with("The solve converged (zero-residual)"), "{report}");
    /// assert!(report.contains("iterations") && report.contains("gradient"));
    /// ```
    pub fn full_report(&self) -> String {
        let verdict = match (self.status.converged(), self.usable()) {
            (true, true) => "converged",
            (false, true) => "ended without convergence; its best point may be used",
            _ => "failed; its best point must not be used",
        };
        let counts = self.counts;
        let mut lines = vec![
            format!("The solve {verdict} ({}): {}.", self.status.name(), self.message),
            String::new(),
            format!("Cost 1/2 r'r         {:>14.6e}", self.cost),
            format!("Norm of the gradient {:>14.6e}", self.gradient_norm),
        ];
        if self.violation > 0.0 {
            lines.push(format!("Largest violation    {:>14.6e}", self.violation));
        }
        lines.push(format!("Parameters           {:?}", self.theta));
        lines.push(format!(
            "Effort               {} iterations, {} evaluations ({} with Jacobian, {} of curvature), {:.6} s",
            counts.iterations, counts.residuals, counts.jacobians, counts.curvatures, self.seconds
        ));
        if let (Some(first), Some(last)) = (self.trace.first(), self.trace.last()) {
            let rejected = self.trace.iter().filter(|row| !row.accepted).count();
            lines.push(format!(
                "Trace                cost {:.6e} at the start, {:.6e} at the end, {rejected} of {} trials rejected",
                first.cost,
                last.cost,
                self.trace.len() - 1
            ));
            lines.push(String::new());
            lines.push("iteration evaluations           cost       gradient           step        damping".to_string());
            lines.extend(self.trace.iter().map(TraceRow::line));
        }
        lines.join("\n") + "\n"
    }
}

impl TraceRow {
    /// Return the row of the report, with `-` for what the solver has not and `rejected` where it was.
    fn line(&self) -> String {
        let number = |v: f64| if v.is_nan() { format!("{:>14}", "-") } else { format!("{v:>14.6e}") };
        let numbers = [self.cost, self.gradient_norm, self.step_norm, self.damping].map(number).join(" ");
        let mark = if self.accepted { "" } else { "  rejected" };
        format!("{:>9} {:>11} {numbers}{mark}", self.iteration, self.evaluations)
    }
}

/// Violation of constraints above which a point is of no use.
const USABLE_VIOLATION: f64 = 1e-6;
