//! Golden thetas: every scenario, preset, model and weighting gives the answer that it gave before.
//!
//! `tests/golden/thetas.json` holds the answers by instruction set. On `baseline` the bits are compared, on the others a
//! relative 3e-8 with their own record. The machine's own mathematics (linear algebra that dispatches by processor, the C
//! library's sine) is part of the bits: where the widest instruction set is not the recorded one, baseline is compared to
//! 3e-8 too, a set without a record to 1e-6 with the widest recorded one, and the test says so. `CFPOSE_GOLDEN=write cargo test -p cfpose-lab --test golden` records anew; a change of this file is a
//! commit of its own, and the changelog says which thetas moved and why.

use std::collections::BTreeMap;
use std::path::PathBuf;

use cfpose::model::PointKind;
use cfpose::{BuildContext, Execution, Isa, Model, Points, Pose, Registry, Settings, Start, estimate};
use cfpose_lab::method::Method;
use cfpose_lab::scenarios;
use cfpose_lab::seed::{data_stream, method_seed};
use cfpose_optim::manifold::Manifold;
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha12Rng;
use serde::{Deserialize, Serialize};

/// Scenarios with the parameters that lead through different parts of the estimator.
const SCENARIOS: &[&str] = &[
    "planar-curve[b_i=0.1,b_p=0.01]",
    "planar-curve[curve=flower,b_i=0.2,b_p=0.02]",
    "planar-curve[curve=fish,b_i=0.5,b_p=0.02]",
    "planar-curve[curve=butterfly,start=none,theta=anywhere,b_p=0.01]",
    "planar-curve[curve=blob,b_i=0.1,b_m=1]",
    "planar-curve[b_i=0.1,b_p=0.02,outliers=150]",
    "planar-curve[b_i=0.1,b_p=0.01,order=shuffled,uniform_outliers=300]",
    "cloud3[points=600]",
    "cloud3[points=600,sampling=independent,noise=0.005]",
    "cloud3[points=600,noise=0.005,clutter=0.3]",
    "cloud3[points=600,sampling=independent,overlap=0.7]",
];

/// Models with parameters, beside the defaults of all.
const VARIANTS: &[&str] = &[
    "bearing3[relation=plane]",
    "plane-bearing[relation=plane,area=on]",
    "plane-homography[relation=plane]",
    "homography[relation=plane,area=on]",
    "polynomial2[degree=3]",
    "thin-plate2[grid=2,area=on]",
    "epipolar[norm=penalty]",
];

/// One answer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Golden {
    case: String,
    theta: Vec<f64>,
    verdict: Option<String>,
    /// Message of an estimate that could not be made.
    error: Option<String>,
}

/// The file.
#[derive(Default, Serialize, Deserialize)]
struct Record {
    /// Widest instruction set of the machine that recorded the bits.
    widest: String,
    /// The answers by instruction set.
    golden: BTreeMap<String, Vec<Golden>>,
}

fn path() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/golden/thetas.json")
}

fn answer(case: String, settings: &Settings, source: &Points, target: &Points, isa: Isa) -> Golden {
    let execution = Execution { isa, pool: None };
    match estimate(&Registry::default(), settings, source, target, &execution) {
        Ok(found) => {
            Golden { case, theta: found.theta, verdict: found.verdict.map(|v| v.name().to_string()), error: None }
        }
        Err(error) => Golden { case, theta: Vec::new(), verdict: None, error: Some(error.to_string()) },
    }
}

/// A set without symmetry, coordinates within about -0.5..0.5. The data of the golden cases are drawn here and nowhere else: what
/// other tests share may change.
fn asymmetric(kind: PointKind, count: usize, rng: &mut ChaCha12Rng) -> Points {
    let rows: Vec<[f64; 3]> = (0..count)
        .map(|_| {
            let (u, v, w): (f64, f64, f64) = (rng.random(), rng.random(), rng.random());
            let y = v * v * (0.4 + 0.6 * u);
            [u * (0.6 + 0.4 * v) - 0.4, y - 0.2, 0.8 * w * w * (0.3 + u) + 0.3 * u * y - 0.2]
        })
        .collect();
    let points = match kind {
        PointKind::Plain(1) => Points::from_columns(vec![rows.iter().map(|p| p[0]).collect()]),
        PointKind::Plain(2) => Points::from_rows(&rows.iter().map(|p| [p[0], p[1]]).collect::<Vec<_>>()),
        PointKind::Plain(_) => Points::from_rows(&rows),
        PointKind::Homogeneous => Points::from_rows(&rows.iter().map(|p| [p[0], p[1], 1.0]).collect::<Vec<_>>()),
    };
    points.unwrap()
}

/// Return the target of a source at theta in another order, without noise.
fn target_of(model: &Model, theta: &[f64], source: &Points, rng: &mut ChaCha12Rng) -> Points {
    let image = if model.target.is_moving() {
        let pose = Pose::of_theta(&model.layout, theta).unwrap();
        let depths: Vec<f64> = (0..source.len()).map(|_| 2.0 + 3.0 * rng.random::<f64>()).collect();
        let seen = |(k, depth): (usize, &f64)| pose.apply(source.point(k).map(|value| depth * value));
        Points::from_rows(&depths.iter().enumerate().map(seen).collect::<Vec<_>>()).unwrap()
    } else {
        let lifted = model.source.lift(source);
        cfpose::problem::map_points(model.source.as_ref(), &lifted, theta, &Execution::default()).unwrap()
    };
    let mut order: Vec<usize> = (0..image.len()).collect();
    order.shuffle(rng);
    image.select(&order).unwrap()
}

/// Return the theta one random tangent step of a given norm away.
fn moved(model: &Model, theta: &[f64], distance: f64, rng: &mut ChaCha12Rng) -> Vec<f64> {
    let manifold = model.layout.manifold();
    let step: Vec<f64> = (0..manifold.tangent()).map(|_| rng.random::<f64>() - 0.5).collect();
    let norm = step.iter().map(|value| value * value).sum::<f64>().sqrt();
    let step: Vec<f64> = step.iter().map(|value| value * distance / norm).collect();
    let mut out = vec![0.0; theta.len()];
    manifold.retract(theta, &step, &mut out);
    out
}

/// Every model with every preset, from a start and without one; the weightings on two of them.
fn of_models(isa: Isa) -> Vec<Golden> {
    let registry = Registry::default();
    let mut all = Vec::new();
    for spec in registry.models.iter().map(|entry| entry.name).chain(VARIANTS.iter().copied()) {
        let mut rng = ChaCha12Rng::seed_from_u64(20);
        let kind = registry.model(spec, &BuildContext::default()).unwrap().source_points;
        let source = asymmetric(kind, 250, &mut rng);
        let context = BuildContext { source: Some(&source), ..BuildContext::default() };
        let model = registry.model(spec, &context).unwrap();
        let truth = moved(&model, &model.typical, 0.1, &mut rng);
        let target = target_of(&model, &truth, &source, &mut rng);
        let near = Start::Given(vec![moved(&model, &truth, 0.5 * model.basin.distance, &mut rng)]);
        for preset in cfpose::estimator::PRESETS {
            let preset_settings = Settings::preset(preset, spec).unwrap();
            let features = (*preset == "paper").then(|| model.basin.features.to_string());
            let from = |start: Option<Start>| Settings { features: features.clone(), start, ..preset_settings.clone() };
            let begun = from(Some(near.clone()));
            all.push(answer(format!("{spec} {preset} near"), &begun, &source, &target, isa));
            let alone = from(None);
            all.push(answer(format!("{spec} {preset} alone"), &alone, &source, &target, isa));
        }
        if ["rigid3", "plane-bearing"].contains(&spec) {
            for weighting in registry.weightings.iter().map(|entry| entry.name) {
                let settings = Settings {
                    features: Some("hermite[degree=3]".to_string()),
                    weighting: Some(weighting.to_string()),
                    start: Some(near.clone()),
                    ..Settings::preset("paper", spec).unwrap()
                };
                all.push(answer(format!("{spec} {weighting}"), &settings, &source, &target, isa));
            }
        }
    }
    all
}

/// Every scenario with both presets.
fn of_scenarios(isa: Isa) -> Vec<Golden> {
    let mut all = Vec::new();
    for spec in SCENARIOS {
        let (entry, parameters) = cfpose::entry::find("scenario", scenarios::ALL, spec).unwrap();
        let scenario = (entry.build)(&parameters).unwrap();
        for key in 1..=2 {
            let trial = scenario.trial(&mut data_stream(7, key)).unwrap();
            for preset in cfpose::estimator::PRESETS {
                let method = Method::of_preset(preset);
                let seed = method_seed(7, key);
                let settings = method.settings(scenario.model(), trial.start.as_deref(), seed).unwrap();
                let case = format!("{spec} {preset} {key}");
                all.push(answer(case, &settings, &trial.source, &trial.target, isa));
            }
        }
    }
    all
}

/// Say how two answers differ, `None` where they agree to a relative tolerance (0: the bits).
fn difference(golden: &Golden, found: &Golden, tolerance: f64) -> Option<String> {
    let size = golden.theta.iter().fold(0.0_f64, |size, value| size.max(value.abs())).max(1e-300);
    let pairs = golden.theta.iter().zip(&found.theta);
    let worst = pairs.map(|(a, b)| (a - b).abs() / size).fold(0.0, f64::max);
    let bits = |theta: &[f64]| theta.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
    let same = match tolerance {
        0.0 => bits(&golden.theta) == bits(&found.theta),
        _ => golden.theta.len() == found.theta.len() && worst <= tolerance,
    };
    let rest = (&golden.case, &golden.verdict, &golden.error) == (&found.case, &found.verdict, &found.error);
    if same && rest {
        return None;
    }
    let (was, is) = ((&golden.verdict, &golden.error), (&found.verdict, &found.error));
    Some(format!("{}: theta moved by {worst:.1e}, {was:?} became {is:?}", found.case))
}

fn answers(isa: Isa) -> Vec<Golden> {
    of_models(isa).into_iter().chain(of_scenarios(isa)).collect()
}

/// Compare the answers on an instruction set with its record; returns where they differ.
fn differences(record: &Record, isa: Isa) -> Vec<String> {
    let here = Isa::detect().name();
    let (known, tolerance) = match record.golden.get(isa.name()) {
        Some(known) if isa == Isa::baseline() && record.widest == here => (known, 0.0),
        Some(known) => (known, 3e-8),
        None => {
            eprintln!("NOTE: nothing is recorded on {}; compared with {} to 1e-6", isa.name(), record.widest);
            (&record.golden[&record.widest], 1e-6)
        }
    };
    if isa == Isa::baseline() && tolerance > 0.0 {
        eprintln!(
            "NOTE: bits were recorded where {} is the widest set, here it is {here}: compared to 3e-8",
            record.widest
        );
    }
    let found = answers(isa);
    assert_eq!(known.len(), found.len(), "the cases are others");
    known.iter().zip(&found).filter_map(|(golden, found)| difference(golden, found, tolerance)).collect()
}

#[test]
fn golden_thetas_are_what_they_were() {
    let sets = [Isa::baseline(), Isa::detect()];
    if std::env::var_os("CFPOSE_GOLDEN").is_some_and(|value| value == "write") {
        // Narrower sets, too: this machine is not the only one that compares.
        let golden = Isa::available().into_iter().map(|isa| (isa.name().to_string(), answers(isa))).collect();
        let record = Record { widest: Isa::detect().name().to_string(), golden };
        std::fs::write(path(), serde_json::to_string_pretty(&record).unwrap() + "\n").unwrap();
        return;
    }
    let record: Record = serde_json::from_str(&std::fs::read_to_string(path()).unwrap()).unwrap();
    for isa in sets {
        let failures = differences(&record, isa);
        assert!(failures.is_empty(), "{}: {} differ:\n{}", isa.name(), failures.len(), failures.join("\n"));
    }
}
