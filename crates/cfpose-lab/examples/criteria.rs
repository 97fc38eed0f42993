//! How often each criterion of the verdict is wrong: `cargo run --release -p cfpose-lab --example criteria`.
//!
//! Right answers: simulations whose truth was found (the other criteria may say what they like). Wrong ones: the target is
//! another shape, so that every answer is wrong. A false alarm is a right answer that the criterion alone would call suspect, a
//! miss a wrong one that it would let pass. The reasons in `Criteria` come from this table.

use cfpose::entry::find;
use cfpose::{Criteria, Estimate, Estimator, Execution, Points, Registry, Settings, Supervision};
use cfpose_lab::method::Method;
use cfpose_lab::{Scenario, Trial, scenarios, seed};

/// Right scenarios, each with the one whose target is another shape.
const PAIRS: [(&str, &str); 4] = [
    ("planar-curve[curve=flower,b_i=0.1,b_p=0.01]", "planar-curve[curve=fish,b_i=0.1,b_p=0.01]"),
    ("planar-curve[curve=heart,b_i=0.1,b_p=0.02,order=shuffled]", "planar-curve[curve=blob,b_i=0.1,b_p=0.02]"),
    ("cloud3[points=1000,noise=0.005]", "cloud3[shape=2,points=1000,noise=0.005]"),
    ("cloud3[points=1000,sampling=independent,noise=0.005]", "cloud3[shape=2,points=1000,noise=0.005]"),
];

/// Trials of each pair.
const TRIALS: u64 = 40;

fn scenario(spec: &str) -> Result<Box<dyn Scenario>, Box<dyn std::error::Error>> {
    let (entry, parameters) = find("scenario", scenarios::ALL, spec)?;
    Ok((entry.build)(&parameters)?)
}

fn solve(settings: &Settings, source: &Points, target: &Points) -> Result<(Estimator, Estimate), cfpose::Error> {
    let estimator = Estimator::new(&Registry::default(), settings, source, target, &Execution::default())?;
    let estimate = estimator.solve(Supervision::default())?;
    Ok((estimator, estimate))
}

/// What each criterion says about an estimate: true for suspect.
fn alarms(estimator: &Estimator, estimate: &Estimate, criteria: &Criteria) -> [bool; 5] {
    let support = estimate.support;
    let statistics = estimate.statistics.as_ref();
    let means = statistics.map_or(0, |s| s.degrees_of_freedom) + estimator.num_unknowns() + 1;
    let few = estimator.target().len() * estimator.model().dim();
    [
        statistics.is_none_or(|s| s.p_value < criteria.p_suspect),
        support.is_none_or(|s| s.coherence > criteria.coherent),
        support.is_none_or(|s| s.unexplained_source > criteria.partial),
        estimate.clutter.is_some_and(|share| share > criteria.max_clutter),
        (few as f64) < criteria.informative * means as f64,
    ]
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let criteria = Criteria::default();
    let (mut right, mut wrong) = (Vec::new(), Vec::new());
    for (spec, other) in PAIRS {
        let (scenario, other) = (scenario(spec)?, scenario(other)?);
        for number in 0..TRIALS {
            let draw = |scenario: &dyn Scenario| -> Result<Trial, Box<dyn std::error::Error>> {
                Ok(scenario.trial(&mut seed::data_stream(11, number))?)
            };
            let (trial, foreign) = (draw(scenario.as_ref())?, draw(other.as_ref())?);
            let method = Method::of_preset("auto");
            let settings = method.settings(scenario.model(), trial.start.as_deref(), number)?;
            let (estimator, estimate) = solve(&settings, &trial.source, &trial.target)?;
            let error = scenario.error(&estimator.model().layout, &estimate.theta, &trial.truth);
            if error.is_some_and(|error| trial.success.holds(&error)) {
                right.push(alarms(&estimator, &estimate, &criteria));
            }
            let (estimator, estimate) = solve(&settings, &trial.source, &foreign.target)?;
            if estimate.usable() {
                wrong.push(alarms(&estimator, &estimate, &criteria));
            }
        }
    }
    println!("| criterion | false alarms of {} right | misses of {} wrong |\n|---|---|---|", right.len(), wrong.len());
    for (k, name) in ["p-suspect", "coherent", "partial", "max-clutter", "informative"].iter().enumerate() {
        let alarms = right.iter().filter(|said| said[k]).count();
        let misses = wrong.iter().filter(|said| !said[k]).count();
        println!("| {name} | {alarms} | {misses} |");
    }
    let good = wrong.iter().filter(|said| said.iter().all(|alarm| !alarm)).count();
    println!("wrong answers that no criterion notices: {good} of {}", wrong.len());
    Ok(())
}
