//! Taking one's place in a folder: what is there, whether it belongs to the experiment, which record file is ours.

use std::collections::{BTreeMap, BTreeSet};

use crate::config::Experiment;
use crate::data::of_method;
use crate::error::LabError;
use crate::folder::lock::{FileLock, FolderLock};
use crate::folder::{self, Appender, EARLIER, EXPERIMENT, earlier, trials_name, write_whole};
use crate::growth::grows;
use crate::lab::Lab;
use crate::merge::{collect, same_experiment, same_isa, same_version};
use crate::method::Method;
use crate::plan::Plan;
use crate::record::{DataHashes, Record, VERSION};
use crate::run::RunOptions;

/// A run before it computes.
pub(super) struct Desk<'a> {
    pub lab: &'a Lab,
    pub experiment: &'a Experiment,
    pub fingerprint: &'a str,
    pub plan: &'a Plan,
    pub options: &'a RunOptions<'a>,
}

/// The record file of a run, and what the folder holds of its shard.
pub(super) struct Claim {
    pub appender: Appender,
    pub lock: FileLock,
    pub done: BTreeSet<(String, String)>,
}

impl Desk<'_> {
    /// Check that the folder may be used and return what is done already; nothing is written.
    ///
    /// `data` are the hashes of the files of every cell, once they are known.
    pub(super) fn look(&self, data: Option<&[DataHashes]>) -> Result<BTreeSet<(String, String)>, LabError> {
        let out = &self.options.out;
        let path = out.join(EXPERIMENT);
        if !path.is_file() {
            return Ok(BTreeSet::new());
        }
        let there = Experiment::load(self.lab, &path)?;
        if !(self.options.resume && grows(&there, self.experiment)) {
            same_experiment(&path, self.fingerprint, &there.fingerprint())?;
        }
        let there = collect(self.lab, out)?;
        if let Some(isa) = &there.isa {
            same_isa(out, isa, self.options.isa.name())?;
        }
        if let Some(version) = &there.version {
            same_version(out, VERSION, version)?;
        }
        if let Some(data) = data {
            // The folder's experiment may number its cells otherwise.
            let number = |label: String| there.plan.cells.iter().position(|cell| cell.label() == label);
            let cells = self.plan.cells.iter().zip(data);
            let given: BTreeMap<usize, DataHashes> =
                cells.filter_map(|(cell, data)| Some((number(cell.label())?, data.clone()))).collect();
            let of_method = |method: &Method| (method.name.clone(), of_method(&self.lab.registry, method));
            there.same_data(&given, &self.experiment.methods.iter().map(of_method).collect())?;
        }
        let positions = self.plan.shard(self.options.shard);
        let mine: BTreeSet<String> = positions.iter().map(|trial| format!("{:016x}", trial.key)).collect();
        let done: BTreeSet<(String, String)> =
            there.records.iter().map(Record::identity).filter(|(key, _)| mine.contains(key)).collect();
        if !done.is_empty() && !self.options.resume {
            return Err(LabError::Occupied { path: out.clone(), records: done.len() });
        }
        Ok(done)
    }

    /// Make the folder, say in it to which experiment it belongs, and take the record file.
    pub(super) fn claim(&self, data: &[DataHashes]) -> Result<Claim, LabError> {
        let out = &self.options.out;
        folder::make_folder(out)?;
        let _folder_lock = FolderLock::wait(out)?;
        folder::sweep(out)?;
        let path = out.join(trials_name(self.options.shard));
        let lock = FileLock::take(&path)?;
        let done = self.look(Some(data))?;
        self.write_experiment()?;
        Ok(Claim { appender: Appender::open(&path)?, lock, done })
    }

    /// Write the experiment where there is none or a smaller one; the fingerprint of that one is kept first, so that its records
    /// are known at every moment.
    fn write_experiment(&self) -> Result<(), LabError> {
        let out = &self.options.out;
        let path = out.join(EXPERIMENT);
        if path.is_file() {
            let there = Experiment::load(self.lab, &path)?.fingerprint();
            if there == self.fingerprint {
                return Ok(());
            }
            let mut known = earlier(out)?;
            if !known.contains(&there) {
                known.push(there);
                write_whole(&out.join(EARLIER), &format!("{:#}\n", serde_json::json!(known)))?;
            }
        }
        write_whole(&path, &self.experiment.to_toml())
    }
}
