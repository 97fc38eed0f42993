//! Misuse of the library is an error that says what and where: never a panic, never a silent untruth.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use cfpose::entry::EntryError;
use cfpose::family::{FamilyEntry, General, Separable};
use cfpose::problem::Sides;
use cfpose::start::{StartContext, StartEntry, StartStrategy};
use cfpose::theta::{BlockKind, Layout};
use cfpose::{
    BuildContext, BuildError, Error, Estimator, Execution, Family, Map, Model, ModelEntry, Points, Registry, Scalar,
    SeparableFamily, Settings, Supervision, estimate,
};
use cfpose_optim::{Control, LeastSquares, Needs, Outcome, SolveError, Solver, SolverEntry, Status};

fn points(count: usize) -> Points {
    let value = |k: usize, d: usize| ((k * (37 + 11 * d) + 5) % 101) as f64 / 101.0 + 0.01 * (k * d) as f64;
    Points::from_columns((0..2).map(|d| (0..count).map(|k| value(k, d)).collect()).collect()).unwrap()
}

/// Whether the model `shift-later` panics now.
static ARMED: AtomicBool = AtomicBool::new(false);

/// A shift in the plane that does what its mode says.
#[derive(Clone, Copy)]
struct Shift(&'static str);

impl Map<2, 2, 2> for Shift {
    fn affine<S: Scalar>(&self, theta: &[S], a: &mut [S], b: &mut [S]) {
        if self.0 == "panics" {
            panic!("the author's model fell over");
        }
        // Not when it is built: that shows nothing.
        if self.0 == "panics-later" && ARMED.load(Ordering::Relaxed) {
            panic!("the author's model fell over at theta");
        }
        let one = if self.0 == "nan" { f64::NAN } else { 1.0 };
        a[0] = theta[0].constant(one);
        a[1] = theta[0].constant(0.0);
        a[2] = theta[0].constant(0.0);
        a[3] = theta[0].constant(one);
        b.copy_from_slice(&theta[..2]);
    }
    #[inline(always)]
    fn project<S: Scalar>(&self, y: [S; 2]) -> [S; 2] {
        y
    }
}

fn shift(mode: &'static str) -> Model {
    let layout = Layout::new(&[("translation", "target units", BlockKind::Vector(2))]);
    let mut model = Model::new(layout, Shift(mode));
    match mode {
        "identity" => model.identity = vec![0.0; 3],
        "typical" => model.typical = vec![f64::NAN; 2],
        "sides" => model = model.with_target::<3, 3, 3>(cfpose::model::UnitRay),
        "takes" => model.source_points = cfpose::model::PointKind::Plain(3),
        _ => {}
    }
    model
}

fn no_model() -> Model {
    panic!("no model today")
}

macro_rules! models {
    ($($entry:ident, $name:literal, $build:expr;)*) => {$(
        static $entry: ModelEntry = ModelEntry {
            name: $name,
            summary: "",
            parameters: &[],
            source: "",
            details: "",
            build: |_, _| Ok($build),
        };
    )*};
}
models! {
    GOOD, "shift-good", shift("good");
    IDENTITY, "shift-identity", shift("identity");
    TYPICAL, "shift-typical", shift("typical");
    SIDES, "shift-sides", shift("sides");
    TAKES, "shift-takes", shift("takes");
    NAN, "shift-nan", shift("nan");
    PANICS, "shift-panics", shift("panics");
    LATER, "shift-later", shift("panics-later");
    BUILD, "shift-build", no_model();
    TWIN, "rigid2", shift("good");
}

/// Functions of one coordinate that do what the mode says.
struct Wild(&'static str);

impl SeparableFamily for Wild {
    fn num_basis(&self) -> usize {
        if self.0 == "none" { 0 } else { 3 }
    }
    #[inline(always)]
    fn basis<S: Scalar>(&self, x: S, out: &mut [S]) {
        let written = match self.0 {
            "fewer" => 2,
            "more" => 5,
            _ => 3,
        };
        for i in 0..written {
            out[i] = (x * (1.0 + i as f64)).sin_cos().0;
        }
        match self.0 {
            "nan" => out[1] = x.constant(f64::NAN),
            "panics" => panic!("the author's family fell over"),
            _ => {}
        }
    }
    fn coefficients(&self) -> Option<Vec<f64>> {
        (self.0 == "coefficients").then(|| vec![1.0; 4])
    }
}

/// The same for functions of a point.
struct WildPoint(&'static str);

impl Family for WildPoint {
    fn num_basis(&self, _dim: usize) -> usize {
        4
    }
    #[inline(always)]
    fn basis<S: Scalar, const D: usize>(&self, x: [S; D], out: &mut [S]) {
        let written = if self.0 == "more" { 9 } else { 4 };
        for i in 0..written {
            out[i] = (x[0] * (1.0 + i as f64)).sin_cos().1;
        }
        if self.0 == "nan" {
            out[3] = x[0].constant(f64::INFINITY);
        }
    }
}

macro_rules! families {
    ($($entry:ident, $name:literal, $family:expr;)*) => {$(
        static $entry: FamilyEntry = FamilyEntry {
            name: $name,
            summary: "",
            parameters: &[],
            source: "",
            details: "",
            build: |_, _| Ok(Box::new($family)),
        };
    )*};
}
families! {
    F_GOOD, "wild-good", Separable(Wild("good"));
    F_NONE, "wild-none", Separable(Wild("none"));
    F_FEWER, "wild-fewer", Separable(Wild("fewer"));
    F_MORE, "wild-more", Separable(Wild("more"));
    F_NAN, "wild-nan", Separable(Wild("nan"));
    F_PANICS, "wild-panics", Separable(Wild("panics"));
    F_COEFFICIENTS, "wild-coefficients", Separable(Wild("coefficients"));
    P_MORE, "point-more", General(WildPoint("more"));
    P_NAN, "point-nan", General(WildPoint("nan"));
}

/// A solver that returns what its name says.
struct Careless(&'static str);

impl Solver for Careless {
    fn name(&self) -> &'static str {
        self.0
    }
    fn needs(&self) -> Needs {
        Needs::default()
    }
    fn solve(&self, _: &dyn LeastSquares, start: &[f64], _: &mut Control<'_>) -> Result<Outcome, SolveError> {
        if self.0 == "careless-panics" {
            panic!("the author's solver fell over");
        }
        let mut theta = start.to_vec();
        let mut cost = 0.0;
        match self.0 {
            "careless-short" => theta.truncate(1),
            "careless-nan" => theta[0] = f64::NAN,
            "careless-cost" => cost = f64::NAN,
            _ => {}
        }
        Ok(Outcome {
            theta,
            cost,
            violation: 0.0,
            status: Status::CostTolerance,
            message: "all is well".to_string(),
            gradient_norm: 0.0,
            counts: Default::default(),
            seconds: 0.0,
            trace: Vec::new(),
        })
    }
}

macro_rules! solvers {
    ($($entry:ident, $name:literal;)*) => {$(
        static $entry: SolverEntry = SolverEntry {
            name: $name,
            summary: "",
            parameters: &[],
            source: "",
            build: |_| Ok(Box::new(Careless($name))),
        };
    )*};
}
solvers! {
    S_SHORT, "careless-short";
    S_NAN, "careless-nan";
    S_COST, "careless-cost";
    S_LIES, "careless-lies";
    S_PANICS, "careless-panics";
}

fn registry() -> Registry {
    let mut registry = Registry::default();
    registry.models.extend([&GOOD, &IDENTITY, &TYPICAL, &SIDES, &TAKES, &NAN, &PANICS, &LATER, &BUILD]);
    registry.families.extend([
        &F_GOOD,
        &F_NONE,
        &F_FEWER,
        &F_MORE,
        &F_NAN,
        &F_PANICS,
        &F_COEFFICIENTS,
        &P_MORE,
        &P_NAN,
    ]);
    registry.starts.extend([&B_SHORT, &B_NAN, &B_PANICS]);
    registry.solvers.extend([&S_SHORT, &S_NAN, &S_COST, &S_LIES, &S_PANICS]);
    registry
}

/// Return the error of an estimate in words.
fn refusal(settings: &Settings) -> String {
    let target = Points::from_rows(
        &(0..60).map(|k| [points(60).column(0)[k] + 0.3, points(60).column(1)[k] - 0.1]).collect::<Vec<_>>(),
    );
    match estimate(&registry(), settings, &points(60), &target.unwrap(), &Execution::default()) {
        Ok(found) => panic!("no error, but {:?}", found.theta),
        Err(error) => error.to_string(),
    }
}

fn with(model: &str, features: &str, solver: &str) -> Settings {
    Settings::preset("paper", model).unwrap().features(features).solver(solver)
}

const LM: &str = "levenberg-marquardt";

#[test]
fn models_that_contradict_themselves_are_named() {
    for (model, expected) in [
        ("shift-identity", "model `shift-identity` is broken: its `identity` has 3 numbers, its layout 2"),
        ("shift-typical", "model `shift-typical` is broken: its `typical` is not finite"),
        ("shift-sides", "model `shift-sides` is broken: its sides map into 2 and 3 dimensions"),
        ("shift-takes", "model `shift-takes` is broken: its source side takes points of 3 coordinates, its map of 2"),
        ("shift-nan", "model `shift-nan` is broken: its source map returns NaN or infinity for every point"),
        ("shift-panics", "model `shift-panics` is broken: its source map panics: the author's model fell over"),
        ("shift-build", "model `shift-build` is broken: it panics when it is built: no model today"),
    ] {
        let error = refusal(&with(model, "hermite[degree=2]", LM));
        assert!(error.starts_with(expected), "{error}\nin place of: {expected}");
    }
    // What shows only at some theta is caught where it is solved.
    let settings = with("shift-later", "hermite[degree=2]", LM);
    let estimator = Estimator::new(&registry(), &settings, &points(60), &points(50), &Execution::default()).unwrap();
    ARMED.store(true, Ordering::Relaxed);
    let later = estimator.solve(Supervision::default()).unwrap_err().to_string();
    assert!(later.contains("solver `levenberg-marquardt`: a panic") && later.contains("fell over at theta"), "{later}");
}

#[test]
fn families_that_panic_or_lie_are_named() {
    for (family, expected) in [
        ("wild-none", "it has no functions in 2 dimension(s)"),
        ("wild-fewer", "function 3 of 6 is NaN at"),
        ("wild-more", "it panics: index out of bounds"),
        ("wild-nan", "value 2 of 6 is NaN at every point"),
        ("wild-panics", "it panics: the author's family fell over"),
        ("wild-coefficients", "it panics: 4 coefficients are no whole rows of 3"),
        ("point-more", "it panics: index out of bounds"),
        ("point-nan", "value 4 of 4 is NaN at every point"),
        ("hermite[degree=2] + wild-nan", "value "),
    ] {
        let error = refusal(&with("rigid2", family, LM));
        let begin = format!("family `{family}` is broken: {expected}");
        assert!(error.starts_with(&begin), "{error}\nin place of: {begin}");
    }
}

#[test]
fn what_a_solver_returns_is_looked_at() {
    for (solver, expected) in [
        ("careless-short", "it returns a theta of 1 numbers, not "),
        ("careless-nan", "it returns a theta that holds NaN as usable"),
        ("careless-cost", "it returns the cost NaN"),
        ("careless-lies", "it reports the cost 0e0 at a theta whose cost is "),
        (
            "careless-panics",
            "a panic in it, or in the model or family that it evaluates: the author's solver fell over",
        ),
    ] {
        let error = refusal(&with("shift-good", "wild-good", solver));
        assert!(error.starts_with(&format!("solver `{solver}`: {expected}")), "{error}");
    }
}

/// Starts that are what the name says.
struct Stray(&'static str);

impl StartStrategy for Stray {
    fn name(&self) -> &'static str {
        self.0
    }
    fn starts(&self, context: &StartContext<'_>) -> Result<Vec<Vec<f64>>, Error> {
        let mut theta = context.model.identity.clone();
        match self.0 {
            "stray-short" => theta.truncate(2),
            "stray-nan" => theta[0] = f64::NAN,
            _ => panic!("the author's start fell over"),
        }
        Ok(vec![theta])
    }
}

macro_rules! starts {
    ($($entry:ident, $name:literal;)*) => {$(
        static $entry: StartEntry = StartEntry {
            name: $name,
            summary: "",
            parameters: &[],
            source: "",
            build: |_| Ok(Box::new(Stray($name))),
        };
    )*};
}
starts! {
    B_SHORT, "stray-short";
    B_NAN, "stray-nan";
    B_PANICS, "stray-panics";
}

#[test]
fn starts_that_are_no_theta_are_named() {
    for (start, expected) in [
        ("stray-short", "start `stray-short` is broken: it proposes a theta of 2 numbers, not 3"),
        ("stray-nan", "start `stray-nan` is broken: it proposes a theta that holds NaN"),
        ("stray-panics", "start `stray-panics` is broken: it panics: the author's start fell over"),
    ] {
        for preset in ["paper", "auto"] {
            assert_eq!(refusal(&Settings::preset(preset, "rigid2").unwrap().start(start)), expected);
        }
    }
}

#[test]
fn a_doubled_name_is_refused_wherever_it_is_looked_up() {
    let mut twice = registry();
    twice.models.push(&TWIN);
    let error = twice.model("rigid2", &BuildContext::default()).err().unwrap();
    let doubled = |error: &Error, kind: &str| matches!(error, Error::Build(BuildError::Entry(EntryError::DoubledName { kind: found, count: 2, .. })) if *found == kind);
    assert!(doubled(&error, "model"), "{error}");
    assert_eq!(error.to_string(), "model `rigid2` stands 2 times in the table; give each entry a name of its own");
    twice.families.push(&F_GOOD);
    twice.solvers.push(&S_SHORT);
    let context = BuildContext { dim: 2, ..BuildContext::default() };
    assert!(doubled(&twice.family("hermite[degree=2] + wild-good", &context).err().unwrap(), "family"));
    assert!(doubled(&twice.solver("careless-short").err().unwrap(), "solver"));
    // Inside a solver that wraps another one too.
    assert!(doubled(&twice.solver("multi-start[solver=careless-short]").err().unwrap(), "solver"));
    assert!(twice.model("rigid3", &BuildContext::default()).is_ok());
}

#[test]
fn a_theta_of_another_length_is_an_error() {
    let registry = Registry::default();
    let settings = Settings::preset("paper", "rigid2").unwrap().features("hermite[degree=3]");
    let estimator = Estimator::new(&registry, &settings, &points(50), &points(50), &Execution::default()).unwrap();
    let problem = estimator.problem();
    let theta = estimator.model().identity.clone();
    assert_eq!(problem.try_evaluate(&theta).unwrap(), problem.evaluate(&theta));
    let short = problem.try_evaluate(&theta[1..]).unwrap_err().to_string();
    assert!(short.starts_with(&format!("theta needs {} numbers", theta.len())), "{short}");
    assert!(problem.try_evaluate(&[theta.as_slice(), &[0.0]].concat()).is_err());
    let mut nan = theta.clone();
    nan[0] = f64::NAN;
    assert!(problem.try_evaluate(&nan).unwrap_err().to_string().contains("number 1 of theta is NaN"));
}

#[test]
fn points_without_weight_are_not_there() {
    let rows = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [5.0, 5.0]];
    let columns = |d: usize| rows.iter().map(|row| row[d]).collect::<Vec<f64>>();
    let weighted = |weights: [f64; 4]| Points::weighted(vec![columns(0), columns(1)], weights.to_vec()).unwrap();
    assert!(weighted([1.0, 2.0, 0.0, 0.0]).require_spread(2).is_ok());
    let lonely = weighted([0.0, 0.0, 3.0, 0.0]);
    assert!(lonely.require_spread(2).unwrap_err().to_string().starts_with("only 1 distinct point(s)"));
    assert!(weighted([1.0, 1.0, 0.0, 1.0]).require_spread(4).is_err());
    let settings = Settings::preset("paper", "rigid2").unwrap();
    let error =
        Estimator::new(&Registry::default(), &settings, &lonely, &points(9), &Execution::default()).err().unwrap();
    assert!(error.to_string().starts_with("source points: only 1 distinct point(s)"), "{error}");
}

#[test]
fn points_that_a_start_cannot_use_are_an_error_of_their_side() {
    let flat = Points::from_rows(&[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [4.0, 0.0], [7.0, 0.0]]).unwrap();
    for (source, target, side) in
        [(&flat, &points(50), cfpose::Side::Source), (&points(50), &flat, cfpose::Side::Target)]
    {
        let settings = Settings::preset("paper", "affine2").unwrap().start("pca").normaliser("none");
        let estimator = Estimator::new(&Registry::default(), &settings, source, target, &Execution::default()).unwrap();
        let error = estimator.starts().unwrap_err();
        assert!(matches!(error, Error::Data { side: found, .. } if found == side), "{error:?}");
    }
}

#[test]
fn nesting_is_bounded() {
    let registry = Registry::default();
    let context = BuildContext { dim: 3, ..BuildContext::default() };
    let nested =
        |depth: usize| (0..depth).fold("hermite".to_string(), |inner, _| format!("orthonormalised[basis={inner}]"));
    assert!(registry.family(&nested(3), &context).is_ok());
    let deep = registry.family(&nested(9), &context).err().unwrap().to_string();
    assert!(deep.contains("brackets are nested more than 8 deep"), "{deep}");
    let solver = (0..40).fold(LM.to_string(), |inner, _| format!("multi-start[solver={inner}]"));
    assert!(registry.solver(&solver).err().unwrap().to_string().contains("nested more than 8 deep"));
    let many = vec!["fourier[k=8]"; 40].join(" + ");
    let error = registry.family(&many, &context).err().unwrap().to_string();
    assert!(error.contains("basis functions are more than 16384; choose a smaller family"), "{error}");
    let large = registry.family("orthonormalised[basis=fourier[k=8]]", &context).err().unwrap().to_string();
    assert!(large.contains("at most 512 can be orthonormalised; choose a smaller one"), "{large}");
    let blur = "quadrature-blur[family=quadrature-blur[family=rbf]]";
    assert!(registry.family(blur, &context).err().unwrap().to_string().contains("a blur of a blur"));
}

#[test]
fn sides_of_a_good_model_are_as_before() {
    // The guards change nothing for entries that are sound.
    let model = registry().model("shift-good", &BuildContext::default()).unwrap();
    let normaliser = registry().normaliser("whiten").unwrap();
    let (source, target) = (Arc::new(points(40)), Arc::new(points(40)));
    let theta = model.identity.clone();
    assert!(Sides::new(Arc::new(model), normaliser.as_ref(), source, target, &theta, &Execution::default()).is_ok());
    let settings = with("shift-good", "wild-good", LM);
    let found = estimate(&registry(), &settings, &points(60), &points(60), &Execution::default());
    assert!(found.unwrap().theta.iter().all(|value| value.abs() < 1e-9));
}

#[test]
fn a_theta_of_another_length_is_named_wherever_it_enters() {
    let registry = Registry::default();
    let (source, target) = (points(60), points(60));
    let settings = Settings::preset("auto", "rigid2").unwrap();
    let ready = |settings: &Settings| Estimator::new(&registry, settings, &source, &target, &Execution::default());
    let short = ready(&settings.clone().start_at(vec![0.1, 0.2])).err().unwrap().to_string();
    assert!(short.contains("theta needs 3 numbers") && short.contains("found 2"), "{short}");
    let estimator = ready(&settings).unwrap();
    let long = estimator.solve_from(&[vec![0.0; 5]], cfpose::Supervision::default()).err().unwrap().to_string();
    assert!(long.contains("found 5"), "{long}");
    assert!(estimator.evaluate(&[0.0]).err().unwrap().to_string().contains("found 1"));
    let wild = estimator.evaluate(&[0.0, f64::NAN, 0.0]).err().unwrap().to_string();
    assert!(wild.contains("number 2 of theta is NaN"), "{wild}");
}
