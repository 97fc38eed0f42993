//! Code of entries that a program added may panic: that costs its own rows, not the run.

use cfpose::entry::ParameterSpec;
use cfpose::theta::Layout;
use cfpose::{Points, Side};
use cfpose_lab::folder::read_records;
use cfpose_lab::rand::RngExt;
use cfpose_lab::{
    ChaCha12Rng, Experiment, Lab, RunOptions, Scenario, ScenarioEntry, ScenarioError, Success, Trial, run,
};
use cfpose_optim::{Control, LeastSquares, Needs, Outcome, SolveError, Solver, SolverEntry};

/// Points in a box that now and then fall over.
struct Fragile;

impl Scenario for Fragile {
    fn model(&self) -> &str {
        "rigid3"
    }

    fn trial(&self, rng: &mut ChaCha12Rng) -> Result<Trial, ScenarioError> {
        let rows: Vec<[f64; 3]> =
            (0..40).map(|k| [rng.random(), rng.random::<f64>() * 0.5, f64::from(k) * 0.01]).collect();
        assert!(rows[0][0] < 0.8, "the box of {:.3} is too wide\nfor words", rows[0][0]);
        let points = |side| Points::from_rows(&rows).map_err(|problem| ScenarioError::Points { side, problem });
        let start = Layout::pose3().neutral();
        Ok(Trial::new(points(Side::Source)?, points(Side::Target)?, start.clone(), Success::Error(0.1))
            .with_start(start))
    }
}

static FRAGILE: ScenarioEntry = ScenarioEntry {
    name: "fragile",
    summary: "points in a box that now and then fall over",
    parameters: &[ParameterSpec { name: "nothing", default: "0", meaning: "nothing" }],
    source: "this test",
    build: |_| Ok(Box::new(Fragile)),
};

struct Falls;

impl Solver for Falls {
    fn name(&self) -> &'static str {
        "falls"
    }
    fn needs(&self) -> Needs {
        Needs::default()
    }
    fn solve(&self, _: &dyn LeastSquares, _: &[f64], _: &mut Control<'_>) -> Result<Outcome, SolveError> {
        panic!("this solver always falls")
    }
}

static FALLS: SolverEntry =
    SolverEntry { name: "falls", summary: "", parameters: &[], source: "", build: |_| Ok(Box::new(Falls)) };

#[test]
fn a_panic_costs_its_own_row() {
    // Forty stack traces say nothing here.
    std::panic::set_hook(Box::new(|_| {}));
    let mut lab = Lab::default();
    lab.scenarios.push(&FRAGILE);
    lab.registry.solvers.push(&FALLS);
    let text = "trials = 40\n[[scenario]]\nname = \"fragile\"\n[[method]]\nname = \"paper\"\npreset = \"paper\"\n\
                [[method]]\nname = \"falls\"\npreset = \"paper\"\nsolver = \"falls\"\n";
    // A seed whose first trial stands: it is looked at before the run.
    let experiment = Experiment::parse(&lab, &format!("seed = 3\n{text}"), "e.toml").unwrap();
    let folder = tempfile::tempdir().unwrap();
    let report = run(&lab, &experiment, &RunOptions { threads: 2, ..RunOptions::new(folder.path()) }).unwrap();
    assert_eq!((report.records, report.missing), (80, 0));
    let records = read_records(&folder.path().join("trials.jsonl")).unwrap();
    let said = |method: &str, words: &str| {
        let of = records.iter().map(|(_, r)| r).filter(|r| r.method == method);
        of.filter(|r| r.message.as_deref().is_some_and(|m| m.contains(words)) && !r.usable).count()
    };
    let fallen = said("paper", "its code panics: the box of 0.");
    assert!((1..39).contains(&fallen), "{fallen}");
    assert_eq!(said("falls", "solver `falls`: a panic in it"), 40 - fallen);
    assert_eq!(records.iter().filter(|(_, r)| r.method == "paper" && r.success).count(), 40 - fallen);
    assert!(records.iter().all(|(_, r)| r.message.as_deref().is_none_or(|m| !m.contains('\n'))));
}
