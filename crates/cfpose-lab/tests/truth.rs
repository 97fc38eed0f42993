//! A small hunt for wrong answers that are called good; the large one is `experiments/truth.toml`.

use cfpose::entry::find;
use cfpose::{Estimator, Execution, Registry, Supervision, Verdict};
use cfpose_lab::method::Method;
use cfpose_lab::{Determined, nearest_truth, scenarios, seed};

/// Trials of each scenario, and the first seed: none that a threshold was set on.
const TRIALS: u64 = 24;
const FIRST: u64 = 15_000;

/// Estimate trials by `auto`; return how many are right and how many `good`. A wrong one that is called good ends the test.
fn hunt(spec: &str, numbers: std::ops::Range<u64>) -> (usize, usize) {
    let (entry, parameters) = find("scenario", scenarios::ALL, spec).unwrap();
    let scenario = (entry.build)(&parameters).unwrap();
    let (mut right, mut good) = (0, 0);
    for number in numbers {
        let trial = scenario.trial(&mut seed::data_stream(number, 77)).unwrap();
        let settings = Method::of_preset("auto").settings(scenario.model(), trial.start.as_deref(), number).unwrap();
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
    println!("{spec}: {right} right, {good} good");
    (right, good)
}

#[test]
fn a_hunt_finds_no_gross_error_that_is_called_good() {
    for (spec, right_at_least) in [("hunt-planar", 12), ("hunt-space", 14)] {
        let (right, good) = hunt(spec, FIRST..FIRST + TRIALS);
        assert!(right >= right_at_least, "{spec}: {right} of {TRIALS} right");
        assert!(2 * good >= right, "{spec}: {good} of {right} right answers are good");
    }
}

/// Half of either side is missing: the halves turned by 180 degrees lie on each other within a tenth of their size, and a fitted noise of
/// that size is more likely than the part that fits exactly. Such an answer was called good in 3 of 24 trials, and a start that is
/// nearly right was left in 9 of 24.
#[test]
fn halves_that_lie_on_each_other_are_no_good_pose() {
    let with = |shape: u32, start: &str| {
        format!(
            "cloud3[shape={shape},points=1500,sampling=independent,noise=0.005,noise_on=both,cut=both,overlap=0.5{start}]"
        )
    };
    let right: usize = (21..25).map(|shape| hunt(&with(shape, ",start=3,start_offset=0.02"), FIRST..FIRST + 2).0).sum();
    assert!(right >= 5, "{right} of 8 from a start that is nearly right");
    (21..25).for_each(|shape| _ = hunt(&with(shape, ""), FIRST..FIRST + 2));
}
