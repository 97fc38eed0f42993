//! Least-squares problems of others with known solutions: NIST's regressions, the sets of More, Garbow and Hillstrom and of Hock and
//! Schittkowski.

use std::sync::Arc;

use cfpose::entry::{EntryError, ParameterSpec, Parameters, suggest};
use cfpose_optim::LeastSquares;
use cfpose_optim::testproblems::{Reference, hock_schittkowski, more_garbow_hillstrom, nist};
use rand::RngExt;
use rand_chacha::ChaCha12Rng;
use rand_distr::StandardNormal;

use crate::metric::{Metric, Score};
use crate::scenario::problems::{Ended, OfProblems, Posed, Problems};
use crate::scenario::{ScenarioEntry, ScenarioError};

/// `excess`: of the sum of squares over the nearest published optimum, relative to it, or the sum itself where that is 0.
const EXCESS: Metric = Metric::error("excess", "1");
const VIOLATION: Metric = Metric::error("violation", "1");
/// Right digits of the parameters against NIST's certified ones, 0 to 11.
const DIGITS: Metric = Metric::gain("digits", "digits");

const OF_NIST: &[Metric] = &[EXCESS, DIGITS];
const OF_OTHERS: &[Metric] = &[EXCESS, VIOLATION];

/// Digits of a success.
const ENOUGH_DIGITS: f64 = 4.0;
/// A sum of squares is a published optimum within this relative distance, or below [`ZERO`] where that is 0.
const RELATIVE: f64 = 1e-4;
const ZERO: f64 = 1e-10;
/// Largest violation of a constraint in a success.
const FEASIBLE: f64 = 1e-7;

/// What is known about the solution.
enum Known {
    /// Certified parameters.
    Nist(nist::Nist),
    /// Published least sums of squares.
    Optima(Vec<f64>),
}

/// One problem from a start that is drawn about a published one: each coordinate times 1 + `spread` times a normal (a 0 becomes
/// `spread` times a normal).
struct Published {
    problem: Arc<dyn LeastSquares + Send>,
    start: Vec<f64>,
    spread: f64,
    known: Known,
}

impl Published {
    fn new(parameters: &Parameters) -> Result<Self, EntryError> {
        let second = parameters.choice("start", &[("1", false), ("2", true)])?;
        let spread = parameters.number("spread", "a number >= 0", |v| v >= 0.0 && v.is_finite())?;
        let of_list = |list: Vec<Reference>| {
            let names: Vec<String> = list.iter().map(|reference| reference.name.clone()).collect();
            let at = position(parameters, &names)?;
            match list.into_iter().nth(at) {
                Some(_) if second => Err(parameters.bad("start", "only problems of nist have a second start; write 1")),
                Some(found) => Ok(Self {
                    problem: Arc::from(found.problem),
                    start: found.start,
                    spread,
                    known: Known::Optima(found.optima),
                }),
                None => Err(parameters.bad("problem", "there is no such problem")),
            }
        };
        match parameters.text("set") {
            "nist" => {
                let all = nist::all();
                let names: Vec<String> = all.iter().map(|problem| problem.name.to_string()).collect();
                let found = all[position(parameters, &names)?];
                let start = found.starts()[usize::from(second)].to_vec();
                Ok(Self { problem: Arc::new(found.problem()), start, spread, known: Known::Nist(found) })
            }
            "more-garbow-hillstrom" => of_list(more_garbow_hillstrom::all()),
            "more-garbow-hillstrom-bounded" => of_list(more_garbow_hillstrom::bounded()),
            "hock-schittkowski" => of_list(hock_schittkowski::all()),
            _ => Err(parameters.bad(
                "set",
                "expected one of nist, more-garbow-hillstrom, more-garbow-hillstrom-bounded, hock-schittkowski",
            )),
        }
    }
}

/// Find a problem by its name, or by the number that its name begins with.
fn position(parameters: &Parameters, names: &[String]) -> Result<usize, EntryError> {
    let wanted = parameters.text("problem");
    let is_wanted = |name: &String| name == wanted || name.split_whitespace().next() == Some(wanted);
    names.iter().position(is_wanted).ok_or_else(|| {
        let near = suggest(wanted, names.iter().map(String::as_str));
        let list = if near.is_empty() { names.to_vec() } else { near };
        parameters.bad("problem", &format!("expected one of {}", list.join(", ")))
    })
}

impl Problems for Published {
    fn posed(&self, rng: &mut ChaCha12Rng) -> Result<Posed, ScenarioError> {
        let mut disturbed = |value: &f64| {
            let by = self.spread * rng.sample::<f64, _>(StandardNormal);
            if *value == 0.0 { by } else { value * (1.0 + by) }
        };
        let start = self.start.iter().map(&mut disturbed).collect();
        Ok(Posed { problem: Arc::clone(&self.problem) as Arc<dyn LeastSquares>, start })
    }

    fn metrics(&self) -> &[Metric] {
        if matches!(self.known, Known::Nist(_)) { OF_NIST } else { OF_OTHERS }
    }

    fn score(&self, ended: &Ended<'_>) -> Option<Score> {
        let sum = 2.0 * ended.cost;
        let over = |optimum: f64| if optimum == 0.0 { sum } else { (sum / optimum - 1.0).abs() };
        let values = match &self.known {
            Known::Nist(problem) => vec![over(problem.certified.sum_of_squares), problem.digits(ended.theta)],
            Known::Optima(optima) => {
                vec![optima.iter().map(|optimum| over(*optimum)).fold(f64::INFINITY, f64::min), ended.violation]
            }
        };
        Some(Score::of(values))
    }

    fn succeeds(&self, ended: &Ended<'_>, score: &Score) -> bool {
        match &self.known {
            Known::Nist(_) => score.values[1] >= ENOUGH_DIGITS,
            Known::Optima(optima) => {
                let sum = 2.0 * ended.cost;
                let is_optimum = |f: &f64| (sum - f).abs() <= if *f == 0.0 { ZERO } else { RELATIVE * f };
                optima.iter().any(is_optimum) && ended.violation < FEASIBLE
            }
        }
    }
}

pub(super) const ENTRY: ScenarioEntry = ScenarioEntry {
    name: "least-squares",
    summary: "least-squares problems with published solutions: NIST StRD, More-Garbow-Hillstrom, Hock-Schittkowski; no points, solvers alone",
    parameters: &[
        ParameterSpec {
            name: "set",
            default: "nist",
            meaning: "nist, more-garbow-hillstrom, more-garbow-hillstrom-bounded or hock-schittkowski",
        },
        ParameterSpec {
            name: "problem",
            default: "Misra1a",
            meaning: "name of the problem in its set, such as Thurber, HS27, or its number there; a wrong name lists them",
        },
        ParameterSpec { name: "start", default: "1", meaning: "published start; nist has 1 (far) and 2 (near)" },
        ParameterSpec {
            name: "spread",
            default: "0",
            meaning: "standard deviation of the start's coordinates about it, relative; 0: every trial is the same",
        },
    ],
    source: "NIST StRD; More, Garbow and Hillstrom 1981; Gay 1984; Hock and Schittkowski 1981",
    build: |parameters| Ok(Box::new(OfProblems(Published::new(parameters)?))),
};
