//! `cfpose check`: what every registered entry must hold, and how well conditioned and fast the pairs are.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use cfpose::check::{Sample, derivatives};
use cfpose::coverage::coverage;
use cfpose::entry::{NamedEntry, find, parse_spec, suggest};
use cfpose::problem::MomentProblem;
use cfpose::{BuildContext, Execution, Isa, Points, Registry};
use cfpose_lab::Lab;
use cfpose_optim::LeastSquares;
use cfpose_optim::linear::svd;
use serde::Serialize;

use super::conformance::{self, SolverLine};
use crate::args::CheckArgs;
use crate::failure::Failure;
use crate::inputs;
use crate::output::{self, number};

/// Largest relative deviation of the Jacobian from finite differences.
const FINITE_DIFFERENCE: f64 = 1e-6;
/// Largest relative deviation from one long derivative and between instruction sets.
const EXACT: f64 = 1e-12;
/// Random points of a check.
const NUM_POINTS: usize = 500;
/// Distance of the checked theta from the model's typical one.
const SPREAD: f64 = 0.4;
/// Time spent on measuring the speed of one pair.
const MEASURE: Duration = Duration::from_millis(10);
/// Points on which lanes are compared with plain numbers: one chunk of the sums.
const SPEED_POINTS: usize = 4096;
/// Share of the lanes below which an entry is called slow. Healthy pairs reach 0.5 to 1,
/// code that is not inlined ends below 0.3.
const HEALTHY_SHARE: f64 = 0.35;

/// One checked pair of model and family, or one reason to skip it.
#[derive(Debug, Serialize)]
struct Line {
    model: String,
    family: String,
    passed: Option<bool>,
    num_points: Option<usize>,
    num_features: Option<usize>,
    finite_difference: Option<f64>,
    oracle: Option<f64>,
    instruction_sets: Option<f64>,
    condition: Option<f64>,
    nanoseconds_per_point: Option<f64>,
    /// Time on plain numbers over time on lanes, sums over points only; none without vectors.
    lane_speedup: Option<f64>,
    skipped: Option<String>,
}

/// Everything that was checked.
#[derive(Debug, Serialize)]
struct Report {
    pairs: Vec<Line>,
    solvers: Vec<SolverLine>,
    /// Directions of a rigid motion of the data that a family does not see, in words.
    coverage: Vec<String>,
    /// Entries whose per-point code runs much slower on lanes than it should.
    warnings: Vec<String>,
}

/// The entries that a name selects.
#[derive(Default)]
struct Chosen {
    models: Vec<String>,
    families: Vec<String>,
    solvers: Vec<String>,
}

/// Run the command.
///
/// # Errors
/// [`Failure`]; a check that does not pass is a run without a usable result.
pub fn run(args: &CheckArgs, lab: &Lab) -> Result<(), Failure> {
    let files: Vec<_> = args.on.iter().cloned().collect();
    output::keep_apart(&files, &[args.json.as_deref()])?;
    let registry = &lab.registry;
    let chosen = chosen(args.name.as_deref(), registry)?;
    let execution = Execution { isa: inputs::isa(&args.isa)?, pool: None };
    let points = args.on.as_deref().map(inputs::read).transpose()?;
    let mut report = Report { pairs: Vec::new(), solvers: Vec::new(), coverage: Vec::new(), warnings: Vec::new() };
    for model in &chosen.models {
        let many = Sample::draw(registry, model, SPEED_POINTS, SPREAD, args.seed).ok();
        let sample = match &points {
            Some(points) => Sample::on(registry, model, points, SPREAD, args.seed),
            None => Sample::draw(registry, model, NUM_POINTS, SPREAD, args.seed),
        };
        for family in &chosen.families {
            let mut line = match &sample {
                Ok(sample) => check(registry, model, family, sample, &execution)?,
                Err(error) => Line::skipped(model, family, error.to_string()),
            };
            if let (Some(_), Some(many)) = (line.passed, &many) {
                line.lane_speedup = lane_speedup(registry, family, many, &execution)?;
            }
            report.pairs.push(line);
        }
    }
    if let (Some(points), Some(_)) = (&points, &args.name) {
        report.coverage = coverages(registry, &chosen.families, points)?;
    }
    for solver in &chosen.solvers {
        report.solvers.push(SolverLine::check(registry, solver)?);
    }
    // Without optimisation every entry is slow.
    if !cfg!(debug_assertions) {
        report.warnings = slow_entries(&report.pairs, execution.isa.name(), execution.isa.lanes());
    }
    let json = args.json.as_deref();
    if !report.pairs.is_empty() {
        output::show(&table(&report.pairs), json)?;
    }
    for text in report.warnings.iter().chain(&report.coverage) {
        output::show(text, json)?;
    }
    if !report.solvers.is_empty() {
        output::show(&conformance::table(&report.solvers), json)?;
    }
    output::write_json(&report, json)?;
    report.verdict()
}

/// Say for each family which directions of a rigid motion of the data it does not see, and why; one family only.
fn coverages(registry: &Registry, families: &[String], points: &Points) -> Result<Vec<String>, Failure> {
    let model = match points.dim() {
        1 => "gain1",
        2 => "rigid2",
        _ => "rigid3",
    };
    let [family] = families else { return Ok(Vec::new()) };
    let report = coverage(registry, family, model, points).map_err(|error| Failure::input(format!("--on: {error}")))?;
    Ok(vec![report.to_string()])
}

impl Report {
    fn verdict(&self) -> Result<(), Failure> {
        let pairs = self.pairs.iter().filter_map(|line| line.passed);
        let all: Vec<bool> = pairs.chain(self.solvers.iter().map(SolverLine::passed)).collect();
        match all.iter().filter(|passed| !**passed).count() {
            0 if all.is_empty() => Err(Failure::unusable("nothing could be checked; see the reasons in the table")),
            0 => Ok(()),
            failed => Err(Failure::unusable(format!("{failed} of {} checks failed", all.len()))),
        }
    }
}

/// Return the entries that a name selects; a model is checked with all families and a family with all models.
fn chosen(name: Option<&str>, registry: &Registry) -> Result<Chosen, Failure> {
    let names = |names: Vec<&'static str>| -> Vec<String> { names.into_iter().map(str::to_string).collect() };
    let models = names(registry.models.iter().map(|entry| entry.name()).collect());
    let families = names(registry.families.iter().map(|entry| entry.name()).collect());
    let solvers = names(registry.solvers.iter().map(|entry| entry.name()).collect());
    let Some(text) = name else { return Ok(Chosen { models, families, solvers }) };
    let (name, _) = parse_spec(text)?;
    let one = vec![text.to_string()];
    if models.contains(&name) {
        registry.model(text, &BuildContext::default())?;
        return Ok(Chosen { models: one, families, ..Chosen::default() });
    }
    if families.contains(&name) {
        find("family", &registry.families, text)?;
        return Ok(Chosen { models, families: one, ..Chosen::default() });
    }
    if solvers.contains(&name) {
        return Ok(Chosen { solvers: one, ..Chosen::default() });
    }
    let near = suggest(&name, models.iter().chain(&families).chain(&solvers).map(String::as_str));
    let hint = if near.is_empty() { String::new() } else { format!("; did you mean {}?", near.join(" or ")) };
    Err(Failure::usage(format!("`{name}` is no model, family or solver{hint}; `cfpose list models` shows all models")))
}

impl Line {
    fn skipped(model: &str, family: &str, reason: String) -> Self {
        Self {
            model: model.to_string(),
            family: family.to_string(),
            passed: None,
            num_points: None,
            num_features: None,
            finite_difference: None,
            oracle: None,
            instruction_sets: None,
            condition: None,
            nanoseconds_per_point: None,
            lane_speedup: None,
            skipped: Some(reason),
        }
    }
}

/// Check one pair.
fn check(
    registry: &Registry,
    model: &str,
    family: &str,
    sample: &Sample,
    execution: &Execution,
) -> Result<Line, Failure> {
    let Some(problem) = sample.problem(registry, family, execution)? else {
        return Ok(Line::skipped(model, family, "too few features, or none in this dimension".to_string()));
    };
    let report = derivatives(&problem, &sample.theta);
    let passed = report.finite_difference < FINITE_DIFFERENCE && report.oracle < EXACT && report.lanes < EXACT;
    let evaluation = problem.evaluate(&sample.theta);
    let singular = svd(evaluation.residual.len(), problem.manifold().tangent(), &evaluation.jacobian);
    let condition = singular.and_then(|s| Some(s.values.first()? / s.values.last()?));
    Ok(Line {
        passed: Some(passed),
        num_points: Some(sample.source.len()),
        num_features: Some(problem.num_features()),
        finite_difference: Some(report.finite_difference),
        oracle: Some(report.oracle),
        instruction_sets: Some(report.lanes),
        condition,
        nanoseconds_per_point: Some(speed(&problem, &sample.theta, &sample.source, &sample.target)),
        skipped: None,
        ..Line::skipped(model, family, String::new())
    })
}

/// Measure residual and Jacobian: nanoseconds per point of the sides that are summed in each evaluation.
fn speed(problem: &MomentProblem, theta: &[f64], source: &Points, target: &Points) -> f64 {
    let moving = problem.model().target.is_moving();
    let num_points = source.len() + if moving { target.len() } else { 0 };
    let begun = Instant::now();
    let mut runs = 0_u32;
    while runs == 0 || begun.elapsed() < MEASURE {
        std::hint::black_box(problem.evaluate(std::hint::black_box(theta)));
        runs += 1;
    }
    begun.elapsed().as_secs_f64() * 1e9 / f64::from(runs) / num_points as f64
}

/// Measure how much faster the sums over points are on lanes than on plain numbers, shortest times in turns.
fn lane_speedup(
    registry: &Registry,
    family: &str,
    sample: &Sample,
    execution: &Execution,
) -> Result<Option<f64>, Failure> {
    if execution.isa.lanes() == 1 {
        return Ok(None);
    }
    let Some(problem) = sample.problem(registry, family, execution)? else { return Ok(None) };
    let problem = problem.with_direct_sums();
    let sets = [execution.isa, Isa::baseline()];
    let mut best = [f64::MAX; 2];
    let begun = Instant::now();
    let mut rounds = 0;
    while rounds < 3 || begun.elapsed() < MEASURE {
        for (isa, best) in sets.iter().zip(&mut best) {
            let start = Instant::now();
            std::hint::black_box(problem.evaluate_on(std::hint::black_box(&sample.theta), *isa));
            *best = best.min(start.elapsed().as_secs_f64());
        }
        rounds += 1;
    }
    Ok(Some(best[1] / best[0]))
}

/// Name the models and families that are slow on lanes with every partner, and say what to do.
fn slow_entries(lines: &[Line], isa: &str, lanes: usize) -> Vec<String> {
    let mut warnings = slow(lines, isa, lanes, "model", "project", |line| &line.model);
    warnings.extend(slow(lines, isa, lanes, "family", "basis", |line| &line.family));
    warnings
}

/// Judge each entry of one kind by its best pair: a slow partner is not its fault.
fn slow(
    lines: &[Line],
    isa: &str,
    lanes: usize,
    kind: &str,
    function: &str,
    name_of: fn(&Line) -> &str,
) -> Vec<String> {
    let mut best: BTreeMap<&str, f64> = BTreeMap::new();
    for line in lines {
        if let Some(speedup) = line.lane_speedup {
            let entry = best.entry(name_of(line)).or_insert(0.0);
            *entry = entry.max(speedup);
        }
    }
    let lanes = lanes as f64;
    let warn = |(name, speedup): (&str, f64)| {
        (speedup < HEALTHY_SHARE * lanes).then(|| {
            format!(
                "warning: {kind} `{name}` is at best {speedup:.1} times as fast on {isa} lanes as on plain numbers (healthy: {:.0} or \
                 more): its per-point code is not inlined. Put #[inline(always)] on `{function}` and on every helper it calls, \
                 write plain index loops instead of array::map, array::from_fn and closures, and `select_less` instead of `if`; \
                 see docs/adding/{kind}.md",
                0.5 * lanes,
            )
        })
    };
    best.into_iter().filter_map(warn).collect()
}

fn table(lines: &[Line]) -> String {
    let header =
        ["model", "family", "", "features", "finite diff.", "oracle", "lanes", "condition", "ns/point", "on lanes", ""];
    let cell = |value: Option<f64>, show: fn(f64) -> String| value.map_or_else(|| "-".to_string(), show);
    let row = |line: &Line| {
        let verdict = match line.passed {
            Some(true) => "ok".to_string(),
            Some(false) => "FAILED".to_string(),
            None => "skipped".to_string(),
        };
        let small: fn(f64) -> String = |value| format!("{value:.1e}");
        vec![
            line.model.clone(),
            line.family.clone(),
            verdict,
            line.num_features.map_or_else(|| "-".to_string(), |count| count.to_string()),
            cell(line.finite_difference, small),
            cell(line.oracle, small),
            cell(line.instruction_sets, small),
            cell(line.condition, number),
            cell(line.nanoseconds_per_point, |value| format!("{value:.1}")),
            cell(line.lane_speedup, |value| format!("x {value:.1}")),
            line.skipped.clone().unwrap_or_default(),
        ]
    };
    output::table(&header, &lines.iter().map(row).collect::<Vec<_>>())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_entry_is_slow_when_all_its_pairs_are() {
        let (isa, lanes) = ("avx2", 4);
        let line = |model: &str, family: &str, speedup: f64| Line {
            lane_speedup: Some(speedup * lanes as f64),
            ..Line::skipped(model, family, String::new())
        };
        let lines =
            [line("good", "fast", 0.9), line("good", "slow", 0.1), line("bad", "fast", 0.2), line("bad", "slow", 0.1)];
        let warnings = slow_entries(&lines, isa, lanes);
        assert_eq!(warnings.len(), 2, "{warnings:?}");
        assert!(warnings[0].contains("model `bad`") && warnings[0].contains("#[inline(always)] on `project`"));
        assert!(warnings[1].contains("family `slow`") && warnings[1].contains("docs/adding/family.md"));
    }
}
