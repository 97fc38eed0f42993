//! `--bounds` and `--prior`: what they do, and what is said about those that cannot be used.

mod common;

use common::{Desk, apply, cloud, degrees_between, euler_pose, pose_of, shuffle};
use serde_json::{Value, json};

const LINE: &str = "estimate --model rigid3 --source p.csv --target q.csv";

fn pair() -> (Desk, cfpose::Pose) {
    let desk = Desk::new();
    let truth = euler_pose([0.1, -0.2, 0.6], [0.3, 0.1, -0.2]);
    let rows = cloud(300, 21);
    let mut moved = apply(&truth, &rows);
    shuffle(&mut moved, 22);
    desk.write_rows("p.csv", &rows);
    desk.write_rows("q.csv", &moved);
    (desk, truth)
}

#[test]
fn bounds_hold_the_truth_or_make_the_answer_suspect() {
    let (desk, truth) = pair();
    let result = desk.json(&format!("{LINE} --bounds rz=0..60deg,tx=0.1..,ty=..0.5"));
    assert!(degrees_between(&pose_of(&result["pose"]), &truth) < 1e-3);
    assert_eq!(result["verdict"], "good");
    let result = desk.json(&format!("{LINE} --bounds tx=-1..0.25"));
    assert!(result["pose"]["translation"][0].as_f64().unwrap() <= 0.25);
    assert_eq!(result["verdict"], "suspect");
    assert!(result["prior"].is_null());
}

#[test]
fn a_result_is_a_prior_and_another_one_disagrees() {
    let (desk, truth) = pair();
    let result = desk.json(LINE);
    desk.write("mine.json", serde_json::to_string(&result).unwrap());
    let joined = desk.json(&format!("{LINE} --prior mine.json"));
    assert_eq!(joined["prior"]["used"], true);
    assert!(joined["prior"]["chi_square"].as_f64().unwrap() < 1.0, "{}", joined["prior"]);
    let variance = |result: &Value| result["covariance"][3][3].as_f64().unwrap();
    let ratio = variance(&joined) / variance(&result);
    assert!((ratio - 0.5).abs() < 0.05, "the same information twice halves the variance: {ratio}");
    // A hand-written one in Euler angles, two metres off.
    let covariance: Vec<Vec<f64>> = (0..6).map(|i| (0..6).map(|j| if i == j { 0.01 } else { 0.0 }).collect()).collect();
    let far = json!({"theta": [0.1, -0.2, 0.6, 2.3, 0.1, -0.2], "rotation_form": "euler", "covariance": covariance});
    desk.write("far.json", far.to_string());
    let refused = desk.json(&format!("{LINE} --prior far.json"));
    assert_eq!((&refused["prior"]["used"], &refused["verdict"]), (&json!(false), &json!("suspect")));
    assert!(degrees_between(&pose_of(&refused["pose"]), &truth) < 1e-3);
}

#[test]
fn what_is_no_bound_and_no_prior_is_said_in_one_line() {
    let (desk, _) = pair();
    for (flags, code, words) in [
        ("--bounds rz", 2, "expected NAME=LOW..HIGH"),
        ("--bounds rz=1..x", 2, "expected NAME=LOW..HIGH"),
        ("--bounds rz=..", 2, "expected NAME=LOW..HIGH"),
        ("--bounds wide=0..1", 2, "it has rx, ry, rz, tx, ty, tz"),
        ("--bounds tx=2..1", 2, "tx has no value between 2 and 1"),
        ("--bounds tx=1deg..2deg", 2, "only angles have degrees"),
        ("--bounds tx=1..2 --start 0,0,0,0,0,0", 2, "move it inside or widen them"),
        ("--prior absent.json", 3, "absent.json"),
        ("--prior p.csv", 3, "this is no JSON"),
    ] {
        let message = desk.fails(code, &format!("{LINE} {flags}"));
        assert!(message.contains(words) && message.lines().count() == 1, "{flags}: {message}");
    }
    let broken = [
        (json!({"theta": [0, 0, 0, 0, 0, 0]}), "\"covariance\" has to be a list of rows"),
        (json!({"theta": [0, 0, 0], "covariance": [[1.0]]}), "theta"),
        (json!({"covariance": [[1.0]]}), "there is no \"theta\""),
        (json!({"theta": [0, 0, 0, 0, 0, 0], "covariance": [[1.0]]}), "6 x 6"),
        (json!({"theta": [0, 0, 0, 0, 0, 0], "covariance": [[null]]}), "give it a large variance"),
        (json!({"theta": [0, 0, 0, 0, 0, 0], "covariance": vec![[0.0; 6]; 6]}), "has to be above 0"),
        (json!({"theta": [0, 0, 0, 0, 0, 0], "covariance": vec![[1.0; 6]; 6]}), "not positive definite"),
        (json!({"theta": [0, 0, 0, 0, 0, 0], "covariance": [[1.0, 2.0], [1.0]]}), "a row of \"covariance\""),
    ];
    for (content, words) in broken {
        desk.write("prior.json", content.to_string());
        let message = desk.fails(3, &format!("{LINE} --prior prior.json"));
        assert!(message.contains(words) && message.contains("prior.json"), "{content}: {message}");
    }
    let refused =
        desk.fails(2, "evaluate --model rigid3 --source p.csv --target q.csv --at 0,0,0,0,0,0 --bounds tx=0..1");
    assert!(refused.contains("leave it out"), "{refused}");
}
