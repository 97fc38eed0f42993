//! What `estimate` finds on data with a known answer, and where it writes it.

mod common;

use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};

use common::{Desk, apply, cloud, degrees_between, euler_pose, pose_of, random_pose, shuffle};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha12Rng;
use serde_json::{Value, json};

fn motivation() -> Desk {
    let desk = Desk::new();
    desk.write("p.csv", "1\n2\n3\n4\n");
    desk.write("q.csv", "2\n3\n1\n4\n");
    desk
}

#[test]
fn the_motivation_example_gives_one_and_the_papers_correspondence() {
    let desk = motivation();
    let line = "estimate --model gain1 --source p.csv --target q.csv --features coordinates";
    let result = desk.json(line);
    assert_eq!(result["theta"], json!([1.0]));
    assert_eq!(result["correspondence"], json!([3, 1, 2, 4]));
    // From a start elsewhere it has to be found.
    let result = desk.json(&format!("{line} --start 0.3"));
    assert!((result["theta"][0].as_f64().unwrap() - 1.0).abs() < 1e-12, "{result}");
    assert_eq!(result["correspondence"], json!([3, 1, 2, 4]));
}

#[test]
fn every_field_of_the_contract_is_there() {
    let desk = motivation();
    let result =
        desk.json("estimate --model gain1 --preset paper --source p.csv --target q.csv --sampling same --seed 7");
    let names: Vec<&str> = result.as_object().unwrap().keys().map(String::as_str).collect();
    let expected = "schema model features solver normalise weighting preset sampling seed isa num_source num_target theta rotation_form free \
                    pose homography correspondence cost status usable iterations evaluations starts seconds covariance \
                    j_statistic degrees_of_freedom p_value noise_sigma verdict message alternatives warnings condition \
                    clutter refined evidence stray stray_source undetermined prior covariance_at_centroid stages by minimised";
    assert_eq!(names, expected.split_whitespace().collect::<Vec<_>>());
    assert_eq!(result["schema"], "cfpose.estimate/2");
    assert_eq!(
        [&result["features"], &result["solver"], &result["normalise"], &result["weighting"], &result["preset"]],
        ["trig18", "levenberg-marquardt", "paper", "identity", "paper"]
    );
    assert_eq!((&result["sampling"], &result["seed"]), (&json!("same"), &json!(7)));
    assert_eq!((&result["free"], &result["pose"]), (&json!(["gain"]), &Value::Null));
}

#[test]
fn a_cloud_finds_its_rotated_and_permuted_copy() {
    let desk = Desk::new();
    let truth = random_pose(3, 2.0);
    let rows = cloud(2000, 1);
    let mut moved = apply(&truth, &rows);
    shuffle(&mut moved, 2);
    desk.write_rows("p.xyz", &rows);
    desk.write_rows("q.csv", &moved);
    let line = "estimate --model rigid3 --source p.xyz --target q.csv --features hermite[degree=3] --start pca";
    let result = desk.json(line);
    let found = pose_of(&result["pose"]);
    assert!(degrees_between(&found, &truth) < 1e-6, "{}", degrees_between(&found, &truth));
    assert_eq!(result["correspondence"], Value::Null); // 1000 points and more: only when asked for
    assert_eq!((&result["starts"], &result["usable"]), (&json!(4), &json!(true)));

    // Same seed, same bytes, for any number of threads; only the time differs.
    let without_time = |mut value: Value| {
        value["seconds"] = Value::Null;
        value.to_string()
    };
    let first = without_time(result);
    for threads in [1, 3] {
        assert_eq!(without_time(desk.json(&format!("{line} --threads {threads}"))), first);
    }
}

#[test]
fn outputs_go_to_files() {
    let desk = Desk::new();
    let truth = random_pose(5, 1.0);
    let rows = cloud(300, 4);
    desk.write_rows("p.csv", &rows);
    desk.write_rows("q.csv", &apply(&truth, &rows));
    let line = "estimate --model rigid3 --source p.csv --target q.csv --features hermite --start pca";
    let run = desk.run(&format!("{line} --json r.json --pose-out pose.txt --transformed-out moved.ply"));
    assert_eq!((run.code, run.err.as_str()), (0, ""));
    assert!(run.out.contains("rotation") && run.out.contains("status"), "{}", run.out);
    let result: Value = serde_json::from_str(&desk.read("r.json")).unwrap();
    let correspondence: Vec<usize> = serde_json::from_value(result["correspondence"].clone()).unwrap();
    assert_eq!(correspondence, (1..=300).collect::<Vec<_>>());

    // The pose file holds the same bits; every form of it reads back.
    let pose = pose_of(&result["pose"]);
    assert_eq!(desk.read("pose.txt"), desk.run("pose convert r.json --to matrix").out);
    for form in ["matrix", "tum", "kitti", "json"] {
        desk.write(&format!("pose.{form}"), desk.run(&format!("pose convert pose.txt --to {form}")).out);
        let back: Value = serde_json::from_str(&desk.run(&format!("pose convert pose.{form} --to json")).out).unwrap();
        assert!(degrees_between(&pose_of(&back), &pose) < 1e-12, "{form}");
        assert_eq!(pose_of(&back).translation, pose.translation, "{form}");
    }

    // The transformed points lie on the target; a result is a start, and so is a pose.
    let again = "estimate --model rigid3 --preset paper --target q.csv --features hermite";
    let identity = desk.json(&format!("{again} --source moved.ply"));
    let angle = degrees_between(&pose_of(&identity["pose"]), &random_identity());
    assert!(angle < 1e-6, "{angle}");
    for start in ["r.json", "pose.txt"] {
        let warm = desk.json(&format!("{again} --source p.csv --start {start}"));
        assert!(warm["iterations"].as_u64().unwrap() <= 2, "{warm}");
        assert!(degrees_between(&pose_of(&warm["pose"]), &truth) < 1e-6);
    }
}

/// A cloud of 60 points and its moved copy, in another order.
fn small_pair() -> (Desk, cfpose::Pose) {
    let desk = Desk::new();
    let truth = random_pose(15, 1.0);
    let rows = cloud(60, 14);
    let mut moved = apply(&truth, &rows);
    shuffle(&mut moved, 16);
    desk.write_rows("p.csv", &rows);
    desk.write_rows("q.csv", &moved);
    (desk, truth)
}

const SMALL: &str = "estimate --model rigid3 --preset paper --source p.csv --target q.csv --features hermite";

#[test]
fn a_result_is_a_start_in_the_form_it_was_written_in_and_for_its_own_model() {
    let (desk, truth) = small_pair();
    for form in ["vector", "euler", "euler-zxz", "quaternion"] {
        let first = desk.json(&format!("{SMALL} --start pca --rotation {form}"));
        assert_eq!(first["rotation_form"], form);
        desk.write("r.json", first.to_string());
        // The reader's own form does not matter.
        let warm = desk.json(&format!("{SMALL} --start r.json --rotation euler-xyz"));
        assert!(warm["iterations"].as_u64().unwrap() <= 2, "{form}: {warm}");
        assert!(degrees_between(&pose_of(&warm["pose"]), &truth) < 1e-6);
    }
    // Angles in another order: R = Rz Rx Rz of the listed angles.
    let result = desk.json(&format!("{SMALL} --start pca --rotation euler-zxz"));
    let theta: Vec<f64> = serde_json::from_value(result["theta"].clone()).unwrap();
    let order: cfpose::theta::EulerOrder = "zxz".parse().unwrap();
    let matrix = order.matrix(&[theta[0], theta[1], theta[2]]);
    let found = pose_of(&result["pose"]).rotation;
    assert!(matrix.iter().zip(found).all(|(a, b)| (a - b).abs() < 1e-12));
    // A result without the field stands in the form of the flag, as before.
    let mut old = desk.json(&format!("{SMALL} --start pca --rotation quaternion"));
    old.as_object_mut().unwrap().remove("rotation_form");
    desk.write("old.json", old.to_string());
    assert!(desk.json(&format!("{SMALL} --start old.json --rotation quaternion"))["iterations"].as_u64().unwrap() <= 2);

    let other = SMALL.replace("rigid3", "similarity3");
    let refused = "error: r.json: this is a result of model `rigid3`, not of `similarity3`; give numbers or a pose";
    assert_eq!(desk.fails(3, &format!("{other} --start r.json")), refused);
    desk.write("odd.json", r#"{"theta": [0, 0, 0, 0, 0, 0], "rotation_form": "degrees"}"#);
    let odd = desk.fails(3, &format!("{SMALL} --start odd.json"));
    assert_eq!(
        odd,
        "error: odd.json: \"rotation_form\" is \"degrees\"; it is vector, euler, euler-ORDER or quaternion"
    );
    let wrong = desk.run(&format!("{SMALL} --rotation euler-xxz"));
    assert!(wrong.code == 2 && wrong.err.contains("no axis twice in a row"), "{}", wrong.err);
}

#[test]
fn points_are_matched_one_to_one_when_asked() {
    let desk = Desk::new();
    // At the identity both first source points are nearest to target 1; one to one the second goes to target 3.
    desk.write("p.csv", "0\n1\n10\n20\n");
    desk.write("q.csv", "0.4\n20\n2.6\n8\n");
    let line = "estimate --model gain1 --source p.csv --target q.csv --features coordinates";
    let indices =
        |value: &Value| serde_json::from_value::<Vec<Option<usize>>>(value["correspondence"].clone()).unwrap();
    let nearest = [Some(1), Some(1), Some(4), Some(2)];
    for flag in ["", "--correspondence", "--correspondence=nearest"] {
        assert_eq!(indices(&desk.json(&format!("{line} {flag}"))), nearest, "{flag}");
    }
    assert_eq!(
        indices(&desk.json(&format!("{line} --correspondence=one-to-one"))),
        [Some(1), Some(3), Some(4), Some(2)]
    );
    // Fewer target points: somebody has no partner.
    desk.write("q.csv", "0.4\n20\n8\n");
    let some = indices(&desk.json(&format!("{line} --correspondence=one-to-one")));
    assert_eq!(some.iter().filter(|index| index.is_none()).count(), 1, "{some:?}");
    desk.write_rows("many.csv", &cloud(1001, 3));
    let line = "estimate --model rigid3 --source many.csv --target many.csv --correspondence=one-to-one";
    assert_eq!(
        desk.fails(2, line),
        "error: --correspondence=one-to-one takes up to 1000 points, the larger file has 1001; use --correspondence"
    );
    let wrong = desk.run(&format!("{line}s"));
    assert!(wrong.code == 2 && wrong.err.contains("one-to-one"), "{}", wrong.err);
}

#[test]
fn outputs_are_checked_before_the_work_and_none_is_left_behind() {
    let (desk, _) = small_pair();
    let line = format!("{SMALL} --start pca");
    for flag in ["--json", "--pose-out", "--transformed-out"] {
        // The solve would write iterations to standard error: there are none.
        let run = desk.run(&format!("{line} --verbose {flag} absent/x.csv"));
        assert_eq!((run.code, run.err.lines().count(), run.out.as_str()), (3, 1, ""), "{flag}: {}", run.err);
        assert!(run.err.starts_with("error: absent/x.csv: "), "{}", run.err);
    }
    let twice = desk.fails(2, &format!("{line} --json x.csv --transformed-out x.csv"));
    assert_eq!(twice, "error: two outputs go to x.csv; give each a file of its own");
    desk.write("kept.txt", "before");
    desk.fails(3, &format!("{line} --pose-out kept.txt --transformed-out absent/x.csv"));
    assert_eq!(desk.read("kept.txt"), "before");
    desk.fails(3, &format!("{line} --pose-out new.txt --transformed-out absent/x.csv"));
    assert!(!desk.path("new.txt").exists());
}

fn random_identity() -> cfpose::Pose {
    euler_pose([0.0; 3], [0.0; 3])
}

#[test]
fn two_images_of_a_scene_give_rotation_and_direction_from_near_the_truth() {
    let desk = Desk::new();
    let truth = euler_pose([0.05, -0.08, 0.12], [0.48, -0.6, 0.64]);
    let scene: Vec<Vec<f64>> = cloud(400, 8).into_iter().map(|p| vec![p[0] - 0.7, p[1] - 0.4, p[2] + 2.0]).collect();
    let image = |rows: &[Vec<f64>]| rows.iter().map(|p| vec![p[0] / p[2], p[1] / p[2]]).collect::<Vec<_>>();
    let mut second = image(&apply(&truth, &scene));
    shuffle(&mut second, 9);
    desk.write_rows("p.csv", &image(&scene));
    desk.write_rows("q.csv", &second);
    let line = "estimate --model epipolar --source p.csv --target q.csv --rotation euler";
    let result = desk.json(&format!("{line} --start=0.06,-0.07,0.11,0.49,-0.59,0.645"));
    let others = result["alternatives"].as_array().unwrap().iter().map(|other| &other["pose"]);
    let poses = std::iter::once(&result["pose"]).chain(others).map(pose_of);
    let errors: Vec<f64> = poses.map(|pose| cfpose::PoseError::between(&pose, &truth).total()).collect();
    assert!(errors.iter().any(|error| *error < 1e-6), "{errors:?}");
    assert_eq!(result["normalise"], "none");
    assert_eq!(result["theta"].as_array().unwrap().len(), 6);
}

#[test]
fn pixels_and_depth_give_a_plane_in_metres() {
    let desk = Desk::new();
    let (depth, truth) = (1.7, euler_pose([0.1, -0.12, 0.2], [0.05, -0.04, 0.03]));
    let pixel = |x: f64, y: f64| vec![600.0 * x + 320.0, 610.0 * y + 240.0];
    let plane: Vec<Vec<f64>> = cloud(500, 6).iter().map(|p| vec![0.3 * p[0] - 0.2, 0.3 * p[1] - 0.1, 1.0]).collect();
    let seen = apply(&truth, &plane);
    desk.write_rows("p.csv", &plane.iter().map(|p| pixel(p[0], p[1])).collect::<Vec<_>>());
    desk.write_rows("q.csv", &seen.iter().map(|p| pixel(p[0] / p[2], p[1] / p[2])).collect::<Vec<_>>());
    let line = "estimate --model plane-bearing --source p.csv --target q.csv --camera 600,610,320,240";
    let result = desk
        .json(&format!("{line} --depth 1.7 --transformed-out moved.csv --rotation quaternion --start=1~0~0~.1~0~0~0"));
    let found = pose_of(&result["pose"]);
    assert!(degrees_between(&found, &truth) < 1e-6, "{}", degrees_between(&found, &truth));
    assert_eq!(result["theta"].as_array().unwrap().len(), 7);
    for i in 0..3 {
        assert!((found.translation[i] - depth * truth.translation[i]).abs() < 1e-8, "{found:?}");
        assert_eq!(found.translation[i], depth * result["theta"][4 + i].as_f64().unwrap());
    }
    let (moved, target) = (desk.read("moved.csv"), desk.read("q.csv"));
    let rows = moved.lines().skip_while(|line| line.starts_with('x'));
    for (a, b) in rows.zip(target.lines()) {
        let pixels = |line: &str| line.split(',').map(|v| v.parse::<f64>().unwrap()).collect::<Vec<_>>();
        assert!(pixels(a).iter().zip(&pixels(b)).all(|(u, v)| (u - v).abs() < 1e-5), "{a} / {b}");
    }
}

#[test]
fn fixed_parameters_stay_where_the_start_puts_them() {
    let desk = Desk::new();
    let rows = cloud(400, 11);
    desk.write_rows("p.csv", &rows);
    desk.write_rows("q.csv", &apply(&euler_pose([0.0, 0.0, 0.3], [0.1, 0.0, 0.25]), &rows));
    let problem = "--model rigid3 --source p.csv --target q.csv --free tx,rz";
    let result = desk.json(&format!("estimate {problem} --start=0,0,.1,0,0,.25"));
    let theta: Vec<f64> = serde_json::from_value(result["theta"].clone()).unwrap();
    assert_eq!(result["free"], json!(["rz", "tx"]));
    for (value, expected) in theta.iter().zip([0.0, 0.0, 0.3, 0.1, 0.0, 0.25]) {
        assert!((value - expected).abs() < 1e-9, "{theta:?}");
    }
    assert_eq!((theta[4], theta[5]), (0.0, 0.25));
    let evaluation = desk.json(&format!("evaluate {problem} --at=0,0,.1,0,0,.25"));
    assert_eq!(evaluation["jacobian"][0].as_array().unwrap().len(), 2);
}

#[test]
fn a_homography_is_given_in_pixels() {
    let desk = Desk::new();
    let h = [[1.05, 0.04, 12.0], [-0.03, 0.97, -8.0], [2e-5, -1e-5, 1.0]];
    let source: Vec<Vec<f64>> = cloud(600, 12).iter().map(|p| vec![200.0 * p[0] + 80.0, 200.0 * p[1] + 60.0]).collect();
    let image = |p: &Vec<f64>| {
        let y = h.map(|row| row[0] * p[0] + row[1] * p[1] + row[2]);
        vec![y[0] / y[2], y[1] / y[2]]
    };
    let mut target: Vec<Vec<f64>> = source.iter().map(image).collect();
    shuffle(&mut target, 13);
    desk.write_rows("p.csv", &source);
    desk.write_rows("q.csv", &target);
    let line = "estimate --model homography --preset paper --source p.csv --target q.csv --features hermite[degree=4] --normalise whiten";
    let result = desk.json(&format!("{line} --camera 500,510,320,240"));
    for i in 0..3 {
        for k in 0..3 {
            let found = result["homography"][i][k].as_f64().unwrap();
            assert!((found - h[i][k]).abs() < 1e-6 * h[i][k].abs().max(1.0), "{i} {k}: {result}");
        }
    }
    assert_eq!(result["homography"][2][2], 1.0);
}

#[test]
fn parameters_have_names_in_the_plane_too() {
    let desk = Desk::new();
    let rows: Vec<Vec<f64>> = cloud(50, 1).into_iter().map(|p| p[..2].to_vec()).collect();
    desk.write_rows("p.csv", &rows);
    let free =
        |model: &str| desk.json(&format!("estimate --model {model} --source p.csv --target p.csv"))["free"].clone();
    assert_eq!(free("rigid2"), json!(["angle", "tx", "ty"]));
    assert_eq!(free("similarity2"), json!(["angle", "tx", "ty", "scale"]));
}

#[test]
fn a_deadline_and_a_signal_end_an_estimate_with_the_best_so_far() {
    let desk = Desk::new();
    let mut rng = ChaCha12Rng::seed_from_u64(2);
    let mut row = || -> Vec<f64> {
        let v: Vec<f64> = (0..3).map(|_| rng.random_range(-1.0..1.0)).collect();
        vec![v[0], v[1], v[2] * (1.2 + v[0] * v[1])]
    };
    let rows: Vec<Vec<f64>> = (0..20_000).map(|_| row()).collect();
    let half: Vec<Vec<f64>> = rows.iter().filter(|p| p[0] > 0.0).map(|p| vec![-p[1], p[0], p[2] + 0.3]).collect();
    desk.write_rows("p.csv", &rows);
    desk.write_rows("q.csv", &half);
    let line = "estimate --source p.csv --target q.csv --model rigid3";
    let late = desk.json(&format!("{line} --deadline 0.02"));
    assert_eq!((late["status"].as_str(), late["verdict"].as_str()), (Some("deadline"), Some("suspect")), "{late}");
    for wrong in ["0", "-1", "soon", "nan"] {
        assert_eq!(desk.run(&format!("{line} --deadline={wrong}")).code, 2);
    }
    // The signal comes at the first iteration that is printed.
    let mut child = Command::new(env!("CARGO_BIN_EXE_cfpose"))
        .args(line.split(' ').chain(["--verbose", "--json", "stopped.json"]))
        .current_dir(desk.path(""))
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program starts");
    let mut lines = BufReader::new(child.stderr.take().expect("a pipe")).lines();
    assert!(lines.next().expect("a line").expect("text").contains("iteration"));
    let sent = Command::new("kill").args(["-INT", &child.id().to_string()]).status().expect("kill runs");
    assert!(sent.success());
    let rest: Vec<String> = lines.map(|line| line.expect("text")).collect();
    assert_eq!(child.wait().expect("the program ends").code(), Some(130));
    assert!(rest.last().is_some_and(|line| line.contains("stopped by SIGINT")), "{rest:?}");
    let stopped: serde_json::Value = serde_json::from_str(&desk.read("stopped.json")).expect("JSON");
    assert_eq!(stopped["status"], "cancelled");
}

/// A closed curve without symmetry and its image, turned by .5 and shifted by (.2, 0).
fn curve_and_image(rng: &mut ChaCha12Rng, count: usize, dense: f64) -> [Vec<Vec<f64>>; 2] {
    let (sin, cos) = 0.5_f64.sin_cos();
    let sample = |rng: &mut ChaCha12Rng, power: f64| -> Vec<[f64; 2]> {
        let point = |rng: &mut ChaCha12Rng| {
            let t = std::f64::consts::TAU * rng.random_range(0.0_f64..1.0).powf(power);
            let r = 1.0 + 0.3 * (3.0 * t).cos() + 0.2 * (2.0 * t).sin();
            [r * t.cos(), r * t.sin()]
        };
        (0..count).map(|_| point(rng)).collect()
    };
    let source = sample(rng, 1.0).into_iter().map(|[x, y]| vec![x, y]).collect();
    let moved = |[x, y]: [f64; 2]| vec![cos * x - sin * y + 0.2, sin * x + cos * y];
    [source, sample(rng, dense).into_iter().map(moved).collect()]
}

#[test]
fn stray_points_are_named_and_take_no_part() {
    let desk = Desk::new();
    let mut rng = ChaCha12Rng::seed_from_u64(3);
    let [source, target] = curve_and_image(&mut rng, 600, 1.0);
    let (mut far, mut stray_source) = (target.clone(), source.clone());
    (far[99], far[331]) = (vec![3e4, -1e4], vec![-40.0, 80.0]);
    stray_source[7] = vec![1e6, 1e6];
    desk.write_rows("p.csv", &source);
    desk.write_rows("q.csv", &far);
    desk.write_rows("p2.csv", &stray_source);
    for (p, rows, rows_source) in [("p.csv", json!([100, 332]), json!([])), ("p2.csv", json!([100, 332]), json!([8]))] {
        let line = format!("--model rigid2 --source {p} --target q.csv");
        let result = desk.json(&format!("estimate {line}"));
        assert_eq!((&result["stray"], &result["stray_source"]), (&rows, &rows_source));
        assert_eq!(result["verdict"], "good", "{result}");
        assert!((result["theta"][0].as_f64().unwrap() - 0.5).abs() < 0.01, "{result}");
        // What is evaluated later leaves the same rows out.
        desk.write("r.json", result.to_string());
        let cost = desk.json(&format!("evaluate {line} --at r.json"))["cost"].as_f64().unwrap();
        assert!((cost / result["cost"].as_f64().unwrap() - 1.0).abs() < 1e-9);
    }
}

#[test]
fn points_are_thinned_and_weighed_as_the_flags_say() {
    let desk = Desk::new();
    let mut rng = ChaCha12Rng::seed_from_u64(4);
    let [source, target] = curve_and_image(&mut rng, 1500, 2.5);
    desk.write_rows("p.csv", &source);
    desk.write_rows("q.csv", &target);
    let line = "estimate --model rigid2 --source p.csv --target q.csv --preset paper --features hermite[degree=3]";
    let off = |flags: &str| {
        let result = desk.json(&format!("{line} {flags}"));
        (result["theta"][0].as_f64().unwrap() - 0.5).abs()
    };
    // The means of a target that is dense on one side are not those of the shape, until its points weigh what they stand for.
    let (plain, weighed, thinned) = (off(""), off("--weights density"), off("--thin 0.05"));
    assert!(plain > 0.05 && weighed < 0.3 * plain && thinned < 0.3 * plain, "{plain} {weighed} {thinned}");
    let run = desk.run(&format!("{line} --thin 0.05"));
    assert!(run.err.contains("--thin keeps") && run.err.contains("of 1500 points"), "{}", run.err);
    for wrong in ["--thin 0", "--thin -1", "--thin few", "--weights heavy"] {
        assert_eq!(desk.run(&format!("{line} {wrong}")).code, 2, "{wrong}");
    }
}

#[test]
fn a_wrong_name_in_a_pipeline_file_is_a_fault_of_the_file() {
    let desk = motivation();
    let line = "estimate --model gain1 --source p.csv --target q.csv --pipeline s.toml";
    for (text, says) in [
        ("[[stage]]\nname = \"only\"\nfeatures = \"coordinate\"\n", "stage `only`: unknown family `coordinate`"),
        ("[[stage]]\nname = \"a\"\nfeatures = \"coordinates\"\nsolver = \"newtonn\"\n", "stage `a`: unknown solver"),
        (
            "global-start = \"grit\"\n[[stage]]\nname = \"a\"\nfeatures = \"coordinates\"\n",
            "global-start: unknown start",
        ),
    ] {
        desk.write("s.toml", text);
        let run = desk.run(line);
        assert_eq!(run.code, 3, "{}", run.err);
        assert!(run.err.contains(&format!("s.toml: {says}")), "{}", run.err);
    }
}
