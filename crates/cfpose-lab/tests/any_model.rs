//! The scenario of every model: its truth maps the source to the target, its parameters do what they say, its metrics reach the results.

use cfpose::entry::{EntryError, find};
use cfpose::{BuildContext, Points, Registry};
use cfpose_lab::{Determined, Experiment, Lab, RunOptions, Scenario, Trial, run, scenarios, seed};

const MODELS: [&str; 15] = [
    "gain1",
    "rigid2",
    "rigid3",
    "similarity2",
    "similarity3",
    "affine2",
    "affine3",
    "polynomial2",
    "thin-plate2",
    "bearing3",
    "camera3",
    "plane-bearing",
    "plane-homography",
    "homography",
    "epipolar",
];

fn scenario(parameters: &str) -> Result<Box<dyn Scenario>, EntryError> {
    let (entry, parameters) = find("scenario", scenarios::ALL, &format!("any-model[{parameters}]"))?;
    (entry.build)(&parameters)
}

fn trial(scenario: &dyn Scenario, stream: u64) -> Trial {
    scenario.trial(&mut seed::data_stream(7, stream)).unwrap()
}

/// Return the miss of a theta under the scenario's own metrics.
fn miss(scenario: &dyn Scenario, trial: &Trial, theta: &[f64]) -> (f64, bool) {
    let registry = Registry::default();
    let layout = registry.model(scenario.model(), &BuildContext::default()).unwrap().layout;
    let score = scenario.score(&layout, theta, &trial.truth, trial).unwrap();
    (*score.values.last().unwrap(), scenario.succeeds(&score, trial))
}

fn size(points: &Points) -> f64 {
    let covariance = points.covariance();
    (covariance[0][0] + covariance[1][1] + covariance[2][2]).sqrt()
}

/// The model's own residual, feature means of the image under the truth against those of the target, vanishes at the truth of exact
/// data and nowhere near it.
#[test]
fn the_truth_of_every_model_explains_exact_data() {
    use cfpose::{Estimator, Execution, Settings};
    let registry = Registry::default();
    for model in MODELS {
        let scenario = scenario(&format!("model={model},points=200,spread=0.1,start=0.02")).unwrap();
        for stream in 0..3 {
            let trial = trial(scenario.as_ref(), stream);
            assert_eq!((trial.source.len(), trial.target.len()), (200, 200));
            let settings = Settings::preset("paper", model).unwrap();
            let features = registry.model(model, &BuildContext::default()).unwrap().basin.features;
            let settings = settings.features(features);
            let estimator =
                Estimator::new(&registry, &settings, &trial.source, &trial.target, &Execution::default()).unwrap();
            let cost = |theta: &[f64]| estimator.problem().try_evaluate(theta).unwrap().cost;
            let (at_truth, at_start) = (cost(&trial.truth), cost(trial.start.as_ref().unwrap()));
            // Two views of a scene with depth agree in the epipolar angle of each point: exact too.
            assert!(at_truth < 1e-20 && at_start > 1e-12, "{model}: {at_truth:e}, {at_start:e}");
            let (none, success) = miss(scenario.as_ref(), &trial, &trial.truth);
            assert!(none < 1e-12 && success, "{model}: {none:e}");
            for other in &trial.equally_true {
                assert!(cost(other) < 1e-20, "{model}");
            }
            assert_eq!(trial.determined == Determined::OneOfSeveral, model == "plane-homography");
        }
    }
}

#[test]
fn offsets_move_both_sides_and_the_truth() {
    for model in ["rigid2", "rigid3", "similarity2", "similarity3", "affine2", "affine3", "bearing3"] {
        let [near, far] =
            ["0", "1e4"].map(|offset| scenario(&format!("model={model},points=100,offset={offset}")).unwrap());
        let trial = trial(far.as_ref(), 1);
        assert!((trial.source.mean()[0] - 1e4).abs() < 2.0);
        assert_eq!((trial.target.mean()[0] - 1e4).abs() < 10.0, model != "bearing3");
        let (none, success) = miss(far.as_ref(), &trial, &trial.truth);
        assert!(none < 1e-9 && success, "{model} {none:e}");
        // The same map of the same shape: thetas differ by the offset alone.
        let same = self::trial(near.as_ref(), 1);
        let shifted = |points: &Points, d: usize| points.column(d).iter().map(|x| x - 1e4).collect::<Vec<f64>>();
        let worst =
            shifted(&trial.source, 0).iter().zip(same.source.column(0)).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(worst < 1e-10, "{model} {worst:e}");
    }
    for model in ["homography", "thin-plate2", "epipolar", "plane-bearing"] {
        let words = scenario(&format!("model={model},offset=10")).err().unwrap().to_string();
        assert!(words.contains("only 0 is possible"), "{words}");
    }
}

#[test]
fn parameters_do_what_they_say() {
    let of = |text: &str| trial(scenario(text).unwrap().as_ref(), 3);
    let plain = of("points=1000");
    assert_eq!(of("points=1000,hidden=0.3").target.len(), 700);
    assert_eq!(of("points=1000,hidden_source=0.2").source.len(), 800);
    assert_eq!(of("points=1000,hidden=0.5,clutter=0.2").target.len(), 600);
    assert!(plain.start.is_none() && of("start=identity").start.is_some() && of("start=0.1").start.is_some());
    // Noise on a side, in sizes of that side. Both orders are drawn before the noise of the target.
    let noisy = of("points=1000,noise=0.01");
    assert_eq!(noisy.source, plain.source);
    let rms = |a: &Points, b: &Points| {
        let squares =
            (0..3).flat_map(|d| a.column(d).iter().zip(b.column(d))).map(|(x, y)| (x - y).powi(2)).sum::<f64>();
        (squares / (3 * a.len()) as f64).sqrt()
    };
    let source_noisy = of("points=1000,noise=0.01,noise_on=source");
    let ratio = rms(&source_noisy.source, &plain.source) / size(&plain.source);
    assert!((ratio - 0.01).abs() < 1e-3, "{ratio}");
    // With a density that varies the middle of the target moves to the dense side by much more than chance.
    let shape = "shape=5,points=4000,sampling=independent,spread=0";
    let (even, varied) = (of(shape), of(&format!("{shape},density=varied")));
    assert!(varied.target.mean()[0] > even.target.mean()[0] + 0.1, "{:?}", varied.target.mean());
    // Full rotations reach the other side, near ones do not.
    let trace = |t: &Trial| t.truth[0] + t.truth[4] + t.truth[8];
    let [full, near] = ["full", "near"].map(|rotation| scenario(&format!("rotation={rotation},points=20")).unwrap());
    assert!((0..20).any(|k| trace(&trial(full.as_ref(), k)) < 0.0));
    assert!((0..20).all(|k| trace(&trial(near.as_ref(), k)) > 1.5));
    assert!(scenario("model=rigid33").err().unwrap().to_string().contains("did you mean rigid3"));
    assert!(scenario("model=affine2,shape=hart").err().unwrap().to_string().contains("did you mean heart"));
}

#[test]
fn metrics_reach_records_summaries_and_tables() {
    let text = "trials = 2\n[[scenario]]\nname = \"any-model\"\nmodel = [\"homography\", \"rigid2\"]\npoints = 200\nspread = 0.05\n\
                start = 0.02\n[[method]]\nname = \"m\"\npreset = \"paper\"\nfeatures = \"hermite[degree=4]\"\n";
    let lab = Lab::default();
    let experiment = Experiment::parse(&lab, text, "m.toml").unwrap();
    let folder = tempfile::tempdir().unwrap();
    let merged = run(&lab, &experiment, &RunOptions::new(folder.path())).unwrap().merged.unwrap();
    let [plane, rigid] = &merged.rows[..] else { panic!("{} rows", merged.rows.len()) };
    assert_eq!((plane.successes, rigid.successes), (2, 2));
    let names = |row: &cfpose_lab::SummaryRow| row.metrics.iter().map(|metric| metric.name).collect::<Vec<_>>();
    assert_eq!(names(plane), ["transfer"]);
    assert_eq!(names(rigid), ["rotation_deg", "translation", "error", "transfer"]);
    // A scenario without a pose has its first metric as `error`.
    assert!(plane.median_rotation_deg.is_none() && plane.median_error == plane.metrics[0].median);
    assert!(rigid.median_rotation_deg.is_some() && rigid.metrics[3].median.is_some());
    let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap();
    let csv = read("results.csv");
    assert!(csv.lines().next().unwrap().ends_with(",isa,transfer"), "{csv}");
    assert!(read("tables.md").contains("median transfer (sizes)"));
    assert!(read("summary.json").contains("\"smaller_is_better\": true"));
}
