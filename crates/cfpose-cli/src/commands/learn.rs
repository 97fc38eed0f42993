//! `cfpose learn`: train weights of the family `learned`.

use std::path::{Path, PathBuf};
use std::time::Instant;

use cfpose_lab::Lab;
use cfpose_learn::{Config, LearnError, Options, Progress, train};

use crate::args::LearnArgs;
use crate::failure::{Failure, Kind};
use crate::signals::Signals;
use crate::{inputs, output};

/// Run the command.
///
/// # Errors
/// [`Failure`] of the training file, of what its scenarios draw, of the output; a signal.
pub fn run(args: &LearnArgs, lab: &Lab) -> Result<(), Failure> {
    let out = args.out.clone().unwrap_or_else(|| default_file(&args.config));
    let checkpoint = out.with_extension("checkpoint");
    output::keep_apart(std::slice::from_ref(&args.config), &[Some(&out), Some(&checkpoint)])?;
    output::check_writable(Some(&out))?;
    let mut config = Config::load(lab, &args.config)?;
    config.seed = args.seed.unwrap_or(config.seed);
    let threads = inputs::num_threads(args.threads);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    let pool = pool.map_err(|error| Failure::usage(format!("--threads {threads}: {error}; ask for fewer")))?;
    let (signals, begun) = (Signals::watch(), Instant::now());
    let mut watch = |progress: Progress| output::note(&line(&progress, begun.elapsed().as_secs_f64()));
    let options =
        Options { checkpoint: &checkpoint, resume: args.resume, cancel: Some(signals.flag()), watch: &mut watch };
    let weights = pool.install(|| train(lab, &config, options)).map_err(|error| stopped(error, &signals))?;
    let bytes = weights.to_bytes();
    cfpose_learn::write(&out, &bytes)?;
    output::print(&format!(
        "{}: {} bytes, {:.0} s; use it as --features learned[file={}]",
        out.display(),
        bytes.len(),
        begun.elapsed().as_secs_f64(),
        out.display()
    ))
}

/// Return NAME.safetensors for folder/NAME.toml.
fn default_file(config: &Path) -> PathBuf {
    PathBuf::from(config.file_stem().unwrap_or(config.as_os_str())).with_extension("safetensors")
}

/// Write one look at a training.
fn line(p: &Progress, seconds: f64) -> String {
    format!(
        "round {} of {}, step {}: {} states, loss {:.4}, validation {:.4}, {seconds:.0} s",
        p.round, p.rounds, p.step, p.states, p.loss, p.validation
    )
}

/// Give a stop by a signal its exit code.
fn stopped(error: LearnError, signals: &Signals) -> Failure {
    match (&error, signals.caught()) {
        (LearnError::Stopped { .. }, Some((code, _))) => Failure { kind: Kind::Stopped(code), error: error.into() },
        _ => error.into(),
    }
}
