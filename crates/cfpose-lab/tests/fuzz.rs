//! Damaged experiments, pipelines and records: no panic, no hang, a message.
//!
//! `CFPOSE_FUZZ_CASES=1000000` for a long run; point files, masks, poses and cameras are damaged by the test of the same name in
//! `cfpose-vision`.

use std::time::Instant;

use cfpose::estimator::Pipeline;
use cfpose::{Estimator, Execution, Points, Registry, Settings};
use cfpose_lab::folder::read_records;
use cfpose_lab::{Experiment, Lab, Plan, Record, RunOptions, run};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha12Rng;

const EXPERIMENTS: [&str; 3] = [
    "seed = 1\ntrials = 3\ndeadline_secs = 60\npublished = [{ table = \"I\", b_i = 0.1, success = 100 }]\n[[scenario]]\nname = \"planar-curve\"\n\
     curve = [\"heart\", \"fourier[seed=3]\"]\nb_i = [0.1, 0.2]\ntrials = 2\n[[method]]\nname = \"paper\"\npreset = \"paper\"\n",
    "[[scenario]]\nname = \"cloud3[noise=0.01]\"\npoints = [40, 70]\nshape = 3\n[[method]]\nname = \"mine\"\nfeatures = \"2*hermite[degree=3] + fourier[k=2]\"\n\
     solver = \"multi-start[solver=levenberg-marquardt[damping=nielsen],starts=3]\"\nstart = \"grid[count=4]\"\nmax_evaluations = 12\n",
    "trials = 2\n[[scenario]]\nname = \"planar-curve\"\ntheta = \"0.1 -0.15 0.2 0.1 -0.1 0.15\"\n[[method]]\nname = \"a\"\nnormalise = \"whiten\"\nweighting = \"two-step\"\n",
];

const PIPELINES: [&str; 2] = [
    "restarts = 2\nglobal_start = \"grid[count=12]\"\nkeep = 3\n[[stage]]\nname = \"waves\"\nfeatures = \"fourier[k=2,w0=1.2]\"\niterations = 20\nsource_points = 30\n\
     [[stage]]\nname = \"last\"\nfeatures = \"hermite[degree=3]\"\nweighting = \"two-step\"\nnoise = \"isotropic\"\n",
    "[[stage]]\nname = \"only\"\nfeatures = \"trig18\"\n",
];

/// Words that a careless hand may write.
const WORDS: [&str; 22] = [
    "-1",
    "0",
    "1e400",
    "nan",
    "inf",
    "18446744073709551616",
    "99999999",
    "\"\"",
    "[]",
    "[[",
    "]",
    "=",
    "\n",
    "#",
    "'",
    "true",
    "1979-05-27",
    "fourier[k=8]",
    "orthonormalised[basis=rbf[count=9]]",
    "\u{0}",
    "\u{e9}",
    "seed = 1\n",
];

/// Change one place.
fn damage(text: &mut Vec<u8>, rng: &mut ChaCha12Rng) {
    if text.is_empty() {
        return;
    }
    let at = rng.random_range(0..text.len());
    let end = (at + rng.random_range(1..12)).min(text.len());
    match rng.random_range(0..6) {
        0 => text[at] = rng.random_range(0..=255_u32) as u8,
        1 => text.insert(at, rng.random_range(32..127_u32) as u8),
        2 => drop(text.drain(at..end)),
        3 => text.truncate(at),
        4 => {
            let copy = text[at..end].to_vec();
            text.splice(at..at, copy);
        }
        _ => {
            let stop = text[at..].iter().position(|b| b" \n,]".contains(b)).map_or(text.len(), |stop| at + stop);
            text.splice(at..stop, WORDS[rng.random_range(0..WORDS.len())].bytes());
        }
    }
}

/// A message quotes names as they stand; the program brings it onto one line.
fn told(message: &str) {
    assert!(!message.trim().is_empty() && message.len() < 4000, "{message:?}");
}

#[test]
fn damaged_experiments_pipelines_and_records_end_with_a_message() {
    let cases: usize = std::env::var("CFPOSE_FUZZ_CASES").ok().and_then(|text| text.parse().ok()).unwrap_or(9_000);
    let (lab, registry, mut rng) = (Lab::default(), Registry::default(), ChaCha12Rng::seed_from_u64(1));
    let folder = tempfile::tempdir().unwrap();
    let small = "trials = 2\n[[scenario]]\nname = \"cloud3\"\npoints = 30\n[[method]]\nname = \"paper\"\n";
    run(&lab, &Experiment::parse(&lab, small, "e").unwrap(), &RunOptions::new(folder.path())).unwrap();
    let records = std::fs::read(folder.path().join("trials.jsonl")).unwrap();
    let place = folder.path().join("damaged.jsonl");
    let value = |k: usize, d: usize| ((k * (37 + 11 * d) + 5) % 61) as f64 / 61.0;
    let points = Points::from_columns((0..3).map(|d| (0..40).map(|k| value(k, d)).collect()).collect()).unwrap();
    let (mut slowest, mut whole) = ((0.0_f64, String::new()), [0_usize; 3]);
    for case in 0..cases {
        let begun;
        let shown;
        match case % 3 {
            0 => {
                let mut text = EXPERIMENTS[case / 3 % EXPERIMENTS.len()].as_bytes().to_vec();
                (0..rng.random_range(1..4)).for_each(|_| damage(&mut text, &mut rng));
                let text = String::from_utf8_lossy(&text).into_owned();
                begun = Instant::now();
                match Experiment::parse(&lab, &text, "e.toml") {
                    Ok(experiment) => {
                        whole[0] += 1;
                        // What was read is written and read again as the same.
                        let again = Experiment::parse(&lab, &experiment.to_toml(), "again").unwrap();
                        assert_eq!(again.fingerprint(), experiment.fingerprint(), "{text}");
                        if experiment.cells().iter().map(|cell| cell.trials.min(1 << 40)).sum::<usize>() < 10_000 {
                            Plan::new(&lab, &experiment).unwrap();
                        }
                    }
                    Err(error) => told(&error.to_string()),
                }
                shown = text;
            }
            1 => {
                let mut text = PIPELINES[case / 3 % PIPELINES.len()].as_bytes().to_vec();
                (0..rng.random_range(1..4)).for_each(|_| damage(&mut text, &mut rng));
                let text = String::from_utf8_lossy(&text).into_owned();
                begun = Instant::now();
                if let Ok(pipeline) = toml::from_str::<Pipeline>(&text)
                    && !pipeline.stages.is_empty()
                {
                    whole[1] += 1;
                    let settings = Settings::preset("auto", "rigid3").unwrap().pipeline(pipeline);
                    if let Err(error) = Estimator::new(&registry, &settings, &points, &points, &Execution::default()) {
                        told(&error.to_string());
                    }
                }
                shown = text;
            }
            _ => {
                let mut bytes = records.clone();
                (0..rng.random_range(1..4)).for_each(|_| damage(&mut bytes, &mut rng));
                std::fs::write(&place, &bytes).unwrap();
                begun = Instant::now();
                match read_records(&place) {
                    // A change that leaves a record is seen by its checksum, or is none.
                    Ok(found) => {
                        whole[2] += 1;
                        // One that lost its version stands beside others that have theirs, which is refused.
                        let whole = |record: &Record| record.is_whole() && !record.version.is_empty();
                        for (_, record) in found.iter().filter(|(_, record)| whole(record)) {
                            let line = serde_json::to_string(record).unwrap();
                            assert!(String::from_utf8_lossy(&records).contains(&line), "{line}");
                        }
                    }
                    Err(error) => told(&error.to_string()),
                }
                shown = String::from_utf8_lossy(&bytes).into_owned();
            }
        }
        let seconds = begun.elapsed().as_secs_f64();
        if seconds > slowest.0 {
            slowest = (seconds, shown);
        }
    }
    println!("{cases} damaged inputs, {whole:?} still whole; the slowest took {:.3} s", slowest.0);
    assert!(slowest.0 < 1.0, "{} s: {}", slowest.0, slowest.1);
    assert!(whole.iter().all(|count| *count > 0), "{whole:?}");
}
