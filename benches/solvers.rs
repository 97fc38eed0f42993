//! Every solver on the paper's problem: time to its own tolerance from b_i = 0.1.
//!
//! `cargo bench -p cfpose-benches --bench solvers`; an argument filters by name. Evaluations and final costs are printed first.
use std::hint::black_box;

use cfpose::Registry;
use cfpose::{Estimator, Execution, Settings, Start, Supervision};
use criterion::Criterion;

/// Solvers that need minutes here; `experiments/solvers.toml` compares them with a budget.
const SLOW: [&str; 5] =
    ["newton-trust-region", "particle-swarm", "simulated-annealing", "multi-start", "basin-hopping"];

/// The paper's simulation: heart, b_p = 0.01, and a start from b_i = 0.1.
fn problem(registry: &Registry, solver: &str) -> Estimator {
    let text = "planar-curve[curve=heart,scale=0.45,theta=B,b_i=0.1,b_p=0.01]";
    let (entry, parameters) =
        cfpose::entry::find("scenario", cfpose_lab::scenarios::ALL, text).expect("the scenario is in the table");
    let scenario = (entry.build)(&parameters).expect("its parameters are right");
    let trial = scenario.trial(&mut cfpose_lab::seed::data_stream(1, 1)).expect("a trial can be drawn");
    let settings = Settings {
        solver: Some(solver.to_string()),
        start: Some(Start::Given(trial.start.clone().into_iter().collect())),
        ..Settings::preset("paper", scenario.model()).expect("the preset exists")
    };
    Estimator::new(registry, &settings, &trial.source, &trial.target, &Execution::default())
        .expect("the trial is valid")
}

fn main() {
    let registry = Registry::default();
    let mut criterion = Criterion::default().configure_from_args().sample_size(10);
    println!("{:<24} {:>12} {:>12} {:>24}", "solver", "evaluations", "cost", "status");
    for entry in &registry.solvers {
        if SLOW.contains(&entry.name) {
            continue;
        }
        let estimator = problem(&registry, entry.name);
        match estimator.solve(Supervision::default()) {
            Ok(estimate) => {
                let status = estimate.outcome.status.name();
                println!(
                    "{:<24} {:>12} {:>12.3e} {status:>24}",
                    entry.name, estimate.evaluations, estimate.outcome.cost
                );
            }
            Err(error) => println!("{:<24} {error}", entry.name),
        }
        criterion.bench_function(entry.name, |bencher| {
            bencher.iter(|| black_box(estimator.solve(Supervision::default())));
        });
    }
    criterion.final_summary();
}
