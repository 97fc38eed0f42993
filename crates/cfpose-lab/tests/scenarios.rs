//! The parameters of the scenarios: what they add, and that the trials of the others stay as they were.

use std::path::{Path, PathBuf};

use cfpose::entry::find;
use cfpose::{Points, Pose, Settings, Start};
use cfpose_lab::method::Method;
use cfpose_lab::{Lab, Scenario, Trial, scenarios, seed};

fn scenario(spec: &str) -> Box<dyn Scenario> {
    let (entry, parameters) = find("scenario", scenarios::ALL, spec).unwrap();
    (entry.build)(&parameters).unwrap()
}

fn trial(spec: &str, stream: u64) -> Trial {
    scenario(spec).trial(&mut seed::data_stream(1, stream)).unwrap()
}

fn rows(points: &Points) -> Vec<[f64; 3]> {
    (0..points.len()).map(|k| points.point(k)).collect()
}

/// Rows in an order of their own, so that permutations can be compared.
fn sorted(points: &Points) -> Vec<[f64; 3]> {
    let mut rows = rows(points);
    rows.sort_by(|a, b| a.partial_cmp(b).unwrap());
    rows
}

fn pose(trial: &Trial) -> Pose {
    Pose { rotation: trial.truth[..9].try_into().unwrap(), translation: trial.truth[9..].try_into().unwrap() }
}

/// Sums over a trial, computed by the version of the scenarios before they learned these parameters.
#[test]
fn old_trials_are_unchanged() {
    for (spec, expected) in OLD {
        let trial = trial(spec, 0);
        let sum = |points: &Points| {
            rows(points).iter().enumerate().map(|(k, p)| (k + 1) as f64 * (p[0] + 2.0 * p[1] + 3.0 * p[2])).sum::<f64>()
        };
        let found = [sum(&trial.source), sum(&trial.target)];
        for (a, b) in found.iter().zip(expected) {
            assert!((a - b).abs() <= 1e-9 * b.abs().max(1.0), "{spec}: {found:?}");
        }
    }
}

const OLD: [(&str, [f64; 2]); 3] = [
    ("planar-curve[b_p=0.02,b_m=1,outliers=9,uniform_outliers=11]", [233_695.418_160_399_04, -219_328.476_642_980_3]),
    ("cloud3[points=200,noise=0.01]", [946.462_538_229_553_3, 34_459.039_199_879_786]),
    ("cloud3[shape=4,points=150,sampling=independent]", [1_727.906_802_548_32, 17_837.504_886_241_12]),
];

#[test]
fn without_a_guess_the_method_keeps_a_start_of_its_own() {
    let none = trial("planar-curve[start=none]", 3);
    let guess = trial("planar-curve", 3);
    assert_eq!(none.start, None);
    // The same draws: only the start is left out.
    assert_eq!((&none.source, &none.target, &none.truth), (&guess.source, &guess.target, &guess.truth));
    let start = guess.start.unwrap();
    let settings = |method: &Method, start| method.settings("plane-bearing", start, 1).unwrap().start;
    let paper = Method::of_preset("paper");
    let preset = Settings::preset("paper", "plane-bearing").unwrap().start;
    assert_eq!(settings(&paper, Some(&start)), Some(Start::Given(vec![start.clone()])));
    assert_eq!(settings(&paper, None), preset);
    let named = |name: &str| Method { start: name.to_string(), ..paper.clone() };
    assert_eq!(settings(&named("auto"), Some(&start)), preset);
    assert_eq!(settings(&named("grid"), None), Some(Start::Named("grid".to_string())));
    assert!(named("auto").check(&Lab::default().registry, "plane-bearing").is_ok());
}

#[test]
fn drawn_poses_differ_from_trial_to_trial_and_explain_the_image() {
    for theta in ["random", "anywhere"] {
        let spec = format!("planar-curve[theta={theta},b_i=0]");
        let trials: Vec<Trial> = (0..3).map(|stream| trial(&spec, stream)).collect();
        assert!(trials[0].truth != trials[1].truth && trials[1].truth != trials[2].truth);
        for trial in &trials {
            assert_eq!(trial.start.as_ref(), Some(&trial.truth));
            let pose = pose(trial);
            for (p, q) in rows(&trial.source).iter().zip(rows(&trial.target)) {
                let [x, y, z] = pose.apply([p[0], p[1], 1.0]);
                assert!(z > 0.1 && (x / z - q[0]).abs() < 1e-12 && (y / z - q[1]).abs() < 1e-12);
            }
        }
    }
}

#[test]
fn shuffled_curves_hold_the_same_points_without_their_order() {
    let (ordered, shuffled) = (trial("planar-curve", 5), trial("planar-curve[order=shuffled]", 5));
    assert!(ordered.source.is_in_curve_order() && !shuffled.source.is_in_curve_order());
    assert!(!ordered.target.is_in_curve_order());
    for (a, b) in [(&ordered.source, &shuffled.source), (&ordered.target, &shuffled.target)] {
        assert_ne!(rows(a), rows(b));
        assert_eq!(sorted(a), sorted(b));
    }
    // The two sides are permuted apart: nothing matches by position.
    let pose = pose(&shuffled);
    let matching = rows(&shuffled.source).into_iter().zip(rows(&shuffled.target)).filter(|(p, q)| {
        let [x, y, z] = pose.apply([p[0], p[1], 1.0]);
        (x / z - q[0]).hypot(y / z - q[1]) < 1e-9
    });
    assert!(matching.count() < 10);
}

/// Bring the target back into the frame of the source.
fn back(trial: &Trial) -> Vec<[f64; 3]> {
    let Pose { rotation: r, translation: t } = pose(trial);
    let inverse = |q: &[f64; 3]| [0, 1, 2].map(|i| (0..3).map(|k| r[3 * k + i] * (q[k] - t[k])).sum::<f64>());
    rows(&trial.target).iter().map(inverse).collect()
}

fn nearest(p: &[f64; 3], cloud: &[[f64; 3]]) -> f64 {
    let distance = |q: &[f64; 3]| (0..3).map(|d| (p[d] - q[d]).powi(2)).sum::<f64>().sqrt();
    cloud.iter().map(distance).fold(f64::INFINITY, f64::min)
}

#[test]
fn overlap_cuts_the_target_by_a_plane() {
    for sampling in ["permutation", "independent"] {
        let trial = trial(&format!("cloud3[points=600,overlap=0.5,sampling={sampling}]"), 11);
        assert_eq!((trial.source.len(), trial.target.len()), (600, 300));
        let (source, target) = (rows(&trial.source), back(&trial));
        if sampling == "permutation" {
            assert!(target.iter().all(|p| nearest(p, &source) < 1e-12));
        }
        // The kept half and the lost half are apart along the line between their means.
        let lost: Vec<[f64; 3]> = source.iter().filter(|p| nearest(p, &target) > 0.15).copied().collect();
        assert!(lost.len() > 100, "{}", lost.len());
        let mean = |cloud: &[[f64; 3]]| [0, 1, 2].map(|d| cloud.iter().map(|p| p[d]).sum::<f64>() / cloud.len() as f64);
        let (a, b) = (mean(&target), mean(&lost));
        let apart = (0..3).map(|d| (a[d] - b[d]).powi(2)).sum::<f64>().sqrt();
        assert!(apart > 0.5, "{apart}");
    }
    assert_eq!(trial("cloud3[points=10,overlap=0.01]", 1).target.len(), 4);
}

#[test]
fn opposite_ends_of_both_sides_are_cut_so_that_a_share_is_common() {
    let trial = trial("cloud3[points=600,overlap=0.5,cut=both]", 7);
    assert_eq!((trial.source.len(), trial.target.len()), (400, 400));
    let (source, target) = (rows(&trial.source), back(&trial));
    let common = target.iter().filter(|q| nearest(q, &source) < 1e-9).count();
    assert_eq!(common, 200);
}

#[test]
fn intruders_stand_beside_the_shape_and_noise_is_on_both_sides() {
    for (intruder, reach) in [("blob", 2.2), ("object", 3.0), ("ground", 4.0), ("copy", 4.0)] {
        let trial = trial(&format!("cloud3[points=500,intruder={intruder},intruder_share=0.3]"), 8);
        let source = rows(&trial.source);
        let others: Vec<[f64; 3]> = back(&trial).into_iter().filter(|q| nearest(q, &source) > 1e-9).collect();
        assert_eq!((trial.target.len(), others.len()), (650, 150), "{intruder}");
        let far = others.iter().map(|q| q.iter().map(|x| x * x).sum::<f64>().sqrt()).fold(0.0, f64::max);
        assert!((0.8..reach).contains(&far), "{intruder}: {far}");
    }
    let clean = trial("cloud3[points=500,noise=0.02]", 9);
    let noisy = trial("cloud3[points=500,noise=0.02,noise_on=both]", 9);
    assert_eq!(rows(&clean.target), rows(&noisy.target));
    let square: f64 = rows(&clean.source)
        .iter()
        .flatten()
        .zip(rows(&noisy.source).iter().flatten())
        .map(|(a, b)| (a - b).powi(2))
        .sum();
    assert!((square / 1500.0).sqrt() / 0.02 > 0.9 && (square / 1500.0).sqrt() / 0.02 < 1.1);
}

#[test]
fn a_start_may_be_off_by_a_distance_too() {
    let trial = trial("cloud3[points=50,start=3,start_offset=0.02]", 1);
    let start = trial.start.clone().unwrap();
    let off = (9..12).map(|d| (start[d] - trial.truth[d]).powi(2)).sum::<f64>().sqrt();
    assert!((off - 0.02).abs() < 1e-12, "{off}");
}

#[test]
fn arcs_are_hidden_and_second_curves_added() {
    let whole = trial("planar-curve[order=shuffled]", 4);
    let (n, m) = (whole.source.len(), whole.target.len());
    let share = |points: usize, of: f64| (points as f64 * of).round() as usize;
    let hidden = trial("planar-curve[order=shuffled,hidden=0.2,hidden_source=0.1]", 4);
    assert_eq!((hidden.source.len(), hidden.target.len()), (n - share(n, 0.1), m - share(m, 0.2)));
    let second = trial("planar-curve[order=shuffled,second_curve=0.2,source_noise=0.01]", 4);
    assert_eq!((second.source.len(), second.target.len()), (n, m + share(n, 0.2)));
    let known = sorted(&whole.source);
    assert!(rows(&second.source).iter().all(|p| !known.contains(p)));
}

#[test]
fn clutter_is_added_in_the_enlarged_box() {
    let trial = trial("cloud3[points=400,clutter=0.3]", 13);
    assert_eq!((trial.source.len(), trial.target.len()), (400, 520));
    let (source, target) = (rows(&trial.source), back(&trial));
    let (inliers, clutter): (Vec<_>, Vec<_>) = (0..520).partition(|k| nearest(&target[*k], &source) < 1e-12);
    assert_eq!((inliers.len(), clutter.len()), (400, 120));
    let target = rows(&trial.target);
    for d in 0..3 {
        let range = |indices: &[usize]| {
            let values = indices.iter().map(|k| target[*k][d]);
            values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)))
        };
        let ((low, high), (least, most)) = (range(&inliers), range(&clutter));
        let margin = 0.1 * (high - low) + 1e-12;
        assert!(least >= low - margin && most <= high + margin);
        // It fills the box: 120 points leave less than a tenth free at each end.
        assert!(least < low + 0.1 * (high - low) && most > high - 0.1 * (high - low), "{d}");
    }
    // It stands anywhere in the order.
    assert!(clutter.iter().any(|k| *k < 50) && inliers.iter().any(|k| *k > 470));
}

#[test]
fn a_shape_may_be_a_file_beside_the_experiment() {
    let folder = tempfile::tempdir().unwrap();
    let cloud: String = (0..30).map(|k| format!("{},{},{}\n", k, k * k % 17, k * 7 % 11)).collect();
    std::fs::write(folder.path().join("cloud.csv"), cloud).unwrap();
    let mut scenario = scenario("cloud3[shape=cloud.csv,points=30]");
    let rng = || seed::data_stream(1, 1);
    assert_eq!(scenario.trial(&mut rng()).unwrap_err().to_string(), "shape: its file was not loaded");
    scenario.load(folder.path()).unwrap();
    let trial = scenario.trial(&mut rng()).unwrap();
    let norms = rows(&trial.source).into_iter().map(|p| p.iter().map(|x| x * x).sum::<f64>().sqrt());
    assert!((norms.fold(0.0, f64::max) - 1.0).abs() < 1e-12);
    let problem = |spec: &str| self::scenario(spec).load(folder.path()).unwrap_err().to_string();
    assert_eq!(problem("cloud3[shape=cloud.csv,points=31]"), "points = 31, but the shape's file holds 30 and no faces");
    assert!(
        problem("cloud3[shape=absent.ply]").starts_with("shape: there is no file absent.ply beside the experiment")
    );
    std::fs::write(folder.path().join("bad.csv"), "1,2,3\n1,x,3\n").unwrap();
    assert!(problem("cloud3[shape=bad.csv]").contains("bad.csv: line 2: y is \"x\", not a number"));
}

/// Return the folder of real data.
fn data() -> PathBuf {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    std::env::var_os("CFPOSE_DATA").map_or(root, PathBuf::from)
}

#[test]
#[cfg_attr(not(shared_data), ignore = "no real data: set CFPOSE_DATA to their folder")]
fn the_bunny_is_sampled_on_its_surface() {
    let file = data().join("bunny/stanford-bunny.obj");
    let load = |spec: String| {
        let mut scenario = scenario(&spec);
        scenario.load(Path::new("")).unwrap();
        scenario.trial(&mut seed::data_stream(1, 1)).unwrap()
    };
    let spec = |sampling: &str| format!("cloud3[shape={},points=3000,sampling={sampling}]", file.display());
    let (same, anew) = (load(spec("permutation")), load(spec("independent")));
    assert_eq!(same.source, anew.source);
    let source = rows(&same.source);
    assert!(source.iter().all(|p| p.iter().map(|x| x * x).sum::<f64>() <= 1.0 + 1e-12));
    let near = |trial: &Trial| back(trial).iter().filter(|p| nearest(p, &source) < 1e-9).count();
    assert_eq!(near(&same), 3000);
    assert_eq!(near(&anew), 0);
    // Both samples lie on one surface of area about 6: the spacing of 3000 points is about 0.045.
    let far = back(&anew).iter().map(|p| nearest(p, &source)).fold(0.0, f64::max);
    assert!(far < 0.25, "{far}");
}
