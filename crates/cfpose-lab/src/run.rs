//! Computing an experiment: trials over threads, records into a folder.

mod desk;
mod export;
mod replay;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use cfpose::{Execution, Isa};

use crate::config::Experiment;
use crate::data;
use crate::error::LabError;
use crate::folder::lock::FolderLock;
use crate::folder::{self, Appender, EXPERIMENT, lines_of, trials_name, write_whole};
use crate::lab::Lab;
use crate::merge::{Merged, collect, write_tables};
use crate::method::Method;
use crate::plan::{Cell, Plan, PlannedTrial, Shard};
use crate::record::Record;
use crate::rows::Rows;
use crate::scenario::{Scenario, ScenarioError};
use crate::trial::{Bench, Drawn};
use desk::{Claim, Desk};
pub use export::{Exported, export};
pub use replay::{Replay, replay};

/// How far a run is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Progress {
    /// Records that are there, those of earlier runs included.
    pub done: usize,
    /// Records of the shard.
    pub total: usize,
    /// Successes among the records of this run.
    pub successes: usize,
    /// Records of this run.
    pub computed: usize,
}

/// How to run.
pub struct RunOptions<'a> {
    /// Folder of the results; it is made.
    pub out: PathBuf,
    /// Part of the run to compute.
    pub shard: Shard,
    /// Whether records in the folder are kept and only the missing ones computed.
    pub resume: bool,
    /// Threads over trials, at least 1. Results do not depend on it.
    pub threads: usize,
    /// Instruction set.
    pub isa: Isa,
    /// Flag that another thread may raise to stop; records that are done stay.
    pub cancel: Option<&'a AtomicBool>,
    /// What other programs found, for the methods that are external.
    pub rows: Option<&'a Rows>,
    /// Called after every trial, one call at a time.
    pub progress: Option<&'a (dyn Fn(Progress) + Sync)>,
}

impl RunOptions<'_> {
    /// Run everything on one thread into a folder.
    pub fn new(out: impl Into<PathBuf>) -> Self {
        Self {
            out: out.into(),
            shard: Shard::WHOLE,
            resume: false,
            threads: 1,
            isa: Isa::detect(),
            cancel: None,
            rows: None,
            progress: None,
        }
    }
}

/// What a run did.
#[derive(Debug, Clone, PartialEq)]
pub struct RunReport {
    /// Records computed now.
    pub computed: usize,
    /// Records of the shard that were there already.
    pub resumed: usize,
    /// Records of the whole experiment that are there now.
    pub records: usize,
    /// Records of a complete run.
    pub expected: usize,
    /// Records of the shard that are not there: the run was cancelled, or something else took them away.
    pub missing: usize,
    /// Whether the run was cancelled.
    pub cancelled: bool,
    /// The tables, written because the folder holds all trials.
    pub merged: Option<Merged>,
}

/// Compute an experiment, or the rest of it, into a folder.
///
/// Each trial's data depend on the experiment's seed and the trial alone; records are the same for any number of threads
/// and shards. When the folder holds all trials the tables are written, as by [`crate::merge()`].
///
/// ```
/// use cfpose_lab::{Experiment, Lab, RunOptions, run};
/// let text = "trials = 2\n[[scenario]]\nname = \"planar-curve\"\n[[method]]\nname = \"paper\"\n";
/// let lab = Lab::default();
/// let experiment = Experiment::parse(&lab, text, "two.toml").unwrap();
/// let folder = tempfile::tempdir().unwrap();
/// let report = run(&lab, &experiment, &RunOptions::new(folder.path())).unwrap();
/// assert_eq!((report.computed, report.merged.unwrap().rows[0].trials), (2, 2));
/// ```
///
/// One run writes a record file at a time; other shards, [`crate::merge()`] and [`crate::status`] may work in the folder meanwhile. With
/// `resume` the experiment may have grown since ([`crate::growth::grows`]): the records that are there stay.
///
/// # Errors
/// [`LabError`] when the folder belongs to another experiment, instruction set, version or other data, holds records and `resume`
/// is off, another run computes the same shard, or the folder cannot be written.
pub fn run(lab: &Lab, experiment: &Experiment, options: &RunOptions<'_>) -> Result<RunReport, LabError> {
    let fingerprint = experiment.fingerprint();
    let plan = Plan::new(lab, experiment)?;
    let desk = Desk { lab, experiment, fingerprint: &fingerprint, plan: &plan, options };
    // Nothing is written before it is known that the run can work.
    let done = desk.look(None)?;
    let scenarios = load_scenarios(lab, experiment, &plan)?;
    let data = data::hashes(&scenarios)?;
    let trials = plan.shard(options.shard);
    let bench = Bench {
        lab,
        experiment,
        fingerprint: &fingerprint,
        execution: Execution { isa: options.isa, pool: None },
        cancel: options.cancel,
        data: &data,
        rows: options.rows,
    };
    probe(&bench, &plan, &scenarios, &jobs(experiment, &trials, &done, options.rows))?;
    let Claim { appender, lock, done } = desk.claim(&data)?;
    let jobs = jobs(experiment, &trials, &done, options.rows);
    let missing: usize = jobs.iter().map(|job| job.methods.len()).sum();
    let total = missing + done.len();
    let work = Work {
        bench: &bench,
        plan: &plan,
        scenarios: &scenarios,
        jobs: &jobs,
        next: AtomicUsize::new(0),
        stop: AtomicBool::new(false),
        options,
        state: Mutex::new(State {
            appender,
            progress: Progress { done: total - missing, total, successes: 0, computed: 0 },
            failure: None,
        }),
    };
    // More threads than trials would only wait.
    let threads = options.threads.clamp(1, jobs.len().max(1));
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|problem| LabError::Threads { threads, problem: problem.to_string() })?;
    pool.broadcast(|_| work.take_jobs());
    let state = work.state.into_inner().unwrap_or_else(PoisonError::into_inner);
    let folder_lock = FolderLock::wait(&options.out)?;
    state.appender.close()?;
    if let Some(failure) = state.failure {
        return Err(failure);
    }
    let there = collect(lab, &options.out)?;
    sort_file(&options.out.join(trials_name(options.shard)), &there.records)?;
    lock.release();
    let found: BTreeSet<(String, String)> = there.records.iter().map(Record::identity).collect();
    let mine = self::jobs(experiment, &trials, &found, options.rows);
    let (records, expected) = (there.records.len(), there.plan.num_records());
    let cancelled = state.progress.done < total;
    Ok(RunReport {
        computed: state.progress.computed,
        resumed: total - missing,
        records,
        expected,
        missing: mine.iter().map(|job| job.methods.len()).sum(),
        cancelled,
        merged: if records == expected { Some(write_tables(&options.out, there, &folder_lock)?) } else { None },
    })
}

/// One trial and the methods that have no record yet.
struct Job<'a> {
    trial: PlannedTrial,
    methods: Vec<&'a Method>,
}

/// Return what is to do; of an external method only what there are rows for.
fn jobs<'a>(
    experiment: &'a Experiment,
    trials: &[PlannedTrial],
    done: &BTreeSet<(String, String)>,
    rows: Option<&Rows>,
) -> Vec<Job<'a>> {
    let missing = |trial: &PlannedTrial| {
        let key = format!("{:016x}", trial.key);
        let here =
            |method: &&Method| !method.external || rows.is_some_and(|rows| rows.get(&key, &method.name).is_some());
        let methods = experiment.methods.iter().filter(here);
        let methods = methods.filter(|method| !done.contains(&(key.clone(), method.name.clone())));
        Job { trial: *trial, methods: methods.collect() }
    };
    trials.iter().map(missing).filter(|job| !job.methods.is_empty()).collect()
}

/// Build the scenario of every cell and read its files.
fn load_scenarios(lab: &Lab, experiment: &Experiment, plan: &Plan) -> Result<Vec<Box<dyn Scenario>>, LabError> {
    let load = |cell: &Cell| {
        let mut scenario = cell.build(lab).map_err(|problem| LabError::Entry {
            file: EXPERIMENT.to_string(),
            place: format!("scenario {}", cell.label()),
            problem: Box::new(problem),
        })?;
        scenario.load(&experiment.folder).map_err(|problem| scenario_error(cell, problem))?;
        Ok(scenario)
    };
    plan.cells.iter().map(load).collect()
}

fn scenario_error(cell: &Cell, problem: ScenarioError) -> LabError {
    LabError::Scenario { place: cell.label(), problem: Box::new(problem) }
}

/// Prepare the first trial of every cell with every method that has work there, so that a method that cannot apply to a
/// scenario is an error before the run and not a row of failures.
///
/// Data of one trial may be unlucky: points without a spread are left to the records.
fn probe(bench: &Bench<'_>, plan: &Plan, scenarios: &[Box<dyn Scenario>], jobs: &[Job<'_>]) -> Result<(), LabError> {
    let mut seen: BTreeSet<(usize, &str)> = BTreeSet::new();
    for job in jobs {
        let new: Vec<&Method> =
            job.methods.iter().copied().filter(|m| !m.external && seen.insert((job.trial.cell, &m.name))).collect();
        if new.is_empty() {
            continue;
        }
        let cell = &plan.cells[job.trial.cell];
        let trial = match bench.draw(scenarios[job.trial.cell].as_ref(), &job.trial) {
            Ok(trial) => trial,
            Err(ScenarioError::Points { .. }) => continue,
            Err(problem) => return Err(scenario_error(cell, problem)),
        };
        // What a solver cannot treat is a status of its record.
        let Drawn::Points(trial) = trial else { continue };
        for method in new {
            let prepared = bench.prepare(scenarios[job.trial.cell].as_ref(), &trial, &job.trial, method);
            // A start strategy that does not apply is an error before the run too.
            match prepared.and_then(|estimator| estimator.starts()) {
                Ok(_)
                | Err(cfpose::Error::Points { .. } | cfpose::Error::Data { .. } | cfpose::Error::Normalise { .. }) => {}
                Err(problem) => {
                    let place = format!("method `{}`, scenario {}", method.name, cell.label());
                    return Err(LabError::Inapplicable { place, problem: Box::new(problem) });
                }
            }
        }
    }
    Ok(())
}

/// What the threads of a run share: they take jobs in order, so the file is nearly in order too.
struct Work<'a> {
    bench: &'a Bench<'a>,
    plan: &'a Plan,
    scenarios: &'a [Box<dyn Scenario>],
    jobs: &'a [Job<'a>],
    next: AtomicUsize,
    stop: AtomicBool,
    options: &'a RunOptions<'a>,
    state: Mutex<State>,
}

struct State {
    appender: Appender,
    progress: Progress,
    failure: Option<LabError>,
}

impl Work<'_> {
    fn take_jobs(&self) {
        let cancelled = || self.options.cancel.is_some_and(|cancel| cancel.load(Ordering::Relaxed));
        while !self.stop.load(Ordering::Relaxed) && !cancelled() {
            let Some(job) = self.jobs.get(self.next.fetch_add(1, Ordering::Relaxed)) else { return };
            let cell = &self.plan.cells[job.trial.cell];
            let scenario = self.scenarios[job.trial.cell].as_ref();
            let records = self.bench.records(scenario, cell, &job.trial, &job.methods);
            // A solve that was cut short has no result.
            if cancelled() {
                return;
            }
            self.keep(&records);
        }
    }

    fn keep(&self, records: &[Record]) {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        if state.failure.is_some() {
            return;
        }
        if let Err(failure) = state.appender.append(records) {
            state.failure.get_or_insert(failure);
            self.stop.store(true, Ordering::Relaxed);
            return;
        }
        let progress = &mut state.progress;
        progress.done += records.len();
        progress.computed += records.len();
        progress.successes += records.iter().filter(|record| record.success).count();
        if let Some(callback) = self.options.progress {
            callback(*progress);
        }
    }
}

/// Bring the records of a shard's file into the order of the plan, all with the fingerprint of the experiment as it is now.
fn sort_file(path: &Path, sorted: &[Record]) -> Result<(), LabError> {
    let mut mine: BTreeMap<(String, String), Record> =
        folder::records_if_there(path)?.into_iter().map(|(_, record)| (record.identity(), record)).collect();
    if mine.is_empty() {
        return Ok(());
    }
    let mut lines = Vec::new();
    for record in sorted {
        if let Some(mut own) = mine.remove(&record.identity()) {
            own.experiment.clone_from(&record.experiment);
            own.seal();
            lines.push(own);
        }
    }
    write_whole(path, &lines_of(lines.iter()))
}
