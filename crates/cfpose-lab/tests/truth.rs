//! A small hunt for wrong answers that are called good; the large one is `experiments/truth.toml`.

use cfpose::entry::find;
use cfpose::{Estimator, Execution, Registry, Supervision, Verdict};
use cfpose_lab::method::Method;
use cfpose_lab::{Determined, nearest_truth, scenarios, seed};

/// Trials of each scenario, and the first seed: none that a threshold was set on.
const TRIALS: u64 = 24;
const FIRST: u64 = 15_000;

#[test]
fn a_hunt_finds_no_gross_error_that_is_called_good() {
    for (spec, right_at_least) in [("hunt-planar", 12), ("hunt-space", 14)] {
        let (entry, parameters) = find("scenario", scenarios::ALL, spec).unwrap();
        let scenario = (entry.build)(&parameters).unwrap();
        let (mut right, mut good) = (0, 0);
        for number in FIRST..FIRST + TRIALS {
            let trial = scenario.trial(&mut seed::data_stream(number, 77)).unwrap();
            let settings =
                Method::of_preset("auto").settings(scenario.model(), trial.start.as_deref(), number).unwrap();
            let estimator =
                Estimator::new(&Registry::default(), &settings, &trial.source, &trial.target, &Execution::default())
                    .unwrap();
            let estimate = estimator.solve(Supervision::default()).unwrap();
            let found = nearest_truth(scenario.as_ref(), &estimator.model().layout, &estimate.theta, &trial);
            let possible = trial.determined != Determined::Nothing;
            let is_right = possible && found.is_some_and(|(error, _)| trial.success.holds(&error));
            right += usize::from(is_right);
            if estimate.verdict == Some(Verdict::Good) {
                good += 1;
                assert!(is_right && trial.determined == Determined::Theta, "{spec} {number}: {:?}", trial.conditions);
            }
        }
        println!("{spec}: {right} of {TRIALS} right, {good} good");
        assert!(right >= right_at_least, "{spec}: {right} of {TRIALS} right");
        assert!(2 * good >= right, "{spec}: {good} of {right} right answers are good");
    }
}
