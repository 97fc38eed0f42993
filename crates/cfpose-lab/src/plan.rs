//! What an experiment will compute: cells, trials, shards.

pub use crate::cell::Cell;
use crate::config::Experiment;
use crate::error::LabError;
use crate::lab::Lab;
use crate::metric::Metric;
pub use crate::shard::Shard;

/// One trial of the plan: its data are computed once, for all methods.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PlannedTrial {
    /// Index of the cell.
    pub cell: usize,
    /// Repetition, from 0.
    pub repetition: usize,
    /// Key.
    pub key: u64,
}

/// Most trials of one experiment: their plan is held in memory.
pub const MAX_TRIALS: usize = 10_000_000;

/// All trials of an experiment in order.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// Cells.
    pub cells: Vec<Cell>,
    /// Names of the methods.
    pub methods: Vec<String>,
    /// Trials, cell by cell.
    pub trials: Vec<PlannedTrial>,
    /// The metrics of every cell's scenario.
    pub metrics: Vec<Vec<Metric>>,
}

impl Plan {
    /// Lay out an experiment. This is what `--dry` prints.
    ///
    /// # Errors
    /// [`LabError::TooManyTrials`] above [`MAX_TRIALS`] trials over all cells.
    pub fn new(lab: &Lab, experiment: &Experiment) -> Result<Self, LabError> {
        let cells = experiment.cells();
        let asked = cells.iter().fold(0_usize, |sum, cell| sum.saturating_add(cell.trials));
        if asked > MAX_TRIALS {
            return Err(LabError::TooManyTrials { asked, limit: MAX_TRIALS });
        }
        let mut trials = Vec::new();
        for (index, cell) in cells.iter().enumerate() {
            let keys = cell.keys(lab).into_iter().enumerate();
            trials.extend(keys.map(|(repetition, key)| PlannedTrial { cell: index, repetition, key }));
        }
        // A scenario that cannot be built was refused when the experiment was read.
        let metrics = cells.iter().map(|cell| cell.build(lab).map_or_else(|_| Vec::new(), |s| s.metrics().to_vec()));
        let (metrics, methods) = (metrics.collect(), experiment.methods.iter().map(|m| m.name.clone()).collect());
        Ok(Self { cells, methods, trials, metrics })
    }

    /// Return the number of records of a complete run: trials x methods.
    pub fn num_records(&self) -> usize {
        self.trials.len() * self.methods.len()
    }

    /// Return the trials of a shard.
    pub fn shard(&self, shard: Shard) -> Vec<PlannedTrial> {
        let numbered = self.trials.iter().enumerate();
        numbered.filter(|(position, _)| shard.holds(*position)).map(|(_, trial)| *trial).collect()
    }
}
