//! The preset `auto` and pipelines from files: what the program reads and reports.

mod common;

use common::{Desk, apply, cloud, degrees_between, euler_pose, pose_of, random_pose, shuffle};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha12Rng;
use serde_json::{Value, json};

/// Add a sum of twelve uniform numbers, which is nearly normal, with this standard deviation.
fn add_noise(rows: &mut [Vec<f64>], sigma: f64, seed: u64) {
    let mut rng = ChaCha12Rng::seed_from_u64(seed);
    for value in rows.iter_mut().flatten() {
        *value += sigma * ((0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0);
    }
}

/// A cloud and its moved, shuffled copy with noise.
fn noisy_pair(count: usize, sigma: f64) -> (Desk, cfpose::Pose) {
    let desk = Desk::new();
    let truth = random_pose(21, 0.5);
    let rows = cloud(count, 22);
    let mut moved = apply(&truth, &rows);
    shuffle(&mut moved, 23);
    add_noise(&mut moved, sigma, 24);
    desk.write_rows("p.csv", &rows);
    desk.write_rows("q.csv", &moved);
    (desk, truth)
}

const RIGID: &str = "estimate --model rigid3 --source p.csv --target q.csv";

#[test]
fn two_files_are_enough_and_the_statistics_are_reported() {
    let (desk, truth) = noisy_pair(700, 0.04);
    let result = desk.json(RIGID);
    assert!(degrees_between(&pose_of(&result["pose"]), &truth) < 2.0, "{result}");
    assert_eq!(
        (&result["preset"], &result["weighting"], &result["sampling"]),
        (&json!("auto"), &json!("two-step"), &json!("same"))
    );
    assert_eq!(
        (&result["verdict"], &result["clutter"], &result["refined"]),
        (&json!("good"), &Value::Null, &json!(false))
    );
    let covariance: Vec<Vec<f64>> = serde_json::from_value(result["covariance"].clone()).unwrap();
    assert_eq!(covariance.iter().map(Vec::len).collect::<Vec<_>>(), [6; 6]);
    for i in 0..6 {
        assert!(covariance[i][i] > 0.0);
        assert!(
            (0..6).all(|j| (covariance[i][j] - covariance[j][i]).abs() < 1e-9 * covariance[i][i].max(covariance[j][j]))
        );
    }
    let number = |name: &str| result[name].as_f64().unwrap_or_else(|| panic!("{name}: {result}"));
    assert!((number("noise_sigma") / 0.04 - 1.0).abs() < 0.15, "{result}");
    let dof = number("degrees_of_freedom");
    let expected = cfpose::statistics::chi_square_tail(number("j_statistic"), dof as usize);
    assert!(dof > 10.0 && (number("p_value") - expected).abs() < 1e-12, "{result}");
    let stages = result["stages"].as_array().unwrap();
    let names: Vec<&Value> = stages.iter().map(|stage| &stage["name"]).collect();
    assert_eq!(names, [&json!("waves"), &json!("weighted")]);
    let sum = |field: &str| stages.iter().map(|stage| stage[field].as_u64().unwrap()).sum::<u64>();
    assert_eq!(sum("evaluations"), result["evaluations"].as_u64().unwrap());
    assert!(sum("solves") >= 2);
    // The table for people says the same.
    let table = desk.run(RIGID).out;
    assert!(["verdict", "good", "degrees of freedom", "noise"].iter().all(|word| table.contains(word)), "{table}");
}

#[test]
fn the_sampling_is_taken_as_given() {
    let (desk, _) = noisy_pair(500, 0.01);
    desk.write("moments.toml", MOMENTS);
    let mut kept = Vec::new();
    for sampling in ["same", "thinned", "independent"] {
        let result = desk.json(&format!("{RIGID} --sampling {sampling} --pipeline moments.toml"));
        assert_eq!(result["sampling"], sampling);
        kept.push(result["j_statistic"].as_f64().unwrap());
    }
    // Equal counts: a random part of all is all. Independent samples would differ by much more than these do.
    assert_eq!(kept[0], kept[1]);
    assert!(kept[2] < 0.5 * kept[0], "{kept:?}");
    let wrong = desk.run(&format!("{RIGID} --sampling random"));
    assert!(wrong.code == 2 && wrong.err.contains("independent"), "{}", wrong.err);
}

/// Waves from principal axes, and one weighted stage.
const MOMENTS: &str = r#"
global-start = "pca"
support = true

[[stage]]
name = "near"
features = "fourier[k=2,w0=1.2,damping=0.4]"

[[stage]]
name = "exact"
features = "fourier[k=2,w0=1.5]"
weighting = "two-step"
noise = "isotropic"
"#;

#[test]
fn stages_come_from_a_file() {
    let (desk, truth) = noisy_pair(500, 0.02);
    desk.write("stages.toml", MOMENTS);
    let result = desk.json(&format!("{RIGID} --pipeline stages.toml"));
    assert!(degrees_between(&pose_of(&result["pose"]), &truth) < 2.0, "{result}");
    let names: Vec<&Value> = result["stages"].as_array().unwrap().iter().map(|stage| &stage["name"]).collect();
    assert_eq!(names, [&json!("near"), &json!("exact")]);
    assert_eq!(result["features"], "fourier[k=2,w0=1.5]");
    // A flag beside the file wins in the last stage.
    let result = desk.json(&format!("{RIGID} --pipeline stages.toml --features hermite[degree=3]"));
    assert_eq!(result["features"], "hermite[degree=3]");
}

/// The page that explains the keys shows a file that runs.
#[test]
fn the_pipeline_of_the_documentation_runs() {
    let page = include_str!("../../../docs/method.md");
    let (_, rest) = page.split_once("```toml\n").unwrap();
    let (example, _) = rest.split_once("```").unwrap();
    let (desk, truth) = seen_curve(2.0);
    desk.write("stages.toml", example);
    let result = desk.json(&format!("{SEEN} --pipeline stages.toml"));
    assert!(degrees_between(&pose_of(&result["pose"]), &truth) < 3.0, "{result}");
    assert_eq!(result["stages"].as_array().unwrap().len(), 2);
}

#[test]
fn a_wrong_pipeline_file_is_refused_where_it_is_wrong() {
    let (desk, _) = noisy_pair(50, 0.0);
    let line = format!("{RIGID} --pipeline bad.toml");
    let fails = |content: &str, expected: &[&str]| {
        desk.write("bad.toml", content);
        let message = desk.fails(3, &line);
        assert!(expected.iter().all(|part| message.contains(part)), "{message}");
    };
    fails(
        &MOMENTS.replace("damping", "dampin").replace("weighting", "weigting"),
        &["bad.toml: line 12: ", "weigting", "weighting"],
    );
    fails(&MOMENTS.replace("global-start", "global_start"), &["bad.toml: line 2: ", "global_start"]);
    fails(&MOMENTS.replace("\"isotropic\"", "\"round\""), &["bad.toml: line 13: ", "round", "isotropic"]);
    fails("restarts = 3\n", &["bad.toml: ", "stage"]);
    fails("stage = []\n", &["bad.toml: no [[stage]]"]);
    fails("[[stage]\n", &["bad.toml: line 1: "]);
    let absent = desk.fails(3, &format!("{RIGID} --pipeline absent.toml"));
    assert!(absent.starts_with("error: absent.toml: "), "{absent}");
}

#[test]
fn outliers_are_counted() {
    let (desk, truth) = noisy_pair(600, 0.01);
    let mut text = desk.read("q.csv");
    let mut rng = ChaCha12Rng::seed_from_u64(5);
    let centre = truth.apply([0.7, 0.4, 0.2]);
    for _ in 0..60 {
        let point: Vec<String> = centre.iter().map(|c| (c + 3.0 * rng.random::<f64>() - 1.5).to_string()).collect();
        text += &(point.join(",") + "\n");
    }
    desk.write("q.csv", text);
    let result = desk.json(RIGID);
    assert!(degrees_between(&pose_of(&result["pose"]), &truth) < 2.0, "{result}");
    let clutter = result["clutter"].as_f64().unwrap_or_else(|| panic!("{result}"));
    // Some of the 60 of 660 fall onto the cloud.
    assert!(clutter > 0.05 && clutter < 0.12, "{clutter}");
    assert!(result["warnings"].to_string().contains("outliers"), "{result}");
}

const SEEN: &str =
    "estimate --model plane-bearing --source p.csv --target q.csv --start=0,0,0,0,0,0 --camera 600,600,320,240";

/// A curve without symmetry in the plane of depth 1 and its image, in pixels, with noise of so many pixels.
fn seen_curve(sigma: f64) -> (Desk, cfpose::Pose) {
    let desk = Desk::new();
    let truth = euler_pose([0.1, -0.12, 0.2], [0.05, -0.04, 0.03]);
    let plane: Vec<Vec<f64>> = (0..800)
        .map(|k| {
            let t = std::f64::consts::TAU * f64::from(k) / 800.0;
            let r = 0.3 * (1.0 + 0.3 * (3.0 * t).cos() + 0.2 * (2.0 * t).sin() + 0.15 * (t + 0.7).cos());
            vec![r * t.cos(), r * t.sin(), 1.0]
        })
        .collect();
    let pixel = |p: &Vec<f64>| vec![600.0 * p[0] / p[2] + 320.0, 600.0 * p[1] / p[2] + 240.0];
    let mut seen: Vec<Vec<f64>> = apply(&truth, &plane).iter().map(pixel).collect();
    add_noise(&mut seen, sigma, 31);
    desk.write_rows("p.csv", &plane.iter().map(pixel).collect::<Vec<_>>());
    desk.write_rows("q.csv", &seen);
    (desk, truth)
}

#[test]
fn noise_is_in_pixels_where_the_target_is() {
    let (desk, truth) = seen_curve(6.0);
    let result = desk.json(SEEN);
    let sigma = result["noise_sigma"].as_f64().unwrap();
    assert!((sigma / 6.0 - 1.0).abs() < 0.1, "{sigma} pixels");
    assert!(degrees_between(&pose_of(&result["pose"]), &truth) < 3.0, "{result}");
}
