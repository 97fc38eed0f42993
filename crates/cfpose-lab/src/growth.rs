//! Whether an experiment only adds to another one, so that the records of the smaller one stay true.

use std::collections::BTreeMap;

use crate::config::Experiment;

/// Say whether `larger` holds every trial and method of `smaller`, unchanged: the same seed and limits, every cell with at least as
/// many trials, every method as it was.
///
/// A trial's data depend on the seed and the trial alone, so the records of `smaller` are records of `larger`.
///
/// ```
/// use cfpose_lab::{Experiment, Lab, growth::grows};
/// let text = "trials = 2\n[[scenario]]\nname = \"planar-curve\"\n[[method]]\nname = \"paper\"\n";
/// let read = |text: &str| Experiment::parse(&Lab::default(), text, "e.toml").unwrap();
/// let (small, large) = (read(text), read(text).with_trials(5));
/// assert!(grows(&small, &large) && !grows(&large, &small));
/// assert!(!grows(&small, &read(&format!("seed = 2\n{text}"))));
/// ```
pub fn grows(smaller: &Experiment, larger: &Experiment) -> bool {
    let cells: BTreeMap<String, usize> = larger.cells().into_iter().map(|cell| (cell.label(), cell.trials)).collect();
    smaller.seed == larger.seed
        && smaller.deadline_secs == larger.deadline_secs
        && smaller.cells().iter().all(|cell| cells.get(&cell.label()).is_some_and(|trials| *trials >= cell.trials))
        && smaller.methods.iter().all(|method| larger.methods.contains(method))
}
