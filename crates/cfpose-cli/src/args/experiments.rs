//! Arguments of simulations, experiments and training.

use std::path::PathBuf;

use clap::Args;

/// Arguments of `demo`.
#[derive(Debug, Args)]
pub struct DemoArgs {
    /// Folder of the figure and the points
    #[arg(long, value_name = "DIR", default_value = "cfpose-demo")]
    pub out: PathBuf,
    /// What is simulated
    #[arg(long, value_name = "NAME", default_value = "planar-curve[curve=heart,b_i=0.1,b_p=0.01]")]
    pub scenario: String,
    /// Seed of the simulation
    #[arg(long, value_name = "K", default_value_t = 1)]
    pub seed: u64,
    /// Write JSON to a file, or to standard output for -
    #[arg(long, value_name = "FILE|-")]
    pub json: Option<PathBuf>,
}

/// Arguments of `run`.
#[derive(Debug, Args)]
pub struct RunArgs {
    /// Experiment file
    #[arg(value_name = "EXPERIMENT.toml")]
    pub experiment: PathBuf,
    /// Folder of the results, out/EXPERIMENT when not given
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Trials of every cell instead of the file's
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub trials: Option<u32>,
    /// Compute part I of N, I from 0; auto takes both from the job array's environment, auto/N only the number of the task
    #[arg(long, value_name = "I/N|auto|auto/N")]
    pub shard: Option<String>,
    /// Keep the records that are there and compute the missing ones; trials may have risen, cells and methods been added
    #[arg(long)]
    pub resume: bool,
    /// Threads over trials, all processors when not given; the result does not depend on it
    #[arg(long, value_name = "T", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Instruction set: auto, avx512, avx2 or baseline; the same for all shards
    #[arg(long, value_name = "ISA", default_value = "auto")]
    pub isa: String,
    /// Print what would be computed and stop
    #[arg(long)]
    pub dry: bool,
    /// Write the point files of all trials and trials.jsonl into a folder for other programs, and stop
    #[arg(long, value_name = "DIR", conflicts_with_all = ["shard", "resume", "dry", "only"])]
    pub export_data: Option<PathBuf>,
    /// Take what other programs found, a JSON object a line: key, method, theta; for methods with external = true
    #[arg(long, value_name = "FILE", conflicts_with_all = ["dry", "only"])]
    pub import_rows: Option<PathBuf>,
    /// Compute one trial again and write its point files into the folder's only-KEY; keys stand in results.csv
    #[arg(long, value_name = "KEY", conflicts_with_all = ["shard", "resume", "dry"])]
    pub only: Option<String>,
    /// Write JSON to a file, or to standard output for -
    #[arg(long, value_name = "FILE|-")]
    pub json: Option<PathBuf>,
}

/// Arguments of `plan`.
#[derive(Debug, Args)]
pub struct PlanArgs {
    /// Experiment file
    #[arg(value_name = "EXPERIMENT.toml")]
    pub experiment: PathBuf,
    /// Number of parts
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub shards: u32,
    /// Engine that runs them
    #[arg(long, value_name = "slurm|parallel|dask|snakemake")]
    pub emit: String,
    /// Folder of the results, out/EXPERIMENT when not given; all machines see it
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Folder of the job files, jobs/EXPERIMENT/ENGINE when not given
    #[arg(long, value_name = "DIR")]
    pub jobs: Option<PathBuf>,
    /// Trials of every cell instead of the file's
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub trials: Option<u32>,
    /// Threads of a shard
    #[arg(long, value_name = "T", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: u16,
    /// Instruction set of all shards, where the machines differ: avx512, avx2 or baseline
    #[arg(long, value_name = "ISA")]
    pub isa: Option<String>,
    /// Write JSON to a file, or to standard output for -
    #[arg(long, value_name = "FILE|-")]
    pub json: Option<PathBuf>,
}

/// Arguments of `learn`.
#[derive(Debug, Args)]
pub struct LearnArgs {
    /// Training file
    #[arg(value_name = "CONFIG.toml")]
    pub config: PathBuf,
    /// File of the weights, CONFIG.safetensors in this folder when not given
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Seed instead of the file's
    #[arg(long, value_name = "K")]
    pub seed: Option<u64>,
    /// Go on from the checkpoint of a stopped training
    #[arg(long)]
    pub resume: bool,
    /// Threads, all processors when not given; the result does not depend on it
    #[arg(long, value_name = "T", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
}

/// Arguments of `status`, `merge` and `report`.
#[derive(Debug, Args)]
pub struct FolderArgs {
    /// Folder that `run` wrote, or a folder of such folders
    #[arg(value_name = "DIR")]
    pub folder: PathBuf,
    /// Write JSON to a file, or to standard output for -
    #[arg(long, value_name = "FILE|-")]
    pub json: Option<PathBuf>,
}

/// Arguments of `report`.
#[derive(Debug, Args)]
pub struct ReportArgs {
    /// Folder that `run` wrote, or a folder of such folders
    #[arg(value_name = "DIR")]
    pub folder: PathBuf,
    /// Write every plot as an SVG file into a folder
    #[arg(long, value_name = "DIR")]
    pub svg: Option<PathBuf>,
    /// Write every table of statistics as a LaTeX file into a folder
    #[arg(long, value_name = "DIR")]
    pub latex: Option<PathBuf>,
    /// Put the tables into a page in Markdown: over the section with the folder's name, else at its end
    #[arg(long, value_name = "FILE.md")]
    pub docs: Option<PathBuf>,
    /// Write JSON to a file, or to standard output for -
    #[arg(long, value_name = "FILE|-")]
    pub json: Option<PathBuf>,
}
