//! The solver part of `cfpose check`: every solver through the conformance suite.

use cfpose::Registry;
use cfpose_optim::check::conformance;
use serde::Serialize;

use crate::failure::Failure;
use crate::output;

/// One solver and what it did wrong.
#[derive(Debug, Serialize)]
pub struct SolverLine {
    solver: String,
    passed: bool,
    num_cases: usize,
    problems: Vec<Problem>,
}

#[derive(Debug, Serialize)]
struct Problem {
    case: &'static str,
    problem: String,
}

impl SolverLine {
    /// Run one solver through the suite.
    ///
    /// # Errors
    /// Usage, when the solver cannot be built.
    pub fn check(registry: &Registry, solver: &str) -> Result<Self, Failure> {
        let findings = conformance(registry.solver(solver)?.as_ref());
        let num_cases = findings.len();
        let problem = |finding: cfpose_optim::check::Finding| {
            finding.problem.map(|problem| Problem { case: finding.case, problem })
        };
        let problems: Vec<Problem> = findings.into_iter().filter_map(problem).collect();
        Ok(Self { solver: solver.to_string(), passed: problems.is_empty(), num_cases, problems })
    }

    /// Say whether every case was passed.
    pub fn passed(&self) -> bool {
        self.passed
    }
}

/// Write one row a solver and one for each failed case.
pub fn table(lines: &[SolverLine]) -> String {
    let mut rows = Vec::new();
    for line in lines {
        let verdict = if line.passed { "ok" } else { "FAILED" };
        rows.push(vec![line.solver.clone(), verdict.to_string(), format!("{} cases", line.num_cases)]);
        for problem in &line.problems {
            rows.push(vec![String::new(), problem.case.to_string(), problem.problem.clone()]);
        }
    }
    output::table(&["solver", "", "conformance"], &rows)
}
