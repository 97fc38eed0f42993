//! A small hunt for wrong answers that are called good; the large one is `experiments/truth.toml`.

use cfpose::entry::find;
use cfpose::{Estimate, Estimator, Execution, Registry, Supervision, Verdict};
use cfpose_lab::calibration::estimate_mahalanobis;
use cfpose_lab::method::Method;
use cfpose_lab::{Determined, Scenario, Trial, nearest_truth, scenarios, seed};

/// Trials of each scenario, and the first seed: none that a threshold was set on.
const TRIALS: u64 = 24;
const FIRST: u64 = 15_000;

fn scenario(spec: &str) -> Box<dyn Scenario> {
    let (entry, parameters) = find("scenario", scenarios::ALL, spec).unwrap();
    (entry.build)(&parameters).unwrap()
}

/// Draw a trial and estimate it by `auto`.
fn estimated(scenario: &dyn Scenario, number: u64) -> (Trial, Estimator, Estimate) {
    let trial = scenario.trial(&mut seed::data_stream(number, 77)).unwrap();
    let settings = Method::of_preset("auto").settings(scenario.model(), trial.start.as_deref(), number).unwrap();
    let estimator =
        Estimator::new(&Registry::default(), &settings, &trial.source, &trial.target, &Execution::default()).unwrap();
    let estimate = estimator.solve(Supervision::default()).unwrap();
    (trial, estimator, estimate)
}

/// Estimate trials by `auto`; return how many are right and how many `good`. A wrong one that is called good ends the test.
fn hunt(spec: &str, numbers: std::ops::Range<u64>) -> (usize, usize) {
    let scenario = scenario(spec);
    let (mut right, mut good) = (0, 0);
    for number in numbers {
        let (trial, estimator, estimate) = estimated(scenario.as_ref(), number);
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

/// New samples of a curve of 3142 points with noise of 1 to 5 % of its size. While neighbours reached less far than the noise, squared errors
/// were up to 1000 for six unknowns.
#[test]
fn noisy_curves_are_known_as_well_as_they_say() {
    let scenario = scenario("hunt-planar[points=3142,damage=none]");
    let numbers = [170_008, 170_066, 170_119, 170_140, 170_141, 170_147];
    let squared = numbers.map(|number| {
        let (trial, estimator, estimate) = estimated(scenario.as_ref(), number);
        assert_eq!(estimate.verdict, Some(Verdict::Good), "{number}: {:?}", trial.conditions);
        estimate_mahalanobis(&estimator, &estimate, &trial.truth).unwrap()
    });
    // The mean of six chi-square variables of six degrees of freedom exceeds 10.2 in one of 1000 cases.
    let mean = squared.iter().sum::<f64>() / squared.len() as f64;
    assert!(mean < 10.2 && squared.iter().all(|d| *d < 22.5), "{squared:?}");
}

/// A fifth of the source, or of both sides, is missing beside noise of .02 to .05 of the size. While the source pulled at target points beyond
/// its ends, which it lacks, it was stretched towards them: 6 of these 24 answers were .1 to .3 off.
#[test]
fn arcs_that_one_side_lacks_do_not_bend_the_pose() {
    let mut right = 0;
    for curve in ["heart", "fourier[seed=31]", "fourier[seed=32]"] {
        for missing in ["hidden_source=0.2", "hidden=0.2,hidden_source=0.2"] {
            let spec = format!(
                "planar-curve[curve={curve},scale=0.5,theta=random,b_i=0.2,b_p=0.01,order=shuffled,start=none,{missing}]"
            );
            right += hunt(&spec, 5001..5005).0;
        }
    }
    assert!(right >= 21, "{right} of 24 right");
}

/// A third of the target is a dense blob beside the curve. A shape that is squeezed into it explains more points, and misses them together.
#[test]
fn a_dense_blob_is_no_part_of_the_shape() {
    let blob = |curve: &str| {
        format!(
            "planar-curve[curve={curve},scale=0.5,theta=random,b_i=0.2,b_p=0.01,order=shuffled,start=none,outliers=1500]"
        )
    };
    let curves = ["heart", "fourier[seed=31]", "fourier[seed=32]"];
    let right: usize = curves.iter().map(|curve| hunt(&blob(curve), 5001..5007).0).sum();
    assert!(right >= 15, "{right} of 18 right");
}

/// Nothing tells turns of a sphere, about a cylinder's or a torus' axis, or of a disk, a circle and a straight line apart.
#[test]
fn bodies_with_free_turns_are_never_good() {
    for body in ["sphere", "cylinder", "torus", "disk", "ring", "rod"] {
        let scenario = scenario(&format!("hunt-space[body={body},damage=none,points=500]"));
        for number in FIRST..FIRST + 4 {
            let (trial, _, estimate) = estimated(scenario.as_ref(), number);
            if trial.determined == Determined::ButADirection {
                assert_ne!(estimate.verdict, Some(Verdict::Good), "{body} {number}: {:?}", trial.conditions);
                // What no point reacts to at all (turns of an exact line about itself) is named by the conditioning.
                let is_named = !estimate.undetermined.is_empty()
                    || estimate.warnings.iter().any(|warning| warning.contains("rotation about"));
                assert!(is_named, "{body} {number}: {:?}", trial.conditions);
            }
        }
    }
}

#[test]
fn free_turns_are_named_and_symmetric_poses_listed() {
    let revolution = scenario("hunt-space[body=revolution]");
    for number in [130_032, 130_067, 130_091, 130_094] {
        let (trial, _, estimate) = estimated(revolution.as_ref(), number);
        assert_eq!(estimate.undetermined.len(), 1, "{number}: {:?}", trial.conditions);
        assert!(
            estimate.undetermined[0].words.starts_with("turns about"),
            "{number}: {}",
            estimate.undetermined[0].words
        );
        assert_ne!(estimate.verdict, Some(Verdict::Good));
    }
    // Without noise an equal pose is far behind until the last step.
    let boxes = scenario("hunt-space[body=box]");
    for number in [7309, 7325] {
        let (trial, _, estimate) = estimated(boxes.as_ref(), number);
        assert_eq!(estimate.verdict, Some(Verdict::Ambiguous));
        assert!(estimate.alternatives.len() >= trial.equally_true.len(), "{number}: {}", estimate.alternatives.len());
    }
}
