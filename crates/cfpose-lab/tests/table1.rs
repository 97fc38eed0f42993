//! Table I (a) with fewer trials than `experiments/table1.toml` asks for, so that a drop in success shows at once.

use cfpose_lab::statistics::wilson95;
use cfpose_lab::{Experiment, Lab, RunOptions, run};

/// Success by e in percent, measured beforehand with an independent implementation and other seeds (500 trials).
const REFERENCE: [f64; 6] = [98.0, 97.8, 96.2, 72.8, 73.0, 72.2];

/// Trials a cell.
const TRIALS: usize = 80;

#[test]
fn the_printed_method_succeeds_as_often_as_the_reference() {
    let lab = Lab::default();
    let text = include_str!("../../../experiments/table1.toml");
    let mut experiment = Experiment::parse(&lab, text, "table1.toml").unwrap().with_trials(TRIALS);
    experiment.scenarios.truncate(1);
    experiment.methods.retain(|method| method.name == "paper");
    assert_eq!(experiment.methods.len(), 1);
    experiment.published.clear();
    let folder = tempfile::tempdir().unwrap();
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let report = run(&lab, &experiment, &RunOptions { threads, ..RunOptions::new(folder.path()) }).unwrap();
    for (row, reference) in report.merged.unwrap().rows.iter().zip(REFERENCE) {
        // What the full run must hold is within 5 points; the interval of a short run must meet that.
        let [low, high] = wilson95(row.successes, row.trials).map(|x| 100.0 * x);
        assert!(
            low <= reference + 5.0 && high >= reference - 5.0,
            "{:?}: {} of {}, reference {reference} %",
            row.parameters,
            row.successes,
            row.trials
        );
    }
}
