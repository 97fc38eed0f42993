//! Computing an experiment: trials over threads, records into a folder.

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use cfpose::{Execution, Isa};

use crate::config::Experiment;
use crate::error::LabError;
use crate::folder::{self, Appender, EXPERIMENT, lines_of, trials_name, write_whole};
use crate::lab::Lab;
use crate::merge::{Merged, collect, merge, same_experiment, same_isa};
use crate::method::Method;
use crate::plan::{Cell, Plan, PlannedTrial, Shard};
use crate::record::Record;
use crate::scenario::{Scenario, ScenarioError};
use crate::trial::Bench;

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
    /// Whether the run was cancelled.
    pub cancelled: bool,
    /// The tables, written because the folder holds all trials.
    pub merged: Option<Merged>,
}

/// Compute an experiment, or the rest of it, into a folder.
///
/// Each trial's data depend on the experiment's seed and the trial alone; records are the same for any number of threads
/// and shards. When the folder holds all trials the tables are written, as by [`merge`].
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
/// # Errors
/// [`LabError`] when the folder belongs to another experiment or instruction set, holds records and `resume` is off, or
/// cannot be written.
pub fn run(lab: &Lab, experiment: &Experiment, options: &RunOptions<'_>) -> Result<RunReport, LabError> {
    let fingerprint = experiment.fingerprint();
    let done = look_into_folder(lab, experiment, &fingerprint, options)?;
    let plan = Plan::new(lab, experiment)?;
    let scenarios = load_scenarios(lab, experiment, &plan)?;
    let trials = plan.shard(options.shard);
    let jobs = jobs(experiment, &trials, &done);
    let missing: usize = jobs.iter().map(|job| job.methods.len()).sum();
    let total = trials.len() * plan.methods.len();
    let bench = Bench {
        lab,
        experiment,
        fingerprint: &fingerprint,
        execution: Execution { isa: options.isa, pool: None },
        cancel: options.cancel,
    };
    probe(&bench, &plan, &scenarios, &jobs)?;
    claim_folder(experiment, options)?;
    let path = options.out.join(trials_name(options.shard));
    let work = Work {
        bench: &bench,
        plan: &plan,
        scenarios: &scenarios,
        jobs: &jobs,
        next: AtomicUsize::new(0),
        stop: AtomicBool::new(false),
        options,
        state: Mutex::new(State {
            appender: Appender::open(&path)?,
            progress: Progress { done: total - missing, total, successes: 0, computed: 0 },
            failure: None,
        }),
    };
    let threads = options.threads.max(1);
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|problem| LabError::Threads { threads, problem: problem.to_string() })?;
    pool.broadcast(|_| work.take_jobs());
    let state = work.state.into_inner().unwrap_or_else(PoisonError::into_inner);
    if let Some(failure) = state.failure {
        return Err(failure);
    }
    let there = collect(lab, &options.out)?;
    let complete = there.records.len() == plan.num_records();
    if !complete {
        sort_file(&path, &there.records)?;
    }
    Ok(RunReport {
        computed: state.progress.computed,
        resumed: total - missing,
        records: there.records.len(),
        expected: plan.num_records(),
        cancelled: state.progress.done < total,
        merged: if complete { Some(merge(lab, &options.out)?) } else { None },
    })
}

/// One trial and the methods that have no record yet.
struct Job<'a> {
    trial: PlannedTrial,
    methods: Vec<&'a Method>,
}

fn jobs<'a>(experiment: &'a Experiment, trials: &[PlannedTrial], done: &BTreeSet<(String, String)>) -> Vec<Job<'a>> {
    let missing = |trial: &PlannedTrial| {
        let key = format!("{:016x}", trial.key);
        let methods = experiment.methods.iter().filter(|method| !done.contains(&(key.clone(), method.name.clone())));
        Job { trial: *trial, methods: methods.collect() }
    };
    trials.iter().map(missing).filter(|job| !job.methods.is_empty()).collect()
}

/// Make the folder and say in it to which experiment it belongs.
fn claim_folder(experiment: &Experiment, options: &RunOptions<'_>) -> Result<(), LabError> {
    folder::make_folder(&options.out)?;
    let path = options.out.join(EXPERIMENT);
    if path.is_file() { Ok(()) } else { write_whole(&path, &experiment.to_toml()) }
}

/// Check that the folder may be used and return what is done already; nothing is written yet.
fn look_into_folder(
    lab: &Lab,
    experiment: &Experiment,
    fingerprint: &str,
    options: &RunOptions<'_>,
) -> Result<BTreeSet<(String, String)>, LabError> {
    let path = options.out.join(EXPERIMENT);
    if !path.is_file() {
        return Ok(BTreeSet::new());
    }
    same_experiment(&path, fingerprint, &Experiment::load(lab, &path)?.fingerprint())?;
    let there = collect(lab, &options.out)?;
    if let Some(isa) = &there.isa {
        same_isa(&options.out, isa, options.isa.name())?;
    }
    let positions = Plan::new(lab, experiment)?.shard(options.shard);
    let mine: BTreeSet<String> = positions.iter().map(|trial| format!("{:016x}", trial.key)).collect();
    let done: BTreeSet<(String, String)> =
        there.records.iter().map(Record::identity).filter(|(key, _)| mine.contains(key)).collect();
    if !done.is_empty() && !options.resume {
        return Err(LabError::Occupied { path: options.out.clone(), records: done.len() });
    }
    Ok(done)
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
            job.methods.iter().copied().filter(|method| seen.insert((job.trial.cell, &method.name))).collect();
        if new.is_empty() {
            continue;
        }
        let cell = &plan.cells[job.trial.cell];
        let trial = match bench.draw(scenarios[job.trial.cell].as_ref(), &job.trial) {
            Ok(trial) => trial,
            Err(ScenarioError::Points { .. }) => continue,
            Err(problem) => return Err(scenario_error(cell, problem)),
        };
        for method in new {
            let prepared = bench.prepare(scenarios[job.trial.cell].as_ref(), &trial, &job.trial, method);
            // A start strategy that does not apply is an error before the run too.
            match prepared.and_then(|estimator| estimator.starts()) {
                Ok(_) | Err(cfpose::Error::Points { .. } | cfpose::Error::Normalise { .. }) => {}
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

/// Bring the records of a shard's file into the order of the plan.
fn sort_file(path: &std::path::Path, sorted: &[Record]) -> Result<(), LabError> {
    let mine: BTreeSet<(String, String)> =
        folder::read_records(path)?.into_iter().map(|(_, record)| record.identity()).collect();
    write_whole(path, &lines_of(sorted.iter().filter(|record| mine.contains(&record.identity()))))
}
