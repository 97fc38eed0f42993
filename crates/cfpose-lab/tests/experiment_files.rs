//! Experiment files: what they may say, and one clear line for everything else.

use cfpose::entry::{Parameters, find};
use cfpose_lab::table::published_tables;
use cfpose_lab::{Experiment, Lab, Plan, scenarios, seed, summarise};

const GOOD: &str = "seed = 1\ntrials = 10\n[[scenario]]\nname = \"planar-curve\"\ncurve = [\"heart\", \"fourier[seed=3]\"]\n\
                    b_i = [0.1, 0.2]\n[[method]]\nname = \"paper\"\npreset = \"paper\"\n";

fn parse(text: &str) -> Result<Experiment, String> {
    Experiment::parse(&Lab::default(), text, "x.toml").map_err(|error| error.to_string())
}

#[test]
fn a_resolved_experiment_reads_back_as_itself() {
    let experiment = parse(GOOD).unwrap();
    let again = parse(&experiment.to_toml()).unwrap();
    assert_eq!(again, experiment);
    assert_eq!(again.fingerprint(), experiment.fingerprint());
    let plan = Plan::new(&Lab::default(), &experiment).unwrap();
    assert_eq!((plan.cells.len(), plan.trials.len(), plan.num_records()), (4, 40, 40));
    assert_eq!(plan.cells[1].parameter("b_i"), Some("0.2"));
    let mut keys: Vec<u64> = plan.trials.iter().map(|trial| trial.key).collect();
    keys.sort_unstable();
    keys.dedup();
    assert_eq!(keys.len(), 40);
    // Values written another way are the same trials; a cell that comes twice counts once.
    let twice = GOOD.replace("[0.1, 0.2]", "[0.10, 0.2, 1e-1]").replace("seed = 1", "seed = 1 # as before");
    assert_eq!(Plan::new(&Lab::default(), &parse(&twice).unwrap()).unwrap().trials, plan.trials);
}

#[test]
fn mistakes_are_named_with_place_and_suggestion() {
    for (from, to, expected) in [
        ("trials", "trails", "top level: unknown key `trails`; did you mean trials?"),
        ("trials = 10", "trials = 0", "`trials` = 0: expected a whole number >= 1"),
        ("trials = 10", "trials = ", "x.toml: line 2:"),
        ("planar-curve", "planar-curv", "[[scenario]] 1: unknown scenario `planar-curv`; did you mean planar-curve?"),
        ("\"heart\"", "\"hart\"", "unknown curve `hart`; did you mean heart?"),
        ("b_i = [", "bi = [", "scenario `planar-curve` has no parameter `bi`"),
        ("[0.1, 0.2]", "[0.1, -0.2]", "parameter `b_i` = `-0.2`: expected a number >= 0"),
        ("[0.1, 0.2]", "[]", "`b_i`: the list is empty"),
        ("[0.1, 0.2]", "0.1\ntheta = \"1 2 3\"", "expected A, B, random, anywhere or six numbers"),
        ("preset = \"paper\"", "presets = \"paper\"", "[[method]] 1: unknown key `presets`; did you mean preset?"),
        ("preset = \"paper\"", "preset = \"papr\"", "method `paper`: unknown preset `papr`"),
        ("preset = \"paper\"", "features = \"hermit\"", "unknown family `hermit`; did you mean hermite?"),
        ("preset = \"paper\"", "solver = \"lm\"", "unknown solver `lm`"),
        ("preset = \"paper\"", "start = \"gird\"", "unknown start `gird`; did you mean grid?"),
        ("preset = \"paper\"", "model = \"gain1\"", "has another theta than the scenario's"),
        (
            "name = \"planar-curve\"",
            "name = \"planar-curve[b_i=0.3]\"",
            "[[scenario]] 1: `b_i` is given twice: in `name` = \"planar-curve[b_i=0.3]\" and again; keep one of them",
        ),
        ("name = \"paper\"", "name = \" \"", "[[method]] 1: `name` is empty; results are told apart by it"),
        ("[[method]]", "[method]", "`method`: write [[method]] above each of them"),
        ("[[method]]", "[[method]]\nname = \"paper\"\n[[method]]", "the name `paper` is used twice"),
    ] {
        let text = GOOD.replacen(from, to, 1);
        let error = parse(&text).unwrap_err();
        assert!(error.contains(expected) && !error.contains('\n'), "{to}: {error}");
    }
    assert!(parse("trials = 1").unwrap_err().contains("there is no [[method]]"));
    let figure = "\n[[published]]\ntable = \"T\"\nb_i = 0.3\nsuccess = 50\n";
    assert!(parse(&format!("{GOOD}{figure}")).unwrap_err().contains("belongs to no cell"));
}

/// A method with everything that is given beside names of parts.
const GIVEN: &str = r#"
[[scenario]]
name = "cloud3"
points = 60
[[method]]
name = "given"
free = ["rz", "translation"]
bounds = { tx = [-0.5, inf], rz = [-1, 1] }
prior = { theta = [0, 0, 0.1, 0, 0, 0], covariance = [[1, 0, 0, 0, 0, 0], [0, 1, 0, 0, 0, 0], [0, 0, 1, 0, 0, 0],
          [0, 0, 0, 1, 0, 0], [0, 0, 0, 0, 1, 0], [0, 0, 0, 0, 0, 1]] }
[method.pipeline]
restarts = 2
[[method.pipeline.stage]]
name = "coarse"
features = "fourier[k=2,w0=1.2,damping=0.4]"
source-points = 40
[[method.pipeline.stage]]
name = "fine"
features = "hermite[degree=3]"
"#;

#[test]
fn stages_bounds_prior_and_free_parameters_are_given_in_the_experiment() {
    let experiment = parse(GIVEN).unwrap();
    assert_eq!(parse(&experiment.to_toml()).unwrap(), experiment, "{}", experiment.to_toml());
    let (lab, method) = (Lab::default(), &experiment.methods[0]);
    let settings = method.resolved(&lab.registry, "rigid3", None, 1).unwrap();
    assert_eq!(settings.free, Some(vec![2, 3, 4, 5]));
    let bounds: Vec<_> = settings.bounds.iter().map(|bound| (bound.column, bound.low, bound.high)).collect();
    assert_eq!(bounds, [(2, -1.0, 1.0), (3, -0.5, f64::INFINITY)]);
    assert_eq!(settings.prior.unwrap().covariance.len(), 36);
    assert_eq!(settings.pipeline.unwrap().stages[0].source_points, 40);
    for (from, to, expected) in [
        ("\"rz\", \"translation\"", "\"yaw\"", "`free`: "),
        ("[\"rz\", \"translation\"]", "\"rz\"", "[[method]] 1: `free`: expected a list of names"),
        ("tx = [-0.5, inf]", "tx = [2, 1]", "`bounds`: tx has no value between 2 and 1"),
        ("tx = [-0.5, inf]", "tx = \"0..1\"", "[[method]] 1: `bounds`: expected NAME = [LOW, HIGH]"),
        ("tx = [-0.5, inf]", "wide = [0, 1]", "`bounds`: "),
        ("theta = [0, 0, 0.1, 0, 0, 0]", "theta = [0, 0]", "`prior`: "),
        ("[0, 0, 0, 0, 0, 1]", "[0, 0, 0, 0, 0, -1]", "`prior`: "),
        ("theta =", "thetas =", "`prior`: expected the name of a JSON file, or a table"),
        ("hermite[", "hermit[", "method `given`: `pipeline`: stage `fine`: unknown family `hermit`"),
        ("restarts", "restart", "[[method]] 1: `pipeline`: unknown field `restart`"),
    ] {
        let error = parse(&GIVEN.replacen(from, to, 1)).unwrap_err();
        assert!(error.contains(expected) && !error.contains('\n'), "{to}: {error}");
    }
}

#[test]
fn the_files_of_a_method_stand_beside_the_experiment_and_are_part_of_it() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    let (stage, other) = ("[[stage]]\nname = \"only\"\nfeatures = \"hermite[degree=3]\"\n", "iterations = 9\n");
    write("s.toml", stage);
    write("p.json", r#"{"theta": [0.1, 0.2], "covariance": [[1, 0], [0, 1]], "rotation_form": "vector"}"#);
    let text = "trials = 2\n[[scenario]]\nname = \"cloud3\"\npoints = 60\nstart = 20\n[[method]]\nname = \"staged\"\n\
                free = [\"rx\", \"ry\"]\npipeline = \"s.toml\"\n[[method]]\nname = \"turned\"\nfree = [\"rz\"]\n\
                pipeline = \"s.toml\"\n";
    write("e.toml", text);
    let lab = Lab::default();
    let load = || Experiment::load(&lab, &folder.path().join("e.toml"));
    let options = cfpose_lab::RunOptions { resume: true, ..cfpose_lab::RunOptions::new(folder.path().join("out")) };
    cfpose_lab::run(&lab, &load().unwrap(), &options).unwrap();
    // What is fixed keeps the value of the start, whatever else moves.
    let records = cfpose_lab::folder::read_records(&options.out.join("trials.jsonl")).unwrap();
    let thetas = |name: &str| {
        let of_method = records.iter().map(|(_, record)| record).filter(|record| record.method == name);
        of_method.map(|record| record.theta.clone().unwrap()).collect::<Vec<_>>()
    };
    for (staged, turned) in thetas("staged").iter().zip(&thetas("turned")) {
        assert!(staged[3..] == turned[3..] && staged[..3] != turned[..3], "{staged:?} {turned:?}");
    }
    // The same stages again are the same experiment; other stages in the file are another one.
    write("s.toml", &format!("# the same\n{stage}"));
    assert_eq!(cfpose_lab::run(&lab, &load().unwrap(), &options).unwrap().resumed, 4);
    write("s.toml", &format!("{stage}{other}"));
    let refused = cfpose_lab::run(&lab, &load().unwrap(), &options).unwrap_err().to_string();
    assert!(refused.contains("belongs to experiment"), "{refused}");
    for (key, expected) in [
        ("pipeline = \"absent.toml\"", "absent.toml: cannot read"),
        ("pipeline = \"e.toml\"", "e.toml: line 6: unknown field `method`"),
        ("pipeline = 3", "`pipeline` = 3: expected the name of a file"),
        ("prior = \"s.toml\"", "this is no JSON"),
        ("prior = \"p.json\"", "`prior`: "),
    ] {
        write("e.toml", &text.replace("pipeline = \"s.toml\"", key));
        let error = load().unwrap_err().to_string();
        assert!(error.contains(expected) && !error.contains('\n'), "{key}: {error}");
    }
}

#[test]
fn the_experiment_of_table_1_is_the_papers() {
    let text = include_str!("../../../experiments/table1.toml");
    let experiment = parse(text).unwrap();
    let plan = Plan::new(&Lab::default(), &experiment).unwrap();
    assert_eq!((plan.cells.len(), plan.num_records(), experiment.published.len()), (12, 2_400, 12));
    let table = published_tables(&experiment, &summarise(&plan, &[]));
    assert_eq!(table.lines().filter(|line| line.contains("paper |")).count(), 12, "{table}");
}

/// The scenario entries of a file with every preset that does not exist yet replaced by `paper`.
fn plan_of(text: &str) -> Plan {
    let text = if cfpose::estimator::PRESETS.contains(&"auto") {
        text.to_string()
    } else {
        text.replace("preset = \"auto\"", "preset = \"paper\"")
    };
    Plan::new(&Lab::default(), &parse(&text).unwrap()).unwrap()
}

#[test]
fn the_experiments_beyond_the_paper_have_the_cells_they_name() {
    let plan = plan_of(include_str!("../../../experiments/beyond.toml"));
    // Eight curves times: (a) 6, (b) 6, far starts 2, no start 1, shuffled 1, outliers 2 and 2.
    assert_eq!((plan.cells.len(), plan.methods.len()), (8 * 20, 2));
    assert_eq!(plan.trials.len(), 8 * (16 * 100 + 4 * 40));
    let plan = plan_of(include_str!("../../../experiments/clouds.toml"));
    assert_eq!((plan.cells.len(), plan.trials.len(), plan.methods.len()), (8, 800, 3));
    // A parameter in the brackets of the name is the same as one below it.
    let (inside, below) = ("name = \"planar-curve[b_p=0.03]\"", "name = \"planar-curve\"\nb_p = 0.03");
    let [a, b] = [inside, below].map(|text| parse(&GOOD.replace("name = \"planar-curve\"", text)).unwrap());
    assert_eq!(a, b);
    assert_eq!(a.cells()[0].parameter("b_p"), Some("0.03"));
}

#[test]
fn every_scenario_documents_itself_and_draws_the_same_trial_twice() {
    for entry in scenarios::ALL {
        assert!(!entry.summary.is_empty() && !entry.source.is_empty());
        let (_, parameters) = find("scenario", scenarios::ALL, entry.name).unwrap();
        let scenario = (entry.build)(&parameters).unwrap();
        assert!(!scenario.metrics().is_empty());
        if let Some(problems) = scenario.problems() {
            let start = |stream| problems.posed(&mut seed::data_stream(3, stream)).unwrap().start;
            assert_eq!(start(1), start(1));
        } else {
            let draw = |stream| scenario.trial(&mut seed::data_stream(3, stream)).unwrap();
            assert_eq!(draw(1), draw(1));
            assert_ne!(draw(1), draw(2));
            let layout = Lab::default().registry.model(scenario.model(), &Default::default()).unwrap().layout;
            let trial = draw(1);
            let score = scenario.score(&layout, &trial.truth, &trial.truth, &trial).unwrap();
            assert!(score.miss(scenario.metrics()) < 1e-7 && scenario.succeeds(&score, &trial));
        }
        // A value that is no number is an error of its parameter, never a panic.
        for spec in entry.parameters {
            let given = [(spec.name.to_string(), "nonsense".to_string())];
            let parameters = Parameters::resolve("scenario", entry.name, entry.parameters, &given).unwrap();
            assert!((entry.build)(&parameters).is_err(), "{} {}", entry.name, spec.name);
        }
    }
}

#[test]
fn the_planar_curve_is_the_papers_simulation() {
    let trial = |spec: &str, stream| {
        let (entry, parameters) = find("scenario", scenarios::ALL, spec).unwrap();
        (entry.build)(&parameters).unwrap().trial(&mut seed::data_stream(1, stream)).unwrap()
    };
    // |randn| <= b_m keeps 38.29, 68.27 and 86.64 %: 1203, 2145 and 2722 points, standard deviation at most 28.
    for (b_m, expected) in [(0.5, 1203.1), (1.0, 2145.0), (1.5, 2722.2)] {
        for stream in 0..5 {
            let kept = trial(&format!("planar-curve[b_m={b_m}]"), stream).target.len() as f64;
            assert!((kept - expected).abs() < 4.0 * 28.0, "{b_m} {kept}");
        }
    }
    // Outliers of the paper's paragraph iii).
    let with = trial("planar-curve[b_p=0.02,outliers=150,uniform_outliers=10]", 1).target;
    assert_eq!(with.len(), 3142 + 160);
    for k in 3142..3142 + 150 {
        let [x, y, _] = with.point(k);
        assert!((-0.6..-0.55).contains(&x) && (-0.4..-0.35).contains(&y));
    }
    // Noise: the residual of the image against the noise-free image of the same start has standard deviation b_p.
    let (clean, noisy) = (trial("planar-curve", 2).target, trial("planar-curve[b_p=0.02]", 2).target);
    let squares: f64 =
        (0..2).flat_map(|d| clean.column(d).iter().zip(noisy.column(d))).map(|(a, b)| (a - b).powi(2)).sum();
    assert!(((squares / 6284.0).sqrt() - 0.02).abs() < 4.0 * 0.02 / (2.0 * 6284.0_f64).sqrt());
    // A known image point: the first point of the heart under theta B, computed apart.
    let first = clean.point(0);
    assert!((first[0] - EXPECTED_FIRST[0]).abs() < 1e-14 && (first[1] - EXPECTED_FIRST[1]).abs() < 1e-14, "{first:?}");
}

/// Image of (1.6295535715380476e-07, 0.21201685284725938, 1) under Rz(-.25) Ry(.3) Rx(.2) and (-.2, .15, .3).
const EXPECTED_FIRST: [f64; 2] = [0.07437573939478993, 0.06588360812391914];

#[test]
fn an_experiment_of_absurd_size_is_refused_in_one_line() {
    let text = "trials = 9000000000000000000\n[[scenario]]\nname = \"planar-curve\"\n[[method]]\nname = \"paper\"\n";
    let error = Plan::new(&Lab::default(), &parse(text).unwrap()).unwrap_err();
    assert!(error.is_usage());
    assert!(error.to_string().contains("more than 10000000; lower `trials` or split the grid"), "{error}");
}
