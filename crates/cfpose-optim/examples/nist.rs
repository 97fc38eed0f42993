//! Print how many of NIST's 54 nonlinear regressions each least-squares solver brings to at least 4 certified digits.
//!
//! `cargo run --release -p cfpose-optim --example nist` for the table of all solvers, with a solver's text as argument for
//! its line on every start.

use cfpose_optim::testproblems::nist;
use cfpose_optim::{Control, Outcome, solvers};

/// Solvers of the table, each with its reading in the docs.
const SOLVERS: &[&str] = &[
    "gauss-newton",
    "levenberg-marquardt",
    "levenberg-marquardt[damping=nielsen]",
    "trust-region",
    "trust-region[step=steihaug]",
    "trust-region[step=dogleg]",
    "newton-trust-region",
    "clarabel",
    "minpack",
    "argmin-trust-region",
    "bfgs",
    "l-bfgs",
    "nonlinear-cg",
];

/// Evaluations allowed for one start.
const BUDGET: usize = 5000;

/// Name of a start, certified digits reached, outcome.
type Row = (String, f64, Outcome);

/// Solve every start.
fn run(text: &str) -> Result<Vec<Row>, Box<dyn std::error::Error>> {
    let solver = solvers::build(text)?;
    let mut rows = Vec::new();
    for problem in nist::all() {
        for (k, start) in problem.starts().into_iter().enumerate() {
            let mut control = Control::default();
            (control.stopping.max_iterations, control.stopping.max_evaluations) = (BUDGET, BUDGET);
            let outcome = solver.solve(&problem.problem(), start, &mut control)?;
            rows.push((format!("{} start {}", problem.name, k + 1), problem.digits(&outcome.theta), outcome));
        }
    }
    Ok(rows)
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    if let Some(text) = std::env::args().nth(1) {
        for (name, digits, outcome) in run(&text)? {
            let (count, status) = (outcome.counts.residuals, outcome.status.name());
            println!("{name:18} {digits:6.2} digits {count:6} evaluations  {status}: {}", outcome.message);
        }
        return Ok(());
    }
    println!("| solver | solved of 54 | mean digits | evaluations of those | not solved |");
    println!("|---|---:|---:|---:|---|");
    for text in SOLVERS {
        let rows = run(text)?;
        let solved: Vec<_> = rows.iter().filter(|(_, digits, _)| *digits >= 4.0).collect();
        let mean = solved.iter().map(|(_, digits, _)| digits).sum::<f64>() / solved.len().max(1) as f64;
        let evaluations: usize = solved.iter().map(|(_, _, outcome)| outcome.counts.residuals).sum();
        let failed = rows.iter().filter(|(_, digits, _)| *digits < 4.0).map(|(name, ..)| name.replace(" start ", "/"));
        let failed: Vec<String> = failed.collect();
        println!("| `{text}` | {} | {mean:.2} | {evaluations} | {} |", solved.len(), failed.join(", "));
    }
    Ok(())
}
