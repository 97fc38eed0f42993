//! A program with entries that fall over: one line says what and where, and the exit code is one of the contract.
//!
//! This test has no harness: it is the program too, which it starts with a variable set.

use std::process::{Command, ExitCode};

use cfpose::model::{Map, Model};
use cfpose::theta::{BlockKind, Layout};
use cfpose::{ModelEntry, Scalar};
use cfpose_lab::Lab;
use cfpose_optim::{Control, LeastSquares, Needs, Outcome, SolveError, Solver, SolverEntry};

const AS_PROGRAM: &str = "CFPOSE_TEST_FRAGILE";

struct Brittle;

impl Map<2, 2, 2> for Brittle {
    fn affine<S: Scalar>(&self, _theta: &[S], _a: &mut [S], _b: &mut [S]) {
        panic!("this model is brittle")
    }
    fn project<S: Scalar>(&self, y: [S; 2]) -> [S; 2] {
        y
    }
}

static BRITTLE: ModelEntry = ModelEntry {
    name: "brittle",
    summary: "",
    parameters: &[],
    source: "",
    details: "",
    build: |_, _| Ok(Model::new(Layout::new(&[("translation", "1", BlockKind::Vector(2))]), Brittle)),
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
        panic!("this solver falls\nover two lines")
    }
}

static FALLS: SolverEntry =
    SolverEntry { name: "falls", summary: "", parameters: &[], source: "", build: |_| Ok(Box::new(Falls)) };

fn main() -> ExitCode {
    if std::env::var_os(AS_PROGRAM).is_some() {
        let mut lab = Lab::default();
        lab.registry.models.push(&BRITTLE);
        lab.registry.solvers.push(&FALLS);
        return cfpose_cli::main_with(lab);
    }
    let folder = tempfile::tempdir().expect("a folder");
    let rows: String =
        (0..40).map(|k| format!("{},{}\n", (k * 37 % 41) as f64 / 41.0, (k * k % 43) as f64 / 43.0)).collect();
    std::fs::write(folder.path().join("p.csv"), rows).expect("a file");
    let experiment = "trials = 3\n[[scenario]]\nname = \"cloud3\"\npoints = 30\n[[method]]\nname = \"falls\"\npreset = \"paper\"\nsolver = \"falls\"\n";
    std::fs::write(folder.path().join("e.toml"), experiment).expect("a file");
    let run = |line: &str| {
        let program = std::env::current_exe().expect("this program");
        let mut command = Command::new(program);
        command.args(line.split_whitespace()).env(AS_PROGRAM, "1").current_dir(folder.path());
        let output = command.output().expect("the program starts");
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        (output.status.code(), said)
    };
    let (code, said) = run("estimate --model brittle --source p.csv --target p.csv");
    assert_eq!(code, Some(4), "{said}");
    assert!(said.contains("note: panicked at ") && said.contains("tests/fragile.rs:"), "{said}");
    assert!(said.contains("error: model `brittle` is broken: its source map panics: this model is brittle"), "{said}");
    let (code, said) = run("estimate --model rigid2 --preset paper --solver falls --source p.csv --target p.csv");
    assert_eq!(code, Some(4), "{said}");
    assert!(said.contains("error: solver `falls`: a panic in it"), "{said}");
    // In a run every trial meets it: it is noted once, and has its rows.
    let (code, said) = run("run e.toml --out r --threads 2");
    assert_eq!((code, said.matches("panicked at").count()), (Some(0), 1), "{said}");
    let rows = std::fs::read_to_string(folder.path().join("r/trials.jsonl")).expect("records");
    assert_eq!(rows.matches("this solver falls over two lines").count(), 3, "{rows}");
    println!("a program with entries that fall over ends in order ... ok");
    ExitCode::SUCCESS
}
