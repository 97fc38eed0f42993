//! Training as a whole: the same bits at any number of threads and after a stop, every kind and optimiser, mistakes in words.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use cfpose::families::learned::{Architecture, Weights};
use cfpose_lab::Lab;
use cfpose_learn::{Config, LearnError, Options, Progress, train};

/// A training of a second: small clouds, few states.
fn small(kind: &str, optimiser: &str) -> String {
    format!(
        r#"
kind = "{kind}"
basis = "hermite[degree=3]"
features = 10
seed = 3
[sampling]
trials = 8
states = 6
validation-trials = 4
rounds = 2
round-trials = 2
paths = 2
[training]
optimiser = "{optimiser}"
steps = 30
batch = 32
look = 10
[[objective]]
name = "contraction"
[[objective]]
name = "star-convexity"
weight = 0.3
[[data]]
scenario = "cloud3"
shape = "{{seed}}"
points = 60
noise = [0, 0.01]
"#
    )
}

/// Train on a number of threads; `watch` may raise the flag.
fn run(
    text: &str,
    folder: &Path,
    threads: usize,
    resume: bool,
    mut watch: impl FnMut(Progress, &AtomicBool) + Send,
) -> Result<Weights, LearnError> {
    let lab = Lab::default();
    let config = Config::parse(&lab, text, "test.toml")?;
    let (flag, checkpoint) = (AtomicBool::new(false), folder.join("w.checkpoint"));
    let mut seen = |progress| watch(progress, &flag);
    let options = Options { checkpoint: &checkpoint, resume, cancel: Some(&flag), watch: &mut seen };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    pool.install(|| train(&lab, &config, options))
}

#[test]
fn the_same_bits_on_any_number_of_threads_and_after_a_stop() {
    let folder = tempfile::tempdir().unwrap();
    for text in [small("linear", "adam"), small("linear", "adam").replace("seed = 3", "seed = 3\nridge = 0.01")] {
        let one = run(&text, folder.path(), 1, false, |_, _| {}).unwrap().to_bytes();
        let two = run(&text, folder.path(), 2, false, |_, _| {}).unwrap().to_bytes();
        assert!(one == two, "one thread and two");
        // Stopped in the middle of the second round, and gone on.
        let stop = |p: Progress, flag: &AtomicBool| {
            if p.round == 1 && p.step == 20 {
                flag.store(true, Ordering::Relaxed);
            }
        };
        let stopped = run(&text, folder.path(), 2, false, stop).unwrap_err();
        assert!(stopped.to_string().contains("stopped after round 1; go on with --resume"), "{stopped}");
        let mut rounds = Vec::new();
        let resumed = run(&text, folder.path(), 1, true, |p, _| rounds.push(p.round)).unwrap().to_bytes();
        assert!(one == resumed && !rounds.contains(&0), "{rounds:?}");
        let other = run(&text.replace("seed = 3", "seed = 4"), folder.path(), 2, false, |_, _| {}).unwrap();
        assert!(other.to_bytes() != one);
    }
}

#[test]
fn every_kind_and_optimiser_lowers_the_validation_loss() {
    let folder = tempfile::tempdir().unwrap();
    for (kind, optimiser) in [
        ("linear", "adam"),
        ("linear", "l-bfgs"),
        ("frequencies", "adam"),
        ("perceptron", "adam"),
        ("perceptron", "l-bfgs"),
    ] {
        let mut losses = Vec::new();
        let text = small(kind, optimiser).replace("steps = 30", "steps = 60");
        let weights = run(&text, folder.path(), 2, false, |p, _| losses.push(p.validation)).unwrap();
        let best = losses.iter().copied().fold(f64::INFINITY, f64::min);
        assert!(best < losses[0] - 0.005, "{kind}, {optimiser}: {losses:?}");
        let matches = match &weights.architecture {
            Architecture::Linear { matrix, .. } => kind == "linear" && matrix.rows == 10,
            Architecture::Frequencies { frequencies, .. } => kind == "frequencies" && frequencies.rows == 5,
            Architecture::Perceptron { output, .. } => kind == "perceptron" && output.rows == 10,
        };
        assert!(matches && weights.dim == 3 && weights.notes["training"] == text);
        assert_eq!(Weights::from_bytes(&weights.to_bytes()).unwrap(), weights);
    }
}

#[test]
fn mistakes_in_a_training_file_are_one_line_with_the_place() {
    let lab = Lab::default();
    let good = small("linear", "adam");
    let message = |old: &str, new: &str| {
        let text = good.replace(old, new);
        assert_ne!(text, good, "{old}");
        let text = Config::parse(&lab, &text, "t.toml").err().unwrap().to_string();
        assert_eq!(text.lines().count(), 1, "{text}");
        text
    };
    assert!(message("kind = \"linear\"", "kind = \"linar\"").contains("t.toml: line 2: unknown variant"));
    assert!(message("look = 10", "lok = 10").contains("line 17: unknown field `lok`"));
    let objective = message("\"contraction\"", "\"contracton\"");
    assert!(objective.contains("[[objective]] 1: unknown objective `contracton`; did you mean"), "{objective}");
    assert!(message("\"cloud3\"", "\"cloud4\"").contains("[[data]] 1: unknown scenario `cloud4`"));
    assert!(message("points = 60", "point = 60").contains("point"));
    assert!(
        message("\"{seed}\"", "\"{sed}\"").contains("[[data]] 1: `shape`: `{sed}`: expected {seed} or {low..high}")
    );
    assert!(message("hermite[degree=3]", "hermit[degree=3]").contains("basis: unknown family `hermit`"));
    assert!(message("hermite[degree=3]", "learned").contains("learned functions are no basis"));
    assert!(message("weight = 0.3", "weight = 0").contains("[[objective]] 2: weight = 0: expected a number above 0"));
    assert!(message("batch = 32", "batch = 0").contains("batch = 0: expected a whole number from 1"));
    // What shows only when training begins.
    let folder = tempfile::tempdir().unwrap();
    let fails = |old: &str, new: &str| {
        run(&good.replace(old, new), folder.path(), 1, false, |_, _| {}).unwrap_err().to_string()
    };
    assert!(fails("features = 10", "features = 4").contains("features = 4, and the model has 6 unknowns"));
    assert!(fails("features = 10", "features = 30").contains("varies in 19 directions on these data, and 30 features"));
    let model = fails("points = 60", "points = 60\nmodel = \"rigid2\"");
    assert!(model.contains("cloud3: no trial in 20 draws"), "{model}");
    std::fs::write(folder.path().join("w.checkpoint"), "x").unwrap();
    let damaged = run(&good, folder.path(), 1, true, |_, _| {}).unwrap_err().to_string();
    assert!(damaged.contains("is no checkpoint"), "{damaged}");
}
