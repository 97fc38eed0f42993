//! The hunt for wrong answers that are called good, trial by trial:
//! `cargo run --release -p cfpose-lab --example truth -- SCENARIO TRIALS [SEED]`.
//!
//! Prints one line a trial (verdict, error, what the verdict was made from, conditions) and the counts. Seeds below 6000 are
//! those that thresholds were set on; everything printed in docs/method.md comes from later ones.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc;

use cfpose::entry::find;
use cfpose::{Estimator, Execution, Registry, Supervision};
use cfpose_lab::calibration::estimate_mahalanobis;
use cfpose_lab::method::Method;
use cfpose_lab::{Determined, Scenario, Score, nearest_score, nearest_truth, scenarios, seed};
use cfpose_optim::Manifold;

/// What came out of one trial.
struct Line {
    number: u64,
    text: String,
    verdict: String,
    right: bool,
    gross: bool,
    possible: bool,
    large: bool,
    seconds: f64,
    squared: Option<(f64, usize)>,
    /// Of several poses that are equally true: how many are the answer or an alternative, of how many.
    listed: Option<(usize, usize)>,
    /// Whether a direction that nothing determines is named, where there is one.
    named: Option<bool>,
}

fn run(
    scenario: &dyn Scenario,
    number: u64,
    method: &Method,
) -> Result<Line, Box<dyn std::error::Error + Send + Sync>> {
    let trial = scenario.trial(&mut seed::data_stream(number, 77))?;
    let begin = std::time::Instant::now();
    let settings = method.settings(scenario.model(), trial.start.as_deref(), number)?;
    let conditions: Vec<String> = trial.conditions.iter().map(|(name, value)| format!("{name}={value}")).collect();
    let solved = Estimator::new(&Registry::default(), &settings, &trial.source, &trial.target, &Execution::default())
        .and_then(|estimator| Ok((estimator.solve(Supervision::default())?, estimator)));
    let seconds = begin.elapsed().as_secs_f64();
    let large = trial.source.len() >= 300;
    let (estimate, estimator) = match solved {
        Ok(solved) => solved,
        Err(problem) => {
            let text = format!("error: {problem} {}", conditions.join(" "));
            let verdict = "error".to_string();
            return Ok(Line {
                number,
                text,
                verdict,
                right: false,
                gross: false,
                possible: true,
                large,
                seconds,
                squared: None,
                listed: None,
                named: None,
            });
        }
    };
    let layout = &estimator.model().layout;
    let found = nearest_score(scenario, layout, &estimate.theta, &trial);
    let error = |score: &Score| score.pose.map(|pose| pose.total()).or(score.values.last().copied());
    let error = found.as_ref().and_then(|(score, _)| error(score)).unwrap_or(f64::INFINITY);
    let possible = trial.determined != Determined::Nothing;
    let right =
        possible && estimate.usable() && found.as_ref().is_some_and(|(score, _)| scenario.succeeds(score, &trial));
    let verdict = estimate.verdict.map_or("none", |verdict| verdict.name()).to_string();
    let squared = found.and_then(|(_, truth)| {
        Some((estimate_mahalanobis(&estimator, &estimate, truth)?, layout.manifold().tangent()))
    });
    let wrong_good = verdict == "good" && !(right && trial.determined == Determined::Theta);
    let text = format!(
        "{}{} {verdict:9} e {error:.4} {:.0} ms d2 {:.1} {} | {} | {}",
        if wrong_good { "!!" } else { "  " },
        if right { "right" } else { "wrong" },
        1e3 * seconds,
        squared.map_or(f64::NAN, |(squared, _)| squared),
        describe(&estimate),
        conditions.join(" "),
        estimate.warnings.join("; "),
    );
    let text = if right || !possible { text } else { format!("{text} | {}", from_truth(&estimator, scenario, &trial)) };
    let right = right && (trial.determined == Determined::Theta || verdict != "good");
    let listed = (trial.determined == Determined::OneOfSeveral).then(|| listed(scenario, layout, &estimate, &trial));
    let named = (trial.determined == Determined::ButADirection).then_some(!estimate.undetermined.is_empty());
    let text = listed.map_or(text.clone(), |(found, all)| format!("{text} | listed {found} of {all}"));
    Ok(Line { number, text, verdict, right, gross: error > 0.3, possible, large, seconds, squared, listed, named })
}

/// Count the equally true poses that are the answer or one of its alternatives.
fn listed(
    scenario: &dyn Scenario,
    layout: &cfpose::theta::Layout,
    estimate: &cfpose::Estimate,
    trial: &cfpose_lab::Trial,
) -> (usize, usize) {
    let thetas = || std::iter::once(&estimate.theta).chain(estimate.alternatives.iter().map(|other| &other.theta));
    let found = |truth: &Vec<f64>| {
        let only = cfpose_lab::Trial { truth: truth.clone(), equally_true: Vec::new(), ..trial.clone() };
        let is_near = |theta: &Vec<f64>| {
            nearest_score(scenario, layout, theta, &only).is_some_and(|(score, _)| scenario.succeeds(&score, &only))
        };
        thetas().any(is_near)
    };
    let all = || std::iter::once(&trial.truth).chain(&trial.equally_true);
    (all().filter(|truth| found(truth)).count(), all().count())
}

/// Say where the estimate ends from the truth: a right answer there is one that the search missed.
fn from_truth(estimator: &Estimator, scenario: &dyn Scenario, trial: &cfpose_lab::Trial) -> String {
    let Ok(estimate) = estimator.solve_from(std::slice::from_ref(&trial.truth), Supervision::default()) else {
        return "from the truth: error".to_string();
    };
    let found = nearest_truth(scenario, &estimator.model().layout, &estimate.theta, trial);
    format!("from the truth: e {:.4} {}", found.map_or(f64::INFINITY, |(error, _)| error.total()), describe(&estimate))
}

fn describe(estimate: &cfpose::Estimate) -> String {
    let sampling = estimate.sampling.unwrap_or("-");
    let j = estimate.statistics.as_ref().map_or(f64::NAN, |s| s.p_value);
    let evidence = estimate.evidence.map_or(String::new(), |e| {
        format!(
            "nfa {:.1} gap {:.1} z {:.1} unseen {:.3} clutter {:.3} noise {:.4} sd {:.4} copies {} mis {:.3} coh {:.2} und {}",
            e.log10_false_alarms,
            e.second_mode_nats,
            e.second_mode_deviations,
            e.unseen_source,
            e.unseen_target,
            e.noise,
            e.deviation,
            e.copies,
            e.coherence,
            estimate.support.map_or(f64::NAN, |s| s.coherence),
            estimate.undetermined.len()
        )
    });
    format!("{sampling} p {j:.4} {:?} {evidence}", estimate.by)
}

fn main() -> Result<(), Box<dyn std::error::Error + Send + Sync>> {
    let mut arguments = std::env::args().skip(1);
    let spec = arguments.next().unwrap_or_else(|| "hunt-planar".to_string());
    let trials: u64 = arguments.next().map_or(Ok(100), |text| text.parse())?;
    let first: u64 = arguments.next().map_or(Ok(1), |text| text.parse())?;
    let preset = arguments.next().unwrap_or_else(|| "auto".to_string());
    let (next, (sender, receiver)) = (AtomicU64::new(first), mpsc::channel());
    let threads = std::thread::available_parallelism().map_or(1, |n| n.get());
    let mut lines: Vec<Line> = std::thread::scope(|scope| {
        for _ in 0..threads {
            let (sender, next, spec, preset) = (sender.clone(), &next, spec.as_str(), preset.as_str());
            scope.spawn(move || -> Result<(), Box<dyn std::error::Error + Send + Sync>> {
                let (entry, parameters) = find("scenario", scenarios::ALL, spec)?;
                let (scenario, method) = ((entry.build)(&parameters)?, Method::of_preset(preset));
                loop {
                    let number = next.fetch_add(1, Ordering::Relaxed);
                    if number >= first + trials {
                        return Ok(());
                    }
                    sender.send(run(scenario.as_ref(), number, &method)?)?;
                }
            });
        }
        drop(sender);
        receiver.iter().collect()
    });
    lines.sort_by_key(|line| line.number);
    for line in &lines {
        println!("{} {}", line.number, line.text);
    }
    summary(&lines);
    Ok(())
}

fn summary(lines: &[Line]) {
    let count = |holds: &dyn Fn(&Line) -> bool| lines.iter().filter(|line| holds(line)).count();
    let good = |line: &Line| line.verdict == "good";
    let (all, right) = (lines.len(), count(&|l| l.right));
    let (called, wrong) = (count(&good), count(&|l| good(l) && !l.right));
    let percent = |part: usize, whole: usize| 100.0 * part as f64 / whole.max(1) as f64;
    println!(
        "right {right} of {all} ({:.1} %), of those that can be: {:.1} %",
        percent(right, all),
        percent(right, count(&|l| l.possible))
    );
    println!("good {called}, wrong among them {wrong} ({:.1} %)", percent(wrong, called));
    let large = count(&|l| good(l) && l.large);
    println!(
        "N >= 300: good {large}, wrong {} ({:.1} %), gross {}",
        count(&|l| good(l) && l.large && !l.right),
        percent(count(&|l| good(l) && l.large && !l.right), large),
        count(&|l| good(l) && l.large && !l.right && l.gross)
    );
    let symmetric: Vec<(usize, usize)> =
        lines.iter().filter(|l| l.right && !good(l)).filter_map(|l| l.listed).collect();
    if !symmetric.is_empty() {
        let complete = symmetric.iter().filter(|(listed, all)| listed == all).count();
        let (found, there) = symmetric.iter().fold((0, 0), |(a, b), (x, y)| (a + x, b + y));
        let few = symmetric.iter().map(|(listed, _)| *listed).min().unwrap_or(0);
        println!(
            "symmetric: called good {}; of {} others that are right every pose listed in {complete} ({:.1} %), of all poses {:.1} %, fewest {few}",
            count(&|l| l.listed.is_some() && good(l)),
            symmetric.len(),
            percent(complete, symmetric.len()),
            percent(found, there)
        );
    }
    let free = count(&|l| l.right && l.named.is_some());
    if free > 0 {
        println!(
            "undetermined in part: {free} right, called good {}; a direction named in {:.1} %",
            count(&|l| l.named.is_some() && good(l)),
            percent(count(&|l| l.right && l.named == Some(true)), free)
        );
    }
    println!("right ones called good: {:.1} %", percent(count(&|l| good(l) && l.right), right));
    let squares: Vec<f64> =
        lines.iter().filter(|l| l.right).filter_map(|l| l.squared).map(|(squared, dof)| squared / dof as f64).collect();
    let nees = squares.iter().sum::<f64>() / squares.len().max(1) as f64;
    let mut sorted = squares.clone();
    sorted.sort_by(f64::total_cmp);
    println!(
        "NEES / dof of {} right ones: mean {nees:.2}, median {:.2}",
        squares.len(),
        sorted.get(squares.len() / 2).unwrap_or(&f64::NAN)
    );
    let mut seconds: Vec<f64> = lines.iter().map(|l| l.seconds).collect();
    seconds.sort_by(f64::total_cmp);
    println!("seconds: median {:.3}, most {:.3}", seconds[seconds.len() / 2], seconds[seconds.len() - 1]);
}
