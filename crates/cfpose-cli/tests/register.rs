//! `cfpose register` and `cfpose segment` on rendered images.

mod common;

use cfpose_lab::rendered::{CELLS, RenderedTrial, draw};
use cfpose_vision::overlay::to_png;
use common::{Desk, Run};
use serde_json::Value;

const CAMERA: &str = "--camera 600,600,319.5,239.5";

/// Write reference.png and frame.png of a trial.
fn write(desk: &Desk, cell: &str, number: u64) -> RenderedTrial {
    let cell = CELLS.iter().find(|known| known.name == cell).unwrap();
    let trial = draw(cell, 77, number);
    desk.write("reference.png", to_png(&trial.reference.to_rgb()).unwrap());
    desk.write("frame.png", to_png(&trial.frame.to_rgb()).unwrap());
    trial
}

fn lines(run: &Run) -> Vec<Value> {
    run.out.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

/// Return the mean reprojection error over the test places, pixels.
fn error(line: &Value, trial: &RenderedTrial) -> f64 {
    let rows = line["homography"].as_array().unwrap().iter();
    let numbers: Vec<f64> = rows.flat_map(|row| row.as_array().unwrap()).map(|value| value.as_f64().unwrap()).collect();
    let h: [f64; 9] = numbers.try_into().unwrap();
    let apply = cfpose::homography::apply;
    let distance = |p: &[f64; 2]| {
        let (a, b) = (apply(&h, *p), apply(&trial.homography, *p));
        (a[0] - b[0]).hypot(a[1] - b[1])
    };
    trial.test_places.iter().map(distance).sum::<f64>() / trial.test_places.len() as f64
}

#[test]
fn frames_become_poses_pictures_and_rows() {
    let desk = Desk::new();
    let trial = write(&desk, "clean25", 1);
    desk.write("broken.png", "no image");
    let run = desk
        .run(&format!("register reference.png frame.png broken.png frame.png {CAMERA} --json - --out out --fps 10"));
    assert_eq!(run.code, 0, "{}", run.err);
    let lines = lines(&run);
    assert_eq!(lines.len(), 3);
    for line in [&lines[0], &lines[2]] {
        assert_eq!(line["verdict"], "good");
        assert!(error(line, &trial) < 0.1, "{line}");
        assert_eq!(line["pose"]["convention"], "camera_from_pattern");
        assert_eq!(line["covariance"].as_array().unwrap().len(), 6);
    }
    // A frame that cannot be read is lost with the reason, and the sequence goes on.
    assert_eq!(lines[1]["verdict"], "lost");
    assert!(lines[1]["warnings"][0].as_str().unwrap().contains("neither PNG nor JPEG"), "{}", lines[1]);
    assert_eq!(lines[2]["time"], 0.2);
    for file in ["overlay/frame.png", "contact.png", "poses.tum", "frames.csv"] {
        assert!(desk.path("out").join(file).metadata().unwrap().len() > 0, "{file}");
    }
    let strict = desk.run(&format!("register reference.png frame.png broken.png {CAMERA} --strict"));
    assert!(strict.code == 4 && strict.err.contains("1 of 2 frames"), "{}", strict.err);
}

#[test]
fn models_without_a_camera_and_wrong_input_say_what_they_are() {
    let desk = Desk::new();
    let trial = write(&desk, "clean25", 2);
    let run = desk.run("register reference.png frame.png --json -");
    assert_eq!(run.code, 0, "{}", run.err);
    assert!(error(&lines(&run)[0], &trial) < 0.3, "{}", run.out);
    let no_camera = desk.fails(2, "register reference.png frame.png --model plane-bearing");
    assert!(no_camera.contains("--camera"), "{no_camera}");
    let not_planar = desk.fails(2, &format!("register reference.png frame.png --model rigid3 {CAMERA}"));
    assert!(not_planar.contains("maps no image"), "{not_planar}");
    let flat = cfpose_vision::Picture::from_grey(64, 48, &[9; 64 * 48]).unwrap();
    desk.write("flat.png", to_png(&flat.to_rgb()).unwrap());
    let no_reference = desk.fails(3, "register flat.png frame.png");
    assert!(no_reference.contains("one colour"), "{no_reference}");
    let all_lost = desk.run("register reference.png flat.png --json -");
    assert_eq!((all_lost.code, lines(&all_lost)[0]["verdict"].as_str()), (4, Some("lost")));
    let matrix = "camera_matrix: [600.0, 0.0, 319.5, 0.0, 600.0, 239.5, 0.0, 0.0, 1.0]";
    desk.write("camera.yaml", format!("image_width: 1280\nimage_height: 720\n{matrix}\n"));
    let wrong_size = desk.fails(3, "register reference.png frame.png --camera camera.yaml");
    assert!(wrong_size.contains("1280 x 720"), "{wrong_size}");
}

#[test]
fn segment_shows_what_is_taken_for_the_pattern() {
    let desk = Desk::new();
    write(&desk, "blob20", 0);
    let value = desk.json("segment frame.png --out seen --transfer linear");
    assert_eq!(value["pattern"], "dark");
    assert!((value["level"].as_f64().unwrap() - 0.3).abs() < 0.02, "{value}");
    assert!(value["hidden_pixels"].as_u64().unwrap() > 1000, "{value}");
    for file in ["coverage.png", "mask.png", "contour.png", "coverage.csv"] {
        assert!(desk.path("seen").join(file).metadata().unwrap().len() > 0, "{file}");
    }
}
