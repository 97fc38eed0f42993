//! Every solver of the table, with its defaults, through the whole conformance suite.

use cfpose_optim::{check, solvers};

#[test]
fn every_solver_passes_every_case() {
    let mut complaints = Vec::new();
    for entry in solvers::ALL {
        let solver = solvers::build(entry.name).expect("defaults build");
        assert_eq!(solver.name(), entry.name);
        for finding in check::conformance(solver.as_ref()) {
            if let Some(problem) = finding.problem {
                complaints.push(format!("{}, {}: {problem}", entry.name, finding.case));
            }
        }
    }
    assert!(complaints.is_empty(), "\n{}", complaints.join("\n"));
}
