//! What `estimate` finds on data with a known answer, and where it writes it.

mod common;

use common::{Desk, apply, cloud, degrees_between, euler_pose, pose_of, random_pose, shuffle};
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
    let result = desk.json("estimate --model gain1 --source p.csv --target q.csv --sampling same --seed 7");
    let names: Vec<&str> = result.as_object().unwrap().keys().map(String::as_str).collect();
    let expected = "schema model features solver normalise weighting preset sampling seed isa num_source num_target theta free \
                    pose homography correspondence cost status usable iterations evaluations starts seconds covariance \
                    j_statistic degrees_of_freedom p_value noise_sigma verdict message alternatives warnings condition";
    assert_eq!(names, expected.split_whitespace().collect::<Vec<_>>());
    assert_eq!(result["schema"], "cfpose.estimate/1");
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
    let again = "estimate --model rigid3 --target q.csv --features hermite";
    let identity = desk.json(&format!("{again} --source moved.ply"));
    let angle = degrees_between(&pose_of(&identity["pose"]), &random_identity());
    assert!(angle < 1e-6, "{angle}");
    for start in ["r.json", "pose.txt"] {
        let warm = desk.json(&format!("{again} --source p.csv --start {start}"));
        assert!(warm["iterations"].as_u64().unwrap() <= 2, "{warm}");
        assert!(degrees_between(&pose_of(&warm["pose"]), &truth) < 1e-6);
    }
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
    let line =
        "estimate --model homography --source p.csv --target q.csv --features hermite[degree=4] --normalise whiten";
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
