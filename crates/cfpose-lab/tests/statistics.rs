//! The statistics agree with reference figures to 1e-6, find a planted difference and none where there is none.

use cfpose_lab::group::groups;
use cfpose_lab::rand::RngExt;
use cfpose_lab::statistics::bootstrap::median_interval;
use cfpose_lab::statistics::entries::{data_profile, exponent, mcnemar, performance_profile, wilcoxon};
use cfpose_lab::statistics::{holm, wilson95};
use cfpose_lab::{Experiment, Lab, Plan, Record, seed};
use serde_json::Value;

/// Made by tools/statistics_reference.py with scipy and statsmodels.
const REFERENCE: &str = include_str!("data/statistics.json");

fn reference(name: &str) -> Vec<Value> {
    let all: Value = serde_json::from_str(REFERENCE).unwrap();
    let cases = all[name].as_array().unwrap().clone();
    assert!(!cases.is_empty());
    cases
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|v| v.as_f64().unwrap_or(f64::INFINITY)).collect()
}

/// Within 1e-6 of the figure, absolutely below 1 and relatively above.
fn same(ours: f64, theirs: f64) -> bool {
    ours == theirs || (ours - theirs).abs() <= 1e-6 * theirs.abs().max(1.0)
}

fn all_same(ours: &[f64], theirs: &Value) {
    let theirs = numbers(theirs);
    assert!(ours.len() == theirs.len() && ours.iter().zip(&theirs).all(|(a, b)| same(*a, *b)), "{ours:?} {theirs:?}");
}

#[test]
fn intervals_and_tests_equal_those_of_scipy_and_statsmodels() {
    let count = |value: &Value| value.as_u64().unwrap() as usize;
    for case in reference("wilson") {
        all_same(&wilson95(count(&case["successes"]), count(&case["trials"])), &case["interval"]);
    }
    for case in reference("mcnemar") {
        let (ours, theirs) =
            (mcnemar::mcnemar(count(&case["only"][0]), count(&case["only"][1])), case["p"].as_f64().unwrap());
        assert!((ours / theirs - 1.0).abs() < 1e-6, "{ours} {theirs}");
    }
    for case in reference("holm") {
        all_same(&holm(&numbers(&case["p"])), &case["corrected"]);
    }
    for case in reference("wilcoxon") {
        let test = wilcoxon::signed_rank(&numbers(&case["differences"]));
        let theirs = ["positive", "negative"].map(|name| case[name].as_f64().unwrap());
        assert_eq!([test.positive, test.negative], theirs);
        assert!((test.p / case["p"].as_f64().unwrap() - 1.0).abs() < 1e-6, "{test:?} {case}");
    }
    // Darwin's maize: 24 of the 120 is the printed sum of negative ranks.
    assert_eq!(reference("wilcoxon")[0]["negative"], 24.0);
    for case in reference("median") {
        let (median, interval) = median_interval(&numbers(&case["values"])).unwrap();
        assert!(same(median, case["median"].as_f64().unwrap()));
        all_same(&interval, &case["interval"]);
    }
    for case in reference("power_law") {
        let points: Vec<(f64, f64)> = numbers(&case["x"]).into_iter().zip(numbers(&case["y"])).collect();
        let law = exponent::fit(&points).unwrap();
        assert!(same(law.exponent, case["exponent"].as_f64().unwrap()));
        assert!((law.factor / case["factor"].as_f64().unwrap() - 1.0).abs() < 1e-6);
        all_same(&law.interval, &case["interval"]);
    }
}

#[test]
fn profiles_equal_those_counted_problem_by_problem() {
    for case in reference("performance_profile") {
        let costs: Vec<Vec<f64>> = case["costs"].as_array().unwrap().iter().map(numbers).collect();
        for (method, ratios) in performance_profile::ratios(&costs).iter().enumerate() {
            let share = |tau: &f64| performance_profile::count_within(ratios, *tau) as f64 / costs.len() as f64;
            let shares: Vec<f64> = numbers(&case["multiples"]).iter().map(share).collect();
            all_same(&shares, &case["shares"][method]);
        }
    }
    for case in reference("data_profile") {
        let solved: Vec<(f64, usize)> =
            case["solved"].as_array().unwrap().iter().map(numbers).map(|pair| (pair[0], pair[1] as usize)).collect();
        let budgets = data_profile::budgets(&solved);
        let share = |bound: &f64| performance_profile::count_within(&budgets, *bound) as f64 / solved.len() as f64;
        all_same(&numbers(&case["budgets"]).iter().map(share).collect::<Vec<_>>(), &case["shares"]);
    }
}

/// The bootstrap's interval covers the true median about as often as it says.
#[test]
fn median_intervals_cover() {
    let mut rng = seed::data_stream(3, 1);
    for n in [25, 60] {
        let covered = (0..400).filter(|_| {
            let values: Vec<f64> = (0..n).map(|_| rng.random::<f64>()).collect();
            let (_, [low, high]) = median_interval(&values).unwrap();
            low <= 0.5 && 0.5 <= high
        });
        let covered = covered.count();
        assert!((360..=394).contains(&covered), "{covered} of 400 for n = {n}");
    }
}

/// Two methods on 200 trials: success and error of each as told.
fn two_methods(outcome: impl Fn(usize, usize) -> (bool, f64)) -> (Experiment, Plan, Vec<Record>) {
    let text = "trials = 200\n[[scenario]]\nname = \"cloud3\"\n[[method]]\nname = \"a\"\n[[method]]\nname = \"b\"\n";
    let lab = Lab::default();
    let experiment = Experiment::parse(&lab, text, "two.toml").unwrap();
    let plan = Plan::new(&lab, &experiment).unwrap();
    let blank = r#"{"experiment": "", "scenario": "cloud3", "parameters": {}, "method": "", "repetition": 0, "key": "",
        "success": false, "success_sum": false, "status": "", "usable": true, "evaluations": 5, "iterations": 0,
        "starts": 1, "isa": "", "seconds": 0.001}"#;
    let blank: Record = serde_json::from_str(blank).unwrap();
    let records = plan.trials.iter().enumerate().flat_map(|(k, trial)| {
        let key = format!("{:016x}", trial.key);
        let make = |method: usize| {
            let (success, error) = outcome(method, k);
            let method = ["a", "b"][method].to_string();
            Record { key: key.clone(), method, success, error: Some(error), ..blank.clone() }
        };
        [make(0), make(1)]
    });
    let records = records.collect();
    (experiment, plan, records)
}

/// p by McNemar and by Wilcoxon, both by Holm, as the statistics' tables give them.
fn p_values((experiment, plan, records): &(Experiment, Plan, Vec<Record>)) -> [f64; 2] {
    let groups = groups(experiment, plan, records);
    assert_eq!(groups.len(), 1);
    ["mcnemar", "wilcoxon"].map(|name| {
        let entry = cfpose_lab::statistics::ALL.iter().find(|entry| entry.name == name).unwrap();
        let table = (entry.compute)(&groups[0]).unwrap();
        let value = serde_json::to_value(&table).unwrap();
        value["rows"][0].as_array().unwrap().last().unwrap().as_f64().unwrap()
    })
}

#[test]
fn a_planted_difference_is_found_and_none_where_there_is_none() {
    let mut rng = seed::data_stream(9, 9);
    let (mut found, mut alarms) = ([0; 2], [0; 2]);
    const SEEDS: usize = 100;
    for _ in 0..SEEDS {
        let hard: Vec<f64> = (0..200).map(|_| rng.random()).collect();
        let noise: Vec<f64> = (0..400).map(|_| rng.random()).collect();
        // Trials are as hard for both methods: a solves those below 80 %, b those below 90 %; b's errors are 10 % smaller.
        let planted = two_methods(|method, k| {
            let error = hard[k] * (0.9 + 0.2 * noise[2 * k + method]) * (1.0 - 0.1 * method as f64);
            (hard[k] < 0.8 + 0.1 * method as f64, error)
        });
        for (count, p) in found.iter_mut().zip(p_values(&planted)) {
            *count += usize::from(p < 0.05);
        }
        // The same method twice, each with its own luck.
        let equal = two_methods(|method, k| {
            let luck = noise[2 * k + method];
            (hard[k] + 0.2 * luck < 0.9, hard[k] * (0.9 + 0.2 * luck))
        });
        for (count, p) in alarms.iter_mut().zip(p_values(&equal)) {
            *count += usize::from(p < 0.05);
        }
    }
    assert_eq!(found, [SEEDS; 2]);
    // At most 5 in 100 are expected; 11 or more have probability 1 %.
    assert!(alarms.iter().all(|count| *count <= 10), "{alarms:?}");
    // A against A itself: nothing differs at all.
    assert_eq!(p_values(&two_methods(|_, k| (k % 3 == 0, k as f64))), [1.0; 2]);
}
