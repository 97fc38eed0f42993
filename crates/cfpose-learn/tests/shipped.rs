//! The weights that ship: where they come from, which targets they serve, and that they widen the basin on shapes never seen.

use std::path::Path;
use std::process::Command;

use cfpose::entry::find;
use cfpose::families::learned::Weights;
use cfpose::{Estimator, Execution, Registry, Settings, Supervision};
use cfpose_lab::seed::data_stream;
use cfpose_lab::{Trial, nearest_truth, scenarios};

fn root() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))
}

#[test]
fn weights_that_ship_are_small_and_say_how_they_were_trained() {
    let folder = root().join("crates/cfpose/weights");
    let mut names: Vec<String> = Vec::new();
    for entry in std::fs::read_dir(&folder).unwrap() {
        let path = entry.unwrap().path();
        let bytes = std::fs::read(&path).unwrap();
        let weights = Weights::from_bytes(&bytes).unwrap();
        let name = path.file_stem().unwrap().to_str().unwrap().to_string();
        let training = std::fs::read_to_string(root().join(format!("experiments/learn/{name}.toml"))).unwrap();
        assert!(bytes.len() < 100_000 && weights.notes["training"] == training, "{name}");
        assert!(name.contains(&format!("-{}", weights.dim)) && weights.to_bytes() == bytes, "{name}");
        names.push(name);
    }
    names.sort();
    assert_eq!(names, ["frequencies-2", "frequencies-3", "linear-2", "linear-3", "linear-3-solid"]);
}

/// Draw a trial of a scenario.
fn trial(spec: &str, stream: u64) -> (Box<dyn cfpose_lab::Scenario>, Trial) {
    let (entry, parameters) = find("scenario", scenarios::ALL, spec).unwrap();
    let scenario = (entry.build)(&parameters).unwrap();
    let trial = scenario.trial(&mut data_stream(77, stream)).unwrap();
    (scenario, trial)
}

/// Solve the printed method with other features; say whether it is a success.
fn succeeds(features: &str, spec: &str, stream: u64) -> bool {
    let (scenario, trial) = trial(spec, stream);
    let settings = Settings::preset("paper", scenario.model()).unwrap().features(features);
    let settings = settings.start_at(trial.start.clone().unwrap());
    let registry = Registry::default();
    let estimator = Estimator::new(&registry, &settings, &trial.source, &trial.target, &Execution::default()).unwrap();
    let estimate = estimator.solve(Supervision::default()).unwrap();
    let layout = &estimator.model().layout;
    let error = nearest_truth(scenario.as_ref(), layout, &estimate.theta, &trial).unwrap().0;
    estimate.usable() && trial.success.holds(&error)
}

#[test]
fn rays_of_a_plane_and_bodies_get_their_own_matrices() {
    for stream in 0..20 {
        for (spec, expected) in [
            (format!("planar-curve[curve=fourier[seed={}],theta=random]", 9100 + stream), 18),
            (format!("cloud3[shape={}]", 9100 + stream), 34),
        ] {
            let (scenario, trial) = trial(&spec, stream);
            let settings = Settings::preset("paper", scenario.model()).unwrap().features("learned");
            let registry = Registry::default();
            let estimator =
                Estimator::new(&registry, &settings, &trial.source, &trial.target, &Execution::default()).unwrap();
            assert_eq!(estimator.problem().num_features(), expected, "{spec}");
        }
    }
}

#[test]
fn learned_features_widen_the_basin_on_shapes_never_seen() {
    // Success of one start; pooled figures over many more trials stand in docs/learned.md.
    let count = |features: &str, specs: &[String]| -> usize {
        specs.iter().map(|spec| (0..8).filter(|stream| succeeds(features, spec, *stream)).count()).sum()
    };
    let curves: Vec<String> = ["heart", "flower", "fish", "fourier[seed=9101]", "fourier[seed=9102]"]
        .map(|curve| format!("planar-curve[curve={curve},b_i=0.35]"))
        .into();
    let (learned, printed) = (count("learned", &curves), count("trig18", &curves));
    assert!(learned >= printed + 8 && learned >= 30, "{learned} and {printed} of 40");
    let waves = count("learned[kind=frequencies]", &curves);
    assert!(waves >= printed, "{waves} and {printed} of 40");
    let bodies: Vec<String> =
        (9101..9105).map(|seed| format!("cloud3[shape={seed},sampling=independent,start=60]")).collect();
    let (learned, hermite) = (count("learned", &bodies), count("hermite[degree=3]", &bodies));
    assert!(learned >= hermite + 8, "{learned} and {hermite} of 32");
}

#[test]
fn the_python_example_writes_weights() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("w.safetensors");
    let run = Command::new("python3").arg(root().join("examples/write_weights.py")).arg(&file).status();
    // Without an interpreter there is nothing to be checked.
    let Ok(status) = run else { return };
    assert!(status.success());
    let weights = Weights::from_bytes(&std::fs::read(&file).unwrap()).unwrap();
    assert_eq!((weights.dim, weights.notes["seed"].as_str()), (2, "none"));
}
